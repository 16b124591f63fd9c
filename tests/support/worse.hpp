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

/// Numbers where they stand, of a matrix of any kind: with loops over these a kind more costs no expressions of its own to compile.
template <class T>
struct Entries {
  const T* data;
  Eigen::Index rows, cols, down, across;
  const T& operator()(Eigen::Index i, Eigen::Index j) const { return data[i * down + j * across]; }
};
/// f(entries of a), which is evaluated if it does not stand in memory.
template <class Derived, class F>
double with_entries(const Eigen::DenseBase<Derived>& a, const F& f) {
  if constexpr ((Eigen::internal::traits<Derived>::Flags & Eigen::DirectAccessBit) != 0) {
    const Derived& x = a.derived();
    return f(Entries<typename Derived::Scalar>{x.data(), x.rows(), x.cols(), x.rowStride(), x.colStride()});
  } else {
    return with_entries(typename Derived::PlainObject(a.derived()), f);
  }
}

template <class T>
double largest(const Entries<T>& a) {
  double out = 0.0;
  for (Eigen::Index j = 0; j < a.cols; ++j)
    for (Eigen::Index i = 0; i < a.rows; ++i) out = worse(out, static_cast<double>(Eigen::numext::abs(a(i, j))));
  return out;
}
/// Largest entry in absolute value, NaN if any entry is; 0 without entries.
template <class Derived>
double largest(const Eigen::DenseBase<Derived>& a) {
  return with_entries(a, [](const auto& x) { return largest(x); });
}

template <class T>
double distance(const Entries<T>& a, const Entries<T>& b) {
  if (a.rows != b.rows || a.cols != b.cols) return HUGE_VAL;
  double out = 0.0;
  for (Eigen::Index j = 0; j < a.cols; ++j)
    for (Eigen::Index i = 0; i < a.rows; ++i) out = worse(out, static_cast<double>(Eigen::numext::abs(T(a(i, j) - b(i, j)))));
  return out;
}
/// Largest entry of |a - b|; infinite where their sizes differ.
template <class A, class B>
double distance(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
  return with_entries(a, [&](const auto& x) { return with_entries(b, [&](const auto& y) { return distance(x, y); }); });
}

/// |error| / size, 0 where there is no error; NaN where size is not finite, beside which nothing would be large.
inline double relative(double error, double size) {
  if (!std::isfinite(size)) return std::numeric_limits<double>::quiet_NaN();
  return error == 0.0 ? 0.0 : std::abs(error) / size;
}

}  // namespace cardan::test
