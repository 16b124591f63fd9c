#include "core/abi/field_laws.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <set>
#include <string_view>

#include "core/abi/field_family.hpp"
#include "core/abi/law_tools.hpp"

namespace cardan {
namespace {

constexpr std::uint32_t kMostLimits = 31;
constexpr unsigned kFacts =
    CARDAN_FIELD_GRADIENT | CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;

class FieldTableFaults : public TableChecks {
 public:
  explicit FieldTableFaults(const cardan_field_family& family) : f_(family) {}

  std::vector<std::string> all() {
    text("type", f_.type, true);
    text("summary", f_.summary, false);
    expect(f_.quantity <= CARDAN_TIME, "quantity", fmt::format("{}, expected one of cardan_quantity", f_.quantity));
    expect((f_.facts & ~kFacts) == 0, "facts", fmt::format("{}, expected those of cardan_field_fact", f_.facts));
    expect(f_.distance >= 0.0 && std::isfinite(f_.distance), "distance", fmt::format("{:g}, expected >= 0", f_.distance));
    parameters(f_.params, f_.n_params);
    expect(f_.n_limits <= kMostLimits, "n_limits", fmt::format("{}, expected at most {}", f_.n_limits, kMostLimits));
    expect(f_.n_limits == 0 || f_.limits, "limits", "null");
    for (std::uint32_t i = 0; f_.limits && f_.n_limits <= kMostLimits && i < f_.n_limits; ++i) {
      text(fmt::format("limits[{}].name", i), f_.limits[i].name, true);
      text(fmt::format("limits[{}].meaning", i), f_.limits[i].meaning, false);
      expect(f_.limits[i].holds <= 1, fmt::format("limits[{}].holds", i), fmt::format("{}, expected 0 or 1", f_.limits[i].holds));
    }
    expect(f_.evaluate, "evaluate", "null");
    expect(f_.n_params == 0 || f_.pack, "pack", "null, and there are parameters");
    expect(f_.params_size <= kMostBytes, "params_size", fmt::format("{}, expected at most {}", f_.params_size, kMostBytes));
    expect(f_.prepared_size <= kMostBytes, "prepared_size", fmt::format("{}, expected at most {}", f_.prepared_size, kMostBytes));
    expect(f_.prepared_size == 0 || f_.prepare, "prepare", "null, and prepared_size is not 0");
    if (good()) details();
    return take();
  }

 private:
  void details() {
    const auto only = [&](unsigned fact, bool fits, const char* what) { expect((f_.facts & fact) == 0 || fits, "facts", what); };
    only(CARDAN_FIELD_POTENTIAL, f_.quantity == CARDAN_GRAVITY, "CARDAN_FIELD_POTENTIAL, which is of gravity alone");
    only(CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE, is_field_vector(f_.quantity),
         "a divergence or curl of what is no vector in space");
    only(CARDAN_FIELD_GRADIENT, !is_of_time(f_.quantity), "CARDAN_FIELD_GRADIENT of what depends on time alone");
  }
  const cardan_field_family& f_;
};

class FieldLaws {
 public:
  FieldLaws(const cardan_field_family& family, std::uint64_t seed, const TellPhase& before) : f_(family), rng_(seed), before_(before) {
    size_ = field_size(f_.quantity);
    distance_ = f_.distance > 0.0 ? f_.distance : 1.0;
  }

  bool sample(int i) {
    sample_ = i;
    if (!pack()) return false;
    const double t = uniform(0.0, 1000.0);
    std::vector<double> points;
    for (int k = 0; k < kPoints; ++k) {
      double d[3] = {normal(), normal(), normal()};
      const double scale = distance_ * uniform(0.7, 1.6) / std::hypot(d[0], d[1], d[2]);
      for (const double x : d) points.push_back(scale * x);
    }
    if (!prepare(t)) return true;
    const std::vector<double> handed = points;
    const Given all = evaluate(t, points);
    if (handed != points) tell("evaluate changes its arguments");
    pure(t, points, all);
    for (int k = 0; k < (is_of_time(f_.quantity) ? 1 : kPoints); ++k) one(t, {points.begin() + 3 * k, points.begin() + 3 * k + 3}, k, all);
    if (f_.facts & CARDAN_FIELD_STEADY) {
      if (!prepare(t + 321.5)) return true;
      const Given later = evaluate(t + 321.5, points);
      if (later.values != all.values) tell("a steady field is the same at another time");
    }
    return found_.size() < 20;
  }
  std::vector<std::string> take() {
    if (taken_ == 0 && found_.empty()) tell("every random point is beyond its limits: does `distance` fit?");
    return std::move(found_);
  }

 private:
  static constexpr int kPoints = 3;
  struct Given {
    int beyond = 0;
    std::vector<double> values, gradients;
  };

  void tell(const std::string& what) { found_.push_back(fmt::format("{} (sample {})", what, sample_)); }
  void law(std::string_view name, double error, double limit) {
    if (!(error <= limit)) found_.push_back(fmt::format("{}: error {:.2g} (limit {:.0e}, sample {})", name, error, limit, sample_));
  }
  double normal() { return std::normal_distribution<double>()(rng_); }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(rng_); }

  bool pack() {
    PackedSample packed = packed_at_random(f_, rng_(), before_);
    if (!packed.fault.empty()) {
      found_.push_back(packed.fault);
      return false;
    }
    packed_ = std::move(packed.block);
    return true;
  }

  /// Twice, with guards: the same bytes.
  bool prepare(double t) {
    prepared_.clear();
    if (!f_.prepare) return true;
    before_("prepare");
    const std::vector<double> packed = packed_;
    constexpr unsigned char kMark = 0xA5;
    const std::size_t margin = 64;
    std::vector<double> first((f_.prepared_size + margin) / sizeof(double) + 1), second = first;
    std::memset(first.data(), kMark, first.size() * sizeof(double)), std::memset(second.data(), kMark, second.size() * sizeof(double));
    const int code = f_.prepare(t, packed_.data(), first.data());
    f_.prepare(t + 7.25, packed_.data(), second.data());  // what it may remember
    std::memset(second.data(), kMark, second.size() * sizeof(double));
    f_.prepare(t, packed_.data(), second.data());
    const auto* bytes = reinterpret_cast<const unsigned char*>(first.data());
    if (std::any_of(bytes + f_.prepared_size, bytes + first.size() * sizeof(double), [](unsigned char b) { return b != kMark; }))
      tell("prepare writes beyond prepared_size");
    if (std::memcmp(first.data(), second.data(), f_.prepared_size) != 0)
      tell("prepare is a function of time: other bytes at the second call");
    if (packed != packed_) tell("prepare changes its parameters");
    prepared_ = std::move(first);
    limits("prepare", code);
    return (code & ~holding()) == 0;
  }
  int holding() const {
    int bits = 0;
    for (std::uint32_t i = 0; i < f_.n_limits; ++i) bits |= f_.limits[i].holds ? 1 << i : 0;
    return bits;
  }
  void limits(const char* of, int code) {
    if (code < 0 || (code >> f_.n_limits) != 0) tell(fmt::format("{} returns {}, and there are {} limits", of, code, f_.n_limits));
  }

  Given evaluate(double t, const std::vector<double>& points, bool gradients = true) {
    before_("evaluate");
    const std::size_t n = is_of_time(f_.quantity) ? 1 : points.size() / 3;
    Handed values(n * size_), slopes(3 * n * size_);
    const bool wanted = gradients && (f_.facts & CARDAN_FIELD_GRADIENT);
    const cardan_field_args a{sizeof a, t, packed_.data(), f_.prepare ? prepared_.data() : nullptr};
    Given out;
    out.beyond = f_.evaluate(&a, static_cast<std::uint32_t>(n), is_of_time(f_.quantity) ? nullptr : points.data(), values.data(),
                             wanted ? slopes.data() : nullptr);
    if (!values.intact() || !slopes.intact()) tell("evaluate writes beyond its arrays");
    out.values.assign(values.data(), values.data() + n * size_);
    if (wanted) out.gradients.assign(slopes.data(), slopes.data() + 3 * n * size_);
    return out;
  }
  static bool same(const Given& a, const Given& b) {
    const auto equal = [](const std::vector<double>& x, const std::vector<double>& y) {
      return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0;
    };
    return a.beyond == b.beyond && equal(a.values, b.values) && equal(a.gradients, b.gradients);
  }

  void pure(double t, const std::vector<double>& points, const Given& all) {
    const std::vector<double> packed = packed_, prepared = prepared_;
    std::vector<double> elsewhere = points;
    for (double& x : elsewhere) x *= 1.1;
    evaluate(t, elsewhere);  // what it may remember
    const Given again = evaluate(t, points);
    if (!same(again, all)) tell("evaluate is a function of its arguments: other numbers at the second call");
    Given on_thread;
    in_another_thread([&] { on_thread = evaluate(t, points); });
    if (!same(on_thread, all)) tell("evaluate is a function of its arguments: other numbers on another thread");
    if (evaluate(t, points, false).values != all.values) tell("evaluate gives the same values whether gradients are wanted or not");
    if (packed != packed_ || prepared != prepared_) tell("evaluate changes its arguments");
  }

  void one(double t, const std::vector<double>& x, int k, const Given& all) {
    const Given y = evaluate(t, x);
    limits("evaluate", y.beyond);
    if ((y.beyond & ~holding()) != 0) return;  // there it knows nothing
    const auto slice = [&](const std::vector<double>& from, std::size_t n) {
      return std::vector<double>(from.begin() + static_cast<std::ptrdiff_t>(n) * k,
                                 from.begin() + static_cast<std::ptrdiff_t>(n) * (k + 1));
    };
    if (slice(all.values, size_) != y.values || (!y.gradients.empty() && slice(all.gradients, 3 * size_) != y.gradients))
      tell("a point alone has the numbers that it has among others");
    for (const auto* list : {&y.values, &y.gradients})
      for (const double number : *list)
        if (!std::isfinite(number)) return tell(fmt::format("evaluate gives {}", number));
    ++taken_;
    values(y);
    if (!is_of_time(f_.quantity) && y.beyond == 0) derivatives(t, x, y);
  }

  void values(const Given& y) {
    if (f_.quantity == CARDAN_DENSITY) law("a density is not negative", -y.values[0], 0.0);
    if (f_.quantity == CARDAN_ATTITUDE)
      law("an attitude is a unit quaternion",
          std::abs(std::hypot(std::hypot(y.values[0], y.values[1]), std::hypot(y.values[2], y.values[3])) - 1.0), 1e-12);
    if (f_.quantity == CARDAN_GRAVITY && !(f_.facts & CARDAN_FIELD_POTENTIAL) && y.values[3] != 0.0)
      tell("gravity without CARDAN_FIELD_POTENTIAL has 0 for its potential");
  }

  /// Differences of sixth order at two steps; where they differ, the field has a corner or is too curved.
  void derivatives(double t, const std::vector<double>& x, const Given& y) {
    std::vector<double> slope[2];
    bool smooth = true;
    for (const int coarse : {0, 1}) {
      const double h = (coarse ? 2e-3 : 1e-3) * distance_;
      slope[coarse].assign(3 * size_, 0.0);
      for (std::size_t j = 0; j < 3; ++j)
        for (const auto& [steps, weight] : {std::pair(1, 45.0), std::pair(2, -9.0), std::pair(3, 1.0)})
          for (const int side : {1, -1}) {
            std::vector<double> moved = x;
            moved[j] += side * steps * h;
            const Given there = evaluate(t, moved, false);
            smooth = smooth && there.beyond == y.beyond;
            for (std::size_t k = 0; k < size_; ++k) slope[coarse][3 * k + j] += side * weight * there.values[k] / (60.0 * h);
          }
    }
    double size = 0.0;  // of each row: a potential is of another size than its slope
    std::vector<double> scale(size_, 0.0);
    for (std::size_t k = 0; k < size_; ++k)
      for (std::size_t j = 0; j < 3; ++j) scale[k] = std::max(scale[k], std::abs(slope[0][3 * k + j]));
    for (std::size_t k = 0; k < std::min<std::size_t>(size_, 3); ++k) size = std::max(size, scale[k]);
    const auto differ = [&](std::size_t row, double a, double b) {
      const double least = std::abs(y.values[row]) / distance_;  // what rounding leaves of differences is of this size
      return std::abs(a - b) / (scale[row] + 1e-3 * least + 1e-300);
    };
    for (std::size_t i = 0; i < 3 * size_; ++i) smooth = smooth && differ(i / 3, slope[0][i], slope[1][i]) < 1e-7;
    if (!smooth) return;
    const std::vector<double>& G = y.gradients.empty() ? slope[0] : y.gradients;
    for (std::size_t i = 0; i < y.gradients.size(); ++i)
      law(fmt::format("gradients are the derivatives of values (value {} along {})", i / 3, "xyz"[i % 3]), differ(i / 3, G[i], slope[0][i]),
          1e-6);
    const double tiny = y.gradients.empty() ? 1e-7 : 1e-11;
    if (f_.facts & CARDAN_FIELD_POTENTIAL) {
      const double a = std::hypot(y.values[0], y.values[1], y.values[2]);
      for (std::size_t j = 0; j < 3; ++j) law("a = -grad U", std::abs(G[9 + j] + y.values[j]) / (a + 1e-300), std::max(tiny, 1e-11));
    }
    if (!is_field_vector(f_.quantity) || size == 0.0) return;
    const unsigned always = f_.quantity == CARDAN_MAGNETIC ? unsigned{CARDAN_FIELD_SOURCE_FREE} : 0u;
    if ((f_.facts | always) & CARDAN_FIELD_SOURCE_FREE) law("div = 0", std::abs(G[0] + G[4] + G[8]) / size, tiny);
    if (f_.facts & (CARDAN_FIELD_CURL_FREE | CARDAN_FIELD_POTENTIAL))
      law("curl = 0", std::hypot(G[7] - G[5], G[2] - G[6], G[3] - G[1]) / size, tiny);
  }

  const cardan_field_family& f_;
  std::mt19937_64 rng_;
  const TellPhase& before_;
  std::size_t size_ = 0;
  double distance_ = 1.0;
  std::vector<double> packed_, prepared_;
  int sample_ = 0, taken_ = 0;
  std::vector<std::string> found_;
};

}  // namespace

std::vector<std::string> field_table_faults(const cardan_field_family& family) { return FieldTableFaults(family).all(); }

std::vector<std::string> field_law_violations(const cardan_field_family& family, int samples, std::uint64_t seed, const TellPhase& before) {
  if (auto faults = field_table_faults(family); !faults.empty()) return faults;
  FieldLaws laws(family, seed, before);
  for (int i = 0; i < samples; ++i)
    if (!laws.sample(i)) break;
  return laws.take();
}

}  // namespace cardan
