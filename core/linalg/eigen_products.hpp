#pragma once
// What eigen_kernels.hpp declares, for the files that compile it. Eigen's own products are those of types that no other file has.
#include <type_traits>

#include "core/linalg/eigen_kernels.hpp"

namespace cardan::linalg {
namespace {

struct Pitch : Eigen::OuterStride<> {
  using Eigen::OuterStride<>::OuterStride;
};
template <class T, int ORDER>
using Stored = Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, ORDER>, 0, Pitch>;

template <class T, class F>
void with_order(const MatrixView<const T>& a, const F& f) {
  if (a.row_major)
    f(Stored<T, Eigen::RowMajor>(a.data, a.rows, a.cols, Pitch(a.stride)));
  else
    f(Stored<T, Eigen::ColMajor>(a.data, a.rows, a.cols, Pitch(a.stride)));
}

/// Numbers side by side are read and written where they stand.
template <class T, class F>
void with_step(const VectorView<T>& x, const F& f) {
  using Plain = Eigen::Matrix<std::remove_const_t<T>, Eigen::Dynamic, 1>;
  using Vector = std::conditional_t<std::is_const_v<T>, const Plain, Plain>;
  using Step = Eigen::InnerStride<>;
  if (x.stride == 1)
    f(Eigen::Map<Vector>(x.data, x.size));
  else
    f(Eigen::Map<Vector, 0, Step>(x.data, x.size, Step(x.stride)));
}

/// f(Y, A, B), or their transposes in turn: Y is column-major.
template <class T, class F>
void with_product(const MatrixView<T>& Y, const MatrixView<const T>& A, const MatrixView<const T>& B, const F& f) {
  if (Y.row_major) return with_product(Y.transposed(), B.transposed(), A.transposed(), f);
  Eigen::Map<Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>, 0, Pitch> to(Y.data, Y.rows, Y.cols, Pitch(Y.stride));
  with_order(A, [&](const auto& a) { with_order(B, [&](const auto& b) { f(to, a, b); }); });
}

}  // namespace

template <class T>
void Products<T>::set(const MatrixView<T>& Y, const MatrixView<const T>& A, const MatrixView<const T>& B, const T& alpha) {
  with_product(Y, A, B, [&](auto& to, const auto& a, const auto& b) { to.noalias() = alpha * a * b; });
}
template <class T>
void Products<T>::add(const MatrixView<T>& Y, const MatrixView<const T>& A, const MatrixView<const T>& B, const T& alpha) {
  with_product(Y, A, B, [&](auto& to, const auto& a, const auto& b) { to.noalias() += alpha * a * b; });
}
template <class T>
void Products<T>::add(const VectorView<T>& y, const MatrixView<const T>& A, const VectorView<const T>& x, const T& alpha) {
  with_step(y, [&](auto to) {
    with_step(x, [&](const auto& from) { with_order(A, [&](const auto& a) { to.noalias() += alpha * a * from; }); });
  });
}

}  // namespace cardan::linalg
