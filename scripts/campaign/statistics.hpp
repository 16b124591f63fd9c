#pragma once
// What many runs tell: order statistics, shares with their bounds, what goes with what.
#include <cstdint>
#include <string>
#include <vector>

namespace cardan {

/// Of the numbers x_1 ... x_n, n >= 1. Quantiles lie between neighbours in order, (n - 1) p + 1 counted from the least [Hyndman & Fan 1996,
/// definition 7]; the deviation is that of a sample (n - 1), zero for one number.
struct Distribution {
  std::size_t n = 0;
  double mean = 0.0, deviation = 0.0, least = 0.0, p05 = 0.0, median = 0.0, p95 = 0.0, most = 0.0;
  std::size_t at_least = 0, at_most = 0;  // index of the run that has the least and the largest, the first of equals
};
Distribution distribution_of(const std::vector<double>& x);

/// Where k of n independent runs passed, the share of all runs that pass is above this with the given confidence [Clopper & Pearson 1934,
/// one side]: the p at which k or more of n have the probability 1 - confidence. 0 for k = 0.
double share_at_least(std::size_t k, std::size_t n, double confidence);

/// Of n independent runs the largest is beyond this share of all runs with the given confidence, whatever their distribution
/// [Wilks 1941]: share^n = 1 - confidence.
double share_below_largest(std::size_t n, double confidence);

/// Correlation of the ranks of x and y [Spearman 1904], of equals the mean rank: 1 where y always rises with x. NaN where one of them does
/// not vary.
double rank_correlation(const std::vector<double>& x, const std::vector<double>& y);

/// n bins of the same width from the least to the largest; numbers of runs in each.
std::vector<std::size_t> histogram(const std::vector<double>& x, std::size_t bins);

}  // namespace cardan
