#include "core/abi/law_tools.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <exception>
#include <thread>

#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;

double uniform(std::mt19937_64& rng) { return static_cast<double>(rng() >> 11) * 0x1.0p-53; }

/// A number inside of the range of a parameter; of order one where the range leaves it.
double random_number(const cardan_param_desc& d, std::mt19937_64& rng) {
  const double x = 0.3 + 0.7 * uniform(rng);  // in [0.3, 1): never an end that may be left out
  if (d.lower == 0.0 && d.upper == 0.0) return x;
  const bool from = std::isfinite(d.lower), to = std::isfinite(d.upper);
  if (from && to) return d.lower + (d.upper - d.lower) * x;
  if (from) return d.lower + x * (1.0 + std::abs(d.lower));
  return to ? d.upper - x * (1.0 + std::abs(d.upper)) : x;
}

double random_integer(const cardan_param_desc& d, std::mt19937_64& rng) {
  const bool free = d.lower == 0.0 && d.upper == 0.0;
  const double least = free                     ? 1.0
                       : std::isfinite(d.lower) ? std::ceil(d.lower + (d.flags & CARDAN_ABOVE ? 1e-9 : 0.0))
                       : std::isfinite(d.upper) ? std::floor(d.upper) - 8.0
                                                : 1.0;
  const double most = !free && std::isfinite(d.upper) ? std::floor(d.upper - (d.flags & CARDAN_BELOW ? 1e-9 : 0.0)) : least + 8.0;
  return std::min(most, least + std::floor(uniform(rng) * (std::min(most, least + 8.0) - least + 1.0)));
}

}  // namespace

TriedLaw& Violations::tried(std::string_view name) {
  const auto known = index_.find(name);
  if (known != index_.end()) return record_[known->second];
  index_.emplace(name, record_.size());
  record_.emplace_back().law = name;
  return record_.back();
}

void Violations::list(std::string_view law, std::string_view untried) { tried(law).untried = untried; }

void Violations::law(std::string_view name, double error, double limit, double scale, std::string_view where) {
  error /= 1.0 + scale;
  const bool holds = error <= limit;
  static constexpr double kMost = std::numeric_limits<double>::infinity();
  const auto part = [](double e, double of) { return std::isnan(e) ? std::pair(kMost, kMost) : std::pair(e <= 0.0 ? 0.0 : e / of, e); };
  TriedLaw& t = tried(name);
  if (t.trials == 0 || part(error, limit) > part(t.error, t.limit))
    t.measured = true, t.error = error < 0.0 ? 0.0 : error, t.limit = limit, t.sample = sample, t.where = where;
  ++t.trials, t.broken += !holds;
  if (holds) return;
  const std::string number = where.empty() ? "" : fmt::format(" ({})", where);
  found_.push_back(fmt::format("{}{}: error {:.2g} (limit {:.0e}, sample {}{})", name, number, error, limit, sample, at));
}

void Violations::law(std::string_view name, bool holds, std::string_view told) {
  TriedLaw& t = tried(name);
  ++t.trials;
  if (holds) return;
  if (t.broken++ == 0) t.sample = sample, t.where = told;
  found_.push_back(fmt::format("{} (sample {}{})", told.empty() ? name : told, sample, at));
}

std::vector<std::string> Violations::take(LawRecord* record) {
  for (TriedLaw& t : record_)
    if (t.trials > 0) t.untried.clear();
  if (record) *record = std::move(record_);
  return std::move(found_);
}

Eigen::VectorXd random_vector(std::mt19937_64& rng, Eigen::Index n) {
  Eigen::VectorXd v(n);
  for (Eigen::Index i = 0; i < n; ++i) v[i] = -1.0 + 2.0 * uniform(rng);
  return v;
}

ParamTable random_parameters(std::span<const cardan_param_desc> schema, std::mt19937_64& rng, bool orthonormal, bool sparse, bool whole) {
  ParamTable table;
  // What is not the default may ask for others that fit it.
  const auto stays = [&] { return sparse || uniform(rng) < 0.4; };
  for (const cardan_param_desc& d : schema) {
    const bool required = d.flags & CARDAN_REQUIRED;
    std::vector<double>& numbers = table.numbers[d.name];
    switch (d.kind) {
      case CARDAN_TEXT:
      case CARDAN_FILE:  // optional ones stay absent
        table.numbers.erase(d.name);
        if (required) table.texts[d.name] = whole ? "2000-01-01T12:00:00" : "";  // in case it is a date
        if (required && d.kind == CARDAN_FILE) table.bytes[d.name] = "";
        continue;
      case CARDAN_NUMBER:
        numbers = {stays() && !required ? d.fallback[0] : random_number(d, rng)};
        continue;
      case CARDAN_INTEGER:
        numbers = {sparse && !required ? d.fallback[0] : random_integer(d, rng)};
        continue;
      case CARDAN_TRUTH:
        numbers = {sparse && !required ? d.fallback[0] : std::floor(2.0 * uniform(rng))};
        continue;
      case CARDAN_CHOICE: {
        const double any = std::min(std::floor(uniform(rng) * d.count), d.count - 1.0);
        numbers = {stays() && !required ? std::clamp(d.fallback[0], 0.0, d.count - 1.0) : any};
        table.texts[d.name] = d.names[static_cast<std::size_t>(numbers[0])];
        continue;
      }
      case CARDAN_TABLE: {  // the first column increases, as a time, an angle or a degree does
        constexpr int kRows = 5;
        const double first = whole ? std::floor(2.0 * uniform(rng)) : 0.0;
        for (int row = 0; row < kRows; ++row)
          for (std::uint32_t c = 0; c < d.count; ++c) {
            const double any = c == 0 ? first + row + 0.5 * uniform(rng) : 0.3 + 0.7 * uniform(rng);
            numbers.push_back(whole ? std::floor(c == 0 ? any : 1.4 * any) : any);
          }
        if (!required && stays()) table.numbers.erase(d.name);
        continue;
      }
      default:
        break;
    }
    const bool one = d.kind == CARDAN_VECTOR || d.kind == CARDAN_UNIT_VECTOR;
    const auto n = static_cast<Eigen::Index>(one ? 1u : d.count ? d.count : 1u);
    const bool ranged = d.lower != 0.0 || d.upper != 0.0;
    MatrixXd m(3, n);
    for (Eigen::Index k = 0; k < n; ++k) m.col(k) = random_vector(rng, 3);
    if (ranged)
      m = MatrixXd::NullaryExpr(3, n, [&] { return random_number(d, rng); });
    else if (orthonormal && n <= 3)
      m = thin_qr(m).Q;
    if (d.kind == CARDAN_UNIT_VECTOR || d.kind == CARDAN_UNIT_VECTORS) m.colwise().normalize();
    numbers.assign(m.data(), m.data() + m.size());
    if (sparse && !required && one) numbers.assign(d.fallback, d.fallback + 3);
    if (sparse && !required && !one) table.numbers.erase(d.name);
  }
  return table;
}

PackedSample packed_at_random(std::span<const cardan_param_desc> schema, std::uint64_t seed,
                              const std::function<std::uint64_t(const cardan_param_values*)>& size,
                              const std::function<int(const cardan_param_values*, void*)>& pack) {
  constexpr std::size_t kMargin = 4096;
  constexpr unsigned char kMark = 0xA5;
  std::mt19937_64 rng(seed);
  struct Way {
    bool orthonormal, sparse;
  };
  constexpr Way kWays[] = {{false, false}, {true, false}, {false, true}, {true, true}};
  for (int attempt = 0; attempt < 256; ++attempt) {  // parameters may have to fit together: where one of 10 does, these are as good as sure
    const Way way = kWays[attempt % 4];
    ParamTable table = random_parameters(schema, rng, way.orthonormal, way.sparse, attempt / 32 % 2 == 1);
    const cardan_param_values values = table.view();
    const std::uint64_t wanted = size(&values);
    if (wanted > kMostInstanceBytes)
      return {{}, 0, fmt::format("packed_size is {} bytes, expected at most {}", wanted, kMostInstanceBytes)};
    PackedSample out{std::vector<double>((wanted + kMargin) / sizeof(double) + 1), wanted, {}};
    auto* bytes = reinterpret_cast<unsigned char*>(out.block.data());
    std::memset(bytes + wanted, kMark, out.block.size() * sizeof(double) - wanted);
    if (pack(&values, bytes) != 0) continue;
    std::size_t end = out.block.size() * sizeof(double);
    while (end > wanted && bytes[end - 1] == kMark) --end;
    if (end > wanted) out.fault = fmt::format("pack writes {} bytes, {} are its own", end, wanted);
    out.block.resize((wanted + sizeof(double) - 1) / sizeof(double) + 1);
    return out;
  }
  return {};
}

void in_another_thread(const std::function<void()>& call) {
  std::exception_ptr thrown;
  std::thread([&] {
    try {
      call();
    } catch (...) {
      thrown = std::current_exception();
    }
  }).join();
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace cardan
