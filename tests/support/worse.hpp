#pragma once
// Sizes and errors in which NaN counts: std::max drops a NaN that comes second, Eigen's maxCoeff one that comes anywhere.
#include <Eigen/Core>
#include <cmath>
#include <initializer_list>
#include <limits>

namespace cardan::test {

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

/// The largest of these, NaN if any of them is; what limits an error must be written so that NaN stays outside of it
/// (EXPECT_LE, not EXPECT_FALSE(error > limit)).
inline double worse(std::initializer_list<double> all) {
  double out = -std::numeric_limits<double>::infinity();
  for (const double x : all)
    if (!(x <= out) && !std::isnan(out)) out = x;
  return out;
}
inline double worse(double a, double b) { return worse({a, b}); }

/// Largest entry in absolute value, NaN if any entry is; 0 without entries.
template <class Derived>
double largest(const Eigen::DenseBase<Derived>& a) {
  return a.size() == 0 ? 0.0 : a.derived().array().abs().template maxCoeff<Eigen::PropagateNaN>();
}

/// Largest entry of |a - b|; infinite where their sizes differ.
template <class A, class B>
double distance(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() ? largest(a - b) : HUGE_VAL;
}

/// |error| / size, 0 where there is no error; NaN where size is not finite, beside which nothing would be large.
inline double relative(double error, double size) {
  if (!std::isfinite(size)) return std::numeric_limits<double>::quiet_NaN();
  return error == 0.0 ? 0.0 : std::abs(error) / size;
}

}  // namespace cardan::test
