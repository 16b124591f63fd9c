#pragma once
// Whether a program became slower, judged by pairs: each of its times over one of the program before it, measured in turn. What the
// machine does besides changes from minute to minute, within a pair much less.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace cardan::bench {

/// What is allowed beyond the spread of the pairs.
inline constexpr double kAllowed = 0.03;

struct Verdict {
  double ratio;   ///< after / before, median of the pairs
  double spread;  ///< half the distance between the quartiles of the pairs
  bool slower;    ///< by more than kAllowed beyond the spread; also where some time is not a positive number
};

/// Times [any unit] of pair i: before[i], after[i]. Throws std::invalid_argument where they are not as many, or none.
inline Verdict judge(const std::vector<double>& before, const std::vector<double>& after) {
  if (before.size() != after.size() || before.empty()) throw std::invalid_argument("pairs need as many times before as after");
  std::vector<double> ratios;
  for (std::size_t i = 0; i < before.size(); ++i) {
    ratios.push_back(after[i] / before[i]);
    const auto is_time = [](double x) { return x > 0.0 && std::isfinite(x); };
    if (!is_time(before[i]) || !is_time(after[i])) return {ratios.back(), 0.0, true};
  }
  std::sort(ratios.begin(), ratios.end());
  const auto quantile = [&](double part) {  // linear between neighbours
    const double at = part * static_cast<double>(ratios.size() - 1);
    const auto i = static_cast<std::size_t>(at);
    return i + 1 < ratios.size() ? ratios[i] + (at - static_cast<double>(i)) * (ratios[i + 1] - ratios[i]) : ratios[i];
  };
  const double ratio = quantile(0.5), spread = 0.5 * (quantile(0.75) - quantile(0.25));
  return {ratio, spread, ratio > 1.0 + kAllowed + spread};
}

}  // namespace cardan::bench
