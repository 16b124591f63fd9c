#include "scripts/campaign/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace cardan {
namespace {

/// In order, `p` of them below.
double quantile(const std::vector<double>& sorted, double p) {
  const double at = p * static_cast<double>(sorted.size() - 1), below = std::floor(at);
  const auto i = static_cast<std::size_t>(below);
  const double next = sorted[std::min(i + 1, sorted.size() - 1)];
  return sorted[i] == next ? next : sorted[i] + (at - below) * (next - sorted[i]);
}

/// Probability that k or more of n pass, each with probability p: by the terms of the shorter side.
double at_least(std::size_t k, std::size_t n, double p) {
  const auto count = static_cast<double>(n);
  const bool above = n - k < k;
  double sum = 0.0;
  for (std::size_t i = above ? k : 0; i < (above ? n + 1 : k); ++i) {
    const auto x = static_cast<double>(i), rest = count - x;
    const double ways = std::lgamma(count + 1.0) - std::lgamma(x + 1.0) - std::lgamma(rest + 1.0);
    sum += std::exp(ways + x * std::log(p) + rest * std::log1p(-p));
  }
  return above ? sum : 1.0 - sum;
}

std::vector<double> ranks(const std::vector<double>& x) {
  std::vector<std::size_t> order(x.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return x[i]; });
  std::vector<double> out(x.size());
  for (std::size_t i = 0, end = 0; i < order.size(); i = end) {
    for (end = i; end < order.size() && x[order[end]] == x[order[i]];) ++end;
    for (std::size_t k = i; k < end; ++k) out[order[k]] = 0.5 * static_cast<double>(i + end - 1);
  }
  return out;
}

}  // namespace

Distribution distribution_of(const std::vector<double>& x) {
  Distribution out;
  out.n = x.size();
  const auto n = static_cast<double>(x.size());
  out.mean = x[0] + std::accumulate(x.begin(), x.end(), 0.0, [&](double sum, double v) { return sum + (v - x[0]); }) / n;
  const double squares =
      std::accumulate(x.begin(), x.end(), 0.0, [&](double sum, double v) { return sum + (v - out.mean) * (v - out.mean); });
  out.deviation = x.size() > 1 ? std::sqrt(squares / (n - 1.0)) : 0.0;
  out.at_least = static_cast<std::size_t>(std::ranges::min_element(x) - x.begin());
  out.at_most = static_cast<std::size_t>(std::ranges::max_element(x) - x.begin());
  std::vector<double> sorted = x;
  std::ranges::sort(sorted);
  out.least = sorted.front(), out.most = sorted.back();
  out.p05 = quantile(sorted, 0.05), out.median = quantile(sorted, 0.5), out.p95 = quantile(sorted, 0.95);
  return out;
}

double share_at_least(std::size_t k, std::size_t n, double confidence) {
  if (k == 0) return 0.0;
  if (k == n) return std::pow(1.0 - confidence, 1.0 / static_cast<double>(n));
  double low = 0.0, high = 1.0;  // at_least rises with p, from 0 to 1
  for (int i = 0; i < 60; ++i) {
    const double p = 0.5 * (low + high);
    (at_least(k, n, p) < 1.0 - confidence ? low : high) = p;
  }
  return low;
}

double share_below_largest(std::size_t n, double confidence) {
  return n == 0 ? 0.0 : std::pow(1.0 - confidence, 1.0 / static_cast<double>(n));
}

double rank_correlation(const std::vector<double>& x, const std::vector<double>& y) {
  const std::vector<double> a = ranks(x), b = ranks(y);
  const double mean = 0.5 * static_cast<double>(x.size() - 1);
  double ab = 0.0, aa = 0.0, bb = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    ab += (a[i] - mean) * (b[i] - mean), aa += (a[i] - mean) * (a[i] - mean), bb += (b[i] - mean) * (b[i] - mean);
  return ab / std::sqrt(aa * bb);
}

std::vector<std::size_t> histogram(const std::vector<double>& x, std::size_t bins) {
  std::vector<std::size_t> out(bins, 0);
  const auto [least, most] = std::ranges::minmax(x);
  for (const double v : x) {
    const double share = most > least ? (v - least) / (most - least) : 0.0;
    ++out[std::min(bins - 1, static_cast<std::size_t>(share * static_cast<double>(bins)))];
  }
  return out;
}

}  // namespace cardan
