#pragma once
// Sums and products of whole matrices, each evaluated where it stands. The twin is compiled for two scalars, and Eigen has a type of
// expression for each pair of operands in each: two fifths of the time to compile it, for which nothing is faster that is timed.
#include <Eigen/Core>
#include <concepts>

namespace cardan::reference {

template <class T, int R, int K, int C>
Eigen::Matrix<T, R, C> operator*(const Eigen::Matrix<T, R, K>& A, const Eigen::Matrix<T, K, C>& B) {
  eigen_assert(A.cols() == B.rows());
  Eigen::Matrix<T, R, C> out(A.rows(), B.cols());
  const Eigen::Index rows = A.rows(), inner = A.cols(), cols = B.cols();
  const T *a = A.data(), *b = B.data();
  for (Eigen::Index j = 0; j < cols; ++j)
    for (Eigen::Index i = 0; i < rows; ++i) {
      T sum(0);
      for (Eigen::Index k = 0; k < inner; ++k) sum += a[i + rows * k] * b[k + inner * j];
      out(i, j) = sum;
    }
  return out;
}

template <class T, int R, int C, class F>
Eigen::Matrix<T, R, C> each_of(const Eigen::Matrix<T, R, C>& A, const F& f) {
  Eigen::Matrix<T, R, C> out(A.rows(), A.cols());
  for (Eigen::Index i = 0; i < A.size(); ++i) out.data()[i] = f(i);
  return out;
}
template <class T, int R, int C>
Eigen::Matrix<T, R, C> operator+(const Eigen::Matrix<T, R, C>& A, const Eigen::Matrix<T, R, C>& B) {
  eigen_assert(A.rows() == B.rows() && A.cols() == B.cols());
  return each_of(A, [&](Eigen::Index i) { return A.data()[i] + B.data()[i]; });
}
template <class T, int R, int C>
Eigen::Matrix<T, R, C> operator-(const Eigen::Matrix<T, R, C>& A, const Eigen::Matrix<T, R, C>& B) {
  eigen_assert(A.rows() == B.rows() && A.cols() == B.cols());
  return each_of(A, [&](Eigen::Index i) { return A.data()[i] - B.data()[i]; });
}
template <class T, int R, int C>
Eigen::Matrix<T, R, C> operator-(const Eigen::Matrix<T, R, C>& A) {
  return each_of(A, [&](Eigen::Index i) { return -A.data()[i]; });
}
template <class S, class T, int R, int C>
requires std::convertible_to<S, T> Eigen::Matrix<T, R, C>
operator*(const S& s, const Eigen::Matrix<T, R, C>& A) {
  return each_of(A, [&, factor = T(s)](Eigen::Index i) { return factor * A.data()[i]; });
}
template <class S, class T, int R, int C>
requires std::convertible_to<S, T> Eigen::Matrix<T, R, C>
operator*(const Eigen::Matrix<T, R, C>& A, const S& s) { return s * A; }

}  // namespace cardan::reference
