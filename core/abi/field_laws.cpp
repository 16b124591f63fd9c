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
    list();
  }

  bool sample(int i) {
    found_.sample = i;
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
    law(kLeaves, handed == points, "evaluate changes its arguments");
    pure(t, points, all);
    for (int k = 0; k < (is_of_time(f_.quantity) ? 1 : kPoints); ++k) one(t, {points.begin() + 3 * k, points.begin() + 3 * k + 3}, k, all);
    if (f_.edges) edges(t, points);
    if (f_.facts & CARDAN_FIELD_STEADY) {
      if (!prepare(t + 321.5)) return true;
      const Given later = evaluate(t + 321.5, points);
      law(kSteady, later.values == all.values);
    }
    return found_.few();
  }
  std::vector<std::string> take(LawRecord* record) {
    if (found_.none()) law(kAccepts, taken_ > 0, "every random point is beyond its limits: does `distance` fit?");
    return found_.take(record);
  }

 private:
  static constexpr const char *kPure = "evaluate is a function of its arguments",
                              *kWith = "evaluate gives the same values whether gradients are wanted or not",
                              *kFinite = "numbers are finite within the limits",
                              *kAlone = "a point alone has the numbers that it has among others",
                              *kPrepare = "prepare is a function of time", *kCodes = "codes are of declared limits",
                              *kSteady = "a steady field is the same at another time", *kDensity = "a density is not negative",
                              *kUnit = "an attitude is a unit quaternion",
                              *kNoPotential = "gravity without CARDAN_FIELD_POTENTIAL has 0 for its potential",
                              *kGradient = "gradients are the derivatives of values", *kPotential = "a = -grad U", *kDivergence = "div = 0",
                              *kCurl = "curl = 0", *kEdges = "edges are finite functions of place and time, as many as are told";

  static constexpr int kPoints = 3;
  struct Given {
    int beyond = 0;
    std::vector<double> values, gradients;
  };

  /// What is tried of this field, and why the rest is not.
  void list() {
    for (const char* always : {kPack, kAccepts, kWrites, kLeaves, kPure, kWith, kFinite}) found_.list(always);
    const auto of = [&](const char* law, bool applies, const char* lacks) { found_.list(law, applies ? "no sample came to it" : lacks); };
    of(kAlone, !is_of_time(f_.quantity), "it depends on time alone");
    of(kPrepare, f_.prepare, "it has no prepare");
    of(kCodes, true, "");
    of(kSteady, (f_.facts & CARDAN_FIELD_STEADY) != 0, "CARDAN_FIELD_STEADY is not declared");
    of(kDensity, f_.quantity == CARDAN_DENSITY, "it is no density");
    of(kUnit, f_.quantity == CARDAN_ATTITUDE, "it is no attitude");
    const bool gravity = f_.quantity == CARDAN_GRAVITY, potential = (f_.facts & CARDAN_FIELD_POTENTIAL) != 0;
    of(kNoPotential, gravity && !potential, gravity ? "CARDAN_FIELD_POTENTIAL is declared" : "it is no gravity");
    of(kGradient, (f_.facts & CARDAN_FIELD_GRADIENT) != 0, "CARDAN_FIELD_GRADIENT is not declared");
    of(kPotential, potential, "CARDAN_FIELD_POTENTIAL is not declared");
    of(kDivergence, source_free(), "CARDAN_FIELD_SOURCE_FREE is not declared");
    of(kCurl, curl_free(), "neither CARDAN_FIELD_CURL_FREE nor a potential is declared");
    of(kEdges, f_.edges, "it has none");
  }
  bool source_free() const { return (f_.facts & CARDAN_FIELD_SOURCE_FREE) != 0 || f_.quantity == CARDAN_MAGNETIC; }
  bool curl_free() const { return (f_.facts & (CARDAN_FIELD_CURL_FREE | CARDAN_FIELD_POTENTIAL)) != 0; }
  template <class... Arguments>
  void law(const Arguments&... arguments) {
    found_.law(arguments...);
  }
  double normal() { return std::normal_distribution<double>()(rng_); }
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(rng_); }

  bool pack() {
    PackedSample packed = packed_at_random(f_, rng_(), before_);
    law(kPack, packed.fault.empty(), packed.fault);
    if (!packed.fault.empty()) return false;
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
    law(kWrites, std::all_of(bytes + f_.prepared_size, bytes + first.size() * sizeof(double), [](unsigned char b) { return b == kMark; }),
        "prepare writes beyond prepared_size");
    law(kPrepare, std::memcmp(first.data(), second.data(), f_.prepared_size) == 0,
        "prepare is a function of time: other bytes at the second call");
    law(kLeaves, packed == packed_, "prepare changes its parameters");
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
    law(kCodes, code >= 0 && (code >> f_.n_limits) == 0, fmt::format("{} returns {}, and there are {} limits", of, code, f_.n_limits));
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
    law(kWrites, values.intact() && slopes.intact(), "evaluate writes beyond its arrays");
    out.values.assign(values.data(), values.data() + n * size_);
    if (wanted) out.gradients.assign(slopes.data(), slopes.data() + 3 * n * size_);
    return out;
  }
  static bool same(const Given& a, const Given& b) {
    return a.beyond == b.beyond && same_bits(a.values, b.values) && same_bits(a.gradients, b.gradients);
  }

  void pure(double t, const std::vector<double>& points, const Given& all) {
    const std::vector<double> packed = packed_, prepared = prepared_;
    std::vector<double> elsewhere = points;
    for (double& x : elsewhere) x *= 1.1;
    evaluate(t, elsewhere);  // what it may remember
    const Given again = evaluate(t, points);
    law(kPure, same(again, all), "evaluate is a function of its arguments: other numbers at the second call");
    Given on_thread;
    in_another_thread([&] { on_thread = evaluate(t, points); });
    law(kPure, same(on_thread, all), "evaluate is a function of its arguments: other numbers on another thread");
    law(kWith, evaluate(t, points, false).values == all.values);
    law(kLeaves, packed == packed_ && prepared == prepared_, "evaluate changes its arguments");
  }

  void one(double t, const std::vector<double>& x, int k, const Given& all) {
    const Given y = evaluate(t, x);
    limits("evaluate", y.beyond);
    if ((y.beyond & ~holding()) != 0) return;  // there it knows nothing
    const auto slice = [&](const std::vector<double>& from, std::size_t n) {
      return std::vector<double>(from.begin() + static_cast<std::ptrdiff_t>(n) * k,
                                 from.begin() + static_cast<std::ptrdiff_t>(n) * (k + 1));
    };
    law(kAlone, slice(all.values, size_) == y.values && (y.gradients.empty() || slice(all.gradients, 3 * size_) == y.gradients));
    for (const auto* list : {&y.values, &y.gradients})
      for (const double number : *list) {
        law(kFinite, std::isfinite(number), fmt::format("evaluate gives {}", number));
        if (!std::isfinite(number)) return;
      }
    ++taken_;
    values(y);
    if (!is_of_time(f_.quantity) && y.beyond == 0) derivatives(t, x, y);
  }

  void edges(double t, const std::vector<double>& points) {
    before_("edges");
    const cardan_field_args a{sizeof a, t, packed_.data(), f_.prepare ? prepared_.data() : nullptr};
    const std::uint32_t n = f_.edges(&a, nullptr, nullptr);
    law(kEdges, n <= CARDAN_FIELD_EDGES, fmt::format("edges tells {}, expected at most {}", n, +CARDAN_FIELD_EDGES));
    if (n > CARDAN_FIELD_EDGES) return;
    const std::vector<double> packed = packed_, prepared = prepared_;
    for (int k = 0; k < kPoints; ++k) {
      Handed first(n), second(n);
      law(kEdges, f_.edges(&a, points.data() + 3 * k, first.data()) == n && f_.edges(&a, points.data() + 3 * k, second.data()) == n,
          "edges tells another number with values");
      law(kWrites, first.intact() && second.intact(), "edges writes beyond its array");
      law(kEdges, std::all_of(first.data(), first.data() + n, [](double g) { return std::isfinite(g); }), "edges gives what is not finite");
      law(kPure, std::memcmp(first.data(), second.data(), n * sizeof(double)) == 0, "edges gives other numbers at the second call");
    }
    law(kLeaves, packed == packed_ && prepared == prepared_, "edges changes its arguments");
  }

  void values(const Given& y) {
    if (f_.quantity == CARDAN_DENSITY) law(kDensity, -y.values[0], 0.0);
    if (f_.quantity == CARDAN_ATTITUDE)
      law(kUnit, std::abs(std::hypot(std::hypot(y.values[0], y.values[1]), std::hypot(y.values[2], y.values[3])) - 1.0), 1e-12);
    if (f_.quantity == CARDAN_GRAVITY && !(f_.facts & CARDAN_FIELD_POTENTIAL)) law(kNoPotential, y.values[3] == 0.0);
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
      law(kGradient, differ(i / 3, G[i], slope[0][i]), 1e-6, 0.0, fmt::format("value {} along {}", i / 3, "xyz"[i % 3]));
    const double tiny = y.gradients.empty() ? 1e-7 : 1e-11;
    if (f_.facts & CARDAN_FIELD_POTENTIAL) {
      const double a = std::hypot(y.values[0], y.values[1], y.values[2]);
      for (std::size_t j = 0; j < 3; ++j) law(kPotential, std::abs(G[9 + j] + y.values[j]) / (a + 1e-300), std::max(tiny, 1e-11));
    }
    if (!is_field_vector(f_.quantity) || size == 0.0) return;
    if (source_free()) law(kDivergence, std::abs(G[0] + G[4] + G[8]) / size, tiny);
    if (curl_free()) law(kCurl, std::hypot(G[7] - G[5], G[2] - G[6], G[3] - G[1]) / size, tiny);
  }

  const cardan_field_family& f_;
  std::mt19937_64 rng_;
  const TellPhase& before_;
  std::size_t size_ = 0;
  double distance_ = 1.0;
  std::vector<double> packed_, prepared_;
  int taken_ = 0;
  Violations found_;
};

}  // namespace

std::vector<std::string> field_table_faults(const cardan_field_family& family) { return FieldTableFaults(family).all(); }

std::vector<std::string> field_law_violations(const cardan_field_family& family, int samples, std::uint64_t seed, const TellPhase& before,
                                              LawRecord* record) {
  if (auto faults = field_table_faults(family); !faults.empty()) return faults;
  FieldLaws laws(family, seed, before);
  for (int i = 0; i < samples; ++i)
    if (!laws.sample(i)) break;
  return laws.take(record);
}

}  // namespace cardan
