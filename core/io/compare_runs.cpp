#include "core/io/compare_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <map>
#include <numbers>

namespace cardan {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Worse than what was worst so far: a NaN is the worst of all.
bool is_worse(double a, double b) { return !std::isnan(b) && !(a <= b); }

/// The x beyond which, to both sides, a normal variable lies with probability p.
double two_sided_quantile(double p) {
  double low = 0.0, high = 40.0;  // erfc(40 / sqrt 2) is 0 in double
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(middle / std::numbers::sqrt2) > p ? low : high) = middle;
  }
  return high;
}

/// The same bits, all NaN alike: as in the hashes of summary.json.
bool same_number(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b) || (std::isnan(a) && std::isnan(b));
}

/// Residuals are errors over the size of what is in balance, which is 1 by that.
bool is_residual(const Column& c) { return c.path.starts_with("ledger/") || c.path == "loops/residual"; }

double scale_of(const Column& c, std::size_t component) {
  const std::size_t width = c.components.size();
  double scale = is_residual(c) && c.units[component] == "1" ? 1.0 : 0.0;
  for (std::size_t i = 0; i < c.values.size(); ++i)
    if (c.units[i % width] == c.units[component] && std::isfinite(c.values[i])) scale = std::max(scale, std::abs(c.values[i]));
  return scale;
}

std::vector<double> component_at(const Column& c, std::size_t component, const std::vector<std::size_t>& rows) {
  std::vector<double> out;
  out.reserve(rows.size());
  for (const std::size_t row : rows) out.push_back(c.values[row * c.components.size() + component]);
  return out;
}

/// Those of `rows` whose times are the same to the bit.
CommonRows same_instants(const CommonRows& rows, std::span<const double> first, std::span<const double> second) {
  CommonRows out;
  for (std::size_t i = 0; i < rows.first.size(); ++i) {
    if (first[rows.first[i]] != second[rows.second[i]]) continue;
    out.first.push_back(rows.first[i]);
    out.second.push_back(rows.second[i]);
  }
  return out;
}

}  // namespace

std::string_view name_of(Agreement a) {
  constexpr std::string_view kNames[] = {"same bits", "round-off", "integration", "truth", "statistical"};
  return kNames[static_cast<std::size_t>(a)];
}

Difference worst_difference(std::span<const double> times, std::span<const double> is, std::span<const double> reference, double scale,
                            const Tolerance& tolerance, Agreement agreement) {
  const double limit = agreement == Agreement::same_bits ? 0.0 : tolerance.absolute + tolerance.relative * scale;
  if (is.empty()) return {kNaN, limit, kNaN, kNaN, kNaN, false};
  Difference worst{0.0, limit, times[0], is[0], reference[0]};
  for (std::size_t i = 0; i < is.size(); ++i) {
    const bool same = same_number(is[i], reference[i]);
    const double difference = same ? 0.0 : std::isfinite(is[i]) && std::isfinite(reference[i]) ? std::abs(is[i] - reference[i]) : kNaN;
    const bool ok = agreement == Agreement::same_bits ? same : difference <= limit;
    // Of bits that differ, 0 against -0 has no difference but counts.
    if (i == 0 || is_worse(difference, worst.difference) || (worst.pass && !ok))
      worst = {difference, limit, times[i], is[i], reference[i], worst.pass};
    worst.pass = worst.pass && ok;
  }
  for (double* x : {&worst.is, &worst.reference})
    if (std::isnan(*x)) *x = kNaN;  // its sign differs between processors
  return worst;
}

CommonRows common_rows(std::span<const double> first, std::span<const double> second) {
  CommonRows out;
  for (std::size_t i = 0, j = 0; i < first.size() && j < second.size();) {
    const double apart = first[i] - second[j];
    if (std::abs(apart) <= 1e-9 + 1e-12 * std::abs(first[i])) {
      out.first.push_back(i++);
      out.second.push_back(j++);
    } else if (apart < 0.0) {
      ++i;
    } else {
      ++j;
    }
  }
  return out;
}

Statistics compare_statistics(std::span<const double> values, double mean, std::optional<double> deviation, double independent,
                              double confidence) {
  double sum = 0.0, squares = 0.0;
  const auto n = static_cast<double>(values.size());
  for (const double x : values) sum += x;
  const double found = sum / n;
  for (const double x : values) squares += (x - found) * (x - found);
  const double spread = std::sqrt(squares / (n - 1.0));
  const double quantile = two_sided_quantile((1.0 - confidence) / (deviation ? 2.0 : 1.0));
  const auto compared = [](double is, double reference, double limit) {
    Difference d{std::abs(is - reference), limit, kNaN, is, reference};
    d.pass = d.difference <= limit;
    return d;
  };
  Statistics out;
  out.mean = compared(found, mean, quantile * deviation.value_or(spread) / std::sqrt(independent));
  if (!deviation) return out;
  const double freedom = independent - 1.0, part = 2.0 / (9.0 * freedom);
  // chi^2 / freedom lies below (1 - part + z sqrt(part))^3 and above the same with -z.
  const auto bound = [&](double z) { return *deviation * std::sqrt(std::pow(std::max(0.0, 1.0 - part + z * std::sqrt(part)), 3)); };
  out.deviation = compared(spread, *deviation, spread > *deviation ? bound(quantile) - *deviation : *deviation - bound(-quantile));
  return out;
}

bool RunDifference::pass(bool at_common_times) const {
  return rows > 0 && !components.empty() && only_in_first.empty() && only_in_second.empty() && misfits.empty() &&
         (at_common_times || same_times()) && std::ranges::all_of(components, [](const ComponentDifference& c) { return c.worst.pass; });
}

RunDifference compare_runs(const RunColumns& first, const RunColumns& second, const Tolerance& tolerance, Agreement agreement) {
  RunDifference out;
  CommonRows common = common_rows(first.times, second.times);
  if (agreement == Agreement::same_bits) common = same_instants(common, first.times, second.times);
  out.rows = common.first.size();
  out.rows_of_first = first.times.size();
  out.rows_of_second = second.times.size();
  std::vector<double> times;
  for (const std::size_t row : common.first) times.push_back(first.times[row]);
  std::map<std::string_view, const Column*> others;
  for (const Column& c : second.columns) others[c.path] = &c;
  for (const Column& c : first.columns) {
    const auto found = others.find(c.path);
    if (found == others.end()) {
      out.only_in_first.push_back(c.path);
      continue;
    }
    const Column& other = *found->second;
    others.erase(found);
    if (c.components.empty()) out.misfits.push_back(c.path + ": no components");
    if (c.components != other.components) {
      out.misfits.push_back(
          fmt::format("{}: components {} against {}", c.path, fmt::join(c.components, ", "), fmt::join(other.components, ", ")));
      continue;
    }
    if (c.units != other.units) {
      out.misfits.push_back(fmt::format("{}: unit {} against {}", c.path, fmt::join(c.units, ", "), fmt::join(other.units, ", ")));
      continue;
    }
    for (std::size_t k = 0; k < c.components.size(); ++k) {
      const std::vector<double> is = component_at(c, k, common.first), reference = component_at(other, k, common.second);
      out.components.push_back(
          {c.path, c.components[k], c.units[k], worst_difference(times, is, reference, scale_of(other, k), tolerance, agreement), {}});
      for (std::size_t i = 0; i < is.size(); ++i)
        if (!std::isfinite(is[i]) && same_number(is[i], reference[i])) out.components.back().not_finite.push_back(times[i]);
    }
  }
  for (const Column& c : second.columns)
    if (others.contains(c.path)) out.only_in_second.push_back(c.path);
  return out;
}

}  // namespace cardan
