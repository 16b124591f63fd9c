#pragma once
// Eigen's dense products and triangular solutions, compiled once for doubles (eigen_products.cpp) and whoever else asks for it: else each
// file compiles its own loops, a third of a second, and each kind of operand brings a second product for small ones, two with vectors and
// the scalar product, some fifteen types of expressions and half a second. Among the headers that are parsed once
// (cmake/precompiled.cmake). What files without it compile is the same by the same loops.
#include <Eigen/Core>

namespace cardan::linalg {

/// Where a dense matrix stands: entry (i, j) at data[i + stride j], of a row-major one at data[stride i + j].
template <class T>
struct MatrixView {
  T* data;
  Eigen::Index rows, cols, stride;
  bool row_major;
  MatrixView transposed() const { return {data, cols, rows, stride, !row_major}; }
};
template <class T>
struct VectorView {
  T* data;
  Eigen::Index size, stride;
};

/// Y = alpha A B, Y += alpha A B, y += alpha A x by Eigen; what is written is apart from what is read (eigen_products.hpp).
template <class T>
struct Products {
  static void set(const MatrixView<T>& Y, const MatrixView<const T>& A, const MatrixView<const T>& B, const T& alpha);
  static void add(const MatrixView<T>& Y, const MatrixView<const T>& A, const MatrixView<const T>& B, const T& alpha);
  static void add(const VectorView<T>& y, const MatrixView<const T>& A, const VectorView<const T>& x, const T& alpha);
};

template <class T>
inline constexpr bool kCompiledOnce = false;
template <class X>
concept CompiledOnce = kCompiledOnce<typename X::Scalar>;

/// An operand as it stands in memory, evaluated if it does not; a factor in front of it is left to who asks.
template <class X>
using InMemory = typename Eigen::internal::add_const_on_value_type<typename Eigen::internal::blas_traits<X>::DirectLinearAccessType>::type;
template <class X, class T = typename X::Scalar>
MatrixView<const T> matrix_view(const X& x) {
  return {x.data(), x.rows(), x.cols(), x.outerStride(), static_cast<bool>(X::IsRowMajor)};
}
template <class X, class T = typename X::Scalar>
VectorView<const T> vector_view(const X& x) {
  return {x.data(), x.size(), x.innerStride()};
}

/// f(where y stands), or where a copy of y stands that is taken back: of expressions that do not stand in memory number beside number.
template <class Y, class F>
void with_matrix_view(Y& y, const F& f) {
  using View = MatrixView<typename Y::Scalar>;
  using namespace Eigen::internal;
  if constexpr ((traits<Y>::Flags & Eigen::DirectAccessBit) != 0 && inner_stride_at_compile_time<Y>::ret == 1) {
    f(View{y.data(), y.rows(), y.cols(), y.outerStride(), static_cast<bool>(Y::IsRowMajor)});
  } else {
    Eigen::Matrix<typename Y::Scalar, Eigen::Dynamic, Eigen::Dynamic> copy = y;
    f(View{copy.data(), copy.rows(), copy.cols(), copy.rows(), false});
    y = copy;
  }
}
template <class Y, class F>
void with_vector_view(Y& y, const F& f) {
  using View = VectorView<typename Y::Scalar>;
  if constexpr ((Eigen::internal::traits<Y>::Flags & Eigen::DirectAccessBit) != 0) {
    f(View{y.data(), y.size(), y.innerStride()});
  } else {
    typename Y::PlainObject copy = y;
    f(View{copy.data(), copy.size(), 1});
    y = copy;
  }
}

}  // namespace cardan::linalg

namespace Eigen::internal {

/// Of matrices of any size.
template <cardan::linalg::CompiledOnce A, cardan::linalg::CompiledOnce B>
struct generic_product_impl<A, B, DenseShape, DenseShape, GemmProduct> {
  using Scalar = typename Product<A, B>::Scalar;
  template <class Y>
  static void evalTo(Y& y, const A& a, const B& b) {
    run<true>(y, a, b, Scalar(1));
  }
  template <class Y>
  static void addTo(Y& y, const A& a, const B& b) {
    run<false>(y, a, b, Scalar(1));
  }
  template <class Y>
  static void subTo(Y& y, const A& a, const B& b) {
    run<false>(y, a, b, Scalar(-1));
  }
  template <class Y>
  static void scaleAndAddTo(Y& y, const A& a, const B& b, const Scalar& alpha) {
    run<false>(y, a, b, alpha);
  }

 private:
  template <bool SET, class Y>
  static void run(Y& y, const A& a, const B& b, const Scalar& alpha) {
    using namespace cardan::linalg;
    const InMemory<A> left = blas_traits<A>::extract(a);
    const InMemory<B> right = blas_traits<B>::extract(b);
    const Scalar factor = combine_scalar_factors(alpha, a, b);
    with_matrix_view(y, [&](const MatrixView<Scalar>& to) {
      if constexpr (SET)
        Products<Scalar>::set(to, matrix_view(left), matrix_view(right), factor);
      else
        Products<Scalar>::add(to, matrix_view(left), matrix_view(right), factor);
    });
  }
};

/// Of matrices and vectors of any size.
template <cardan::linalg::CompiledOnce A, cardan::linalg::CompiledOnce B>
struct generic_product_impl<A, B, DenseShape, DenseShape, GemvProduct>
    : generic_product_impl_base<A, B, generic_product_impl<A, B, DenseShape, DenseShape, GemvProduct>> {
  using Scalar = typename Product<A, B>::Scalar;
  template <class Y>
  static void scaleAndAddTo(Y& y, const A& a, const B& b, const Scalar& alpha) {
    using namespace cardan::linalg;
    const InMemory<A> left = blas_traits<A>::extract(a);
    const InMemory<B> right = blas_traits<B>::extract(b);
    const Scalar factor = combine_scalar_factors(alpha, a, b);
    with_vector_view(y, [&](const VectorView<Scalar>& to) {
      if constexpr (A::IsVectorAtCompileTime)  // a row: y* = B* a*
        Products<Scalar>::add(to, matrix_view(right).transposed(), vector_view(left), factor);
      else
        Products<Scalar>::add(to, matrix_view(left), vector_view(right), factor);
    });
  }
};

}  // namespace Eigen::internal

/// Of another scalar likewise: CARDAN_EIGEN_KERNELS_ELSEWHERE where it is declared, and in one file, which includes eigen_products.hpp,
/// with `template struct`.
#define CARDAN_EIGEN_KERNELS(INSTANTIATE, Scalar)                                                                                       \
  namespace Eigen::internal {                                                                                                           \
  INSTANTIATE gebp_kernel<Scalar, Scalar, Index, blas_data_mapper<Scalar, Index, ColMajor, 0, 1>, gebp_traits<Scalar, Scalar>::mr,      \
                          gebp_traits<Scalar, Scalar>::nr, false, false>;                                                               \
  INSTANTIATE gemm_pack_lhs<Scalar, Index, const_blas_data_mapper<Scalar, Index, ColMajor>, gebp_traits<Scalar, Scalar>::mr,            \
                            gebp_traits<Scalar, Scalar>::LhsProgress, gebp_traits<Scalar, Scalar>::LhsPacket4Packing, ColMajor>;        \
  INSTANTIATE gemm_pack_lhs<Scalar, Index, const_blas_data_mapper<Scalar, Index, RowMajor>, gebp_traits<Scalar, Scalar>::mr,            \
                            gebp_traits<Scalar, Scalar>::LhsProgress, gebp_traits<Scalar, Scalar>::LhsPacket4Packing, RowMajor>;        \
  INSTANTIATE gemm_pack_rhs<Scalar, Index, const_blas_data_mapper<Scalar, Index, ColMajor>, gebp_traits<Scalar, Scalar>::nr, ColMajor>; \
  INSTANTIATE gemm_pack_rhs<Scalar, Index, const_blas_data_mapper<Scalar, Index, RowMajor>, gebp_traits<Scalar, Scalar>::nr, RowMajor>; \
  INSTANTIATE general_matrix_vector_product<Index, Scalar, const_blas_data_mapper<Scalar, Index, ColMajor>, ColMajor, false, Scalar,    \
                                            const_blas_data_mapper<Scalar, Index, ColMajor>, false>;                                    \
  INSTANTIATE general_matrix_vector_product<Index, Scalar, const_blas_data_mapper<Scalar, Index, ColMajor>, ColMajor, false, Scalar,    \
                                            const_blas_data_mapper<Scalar, Index, RowMajor>, false>;                                    \
  INSTANTIATE general_matrix_vector_product<Index, Scalar, const_blas_data_mapper<Scalar, Index, RowMajor>, RowMajor, false, Scalar,    \
                                            const_blas_data_mapper<Scalar, Index, ColMajor>, false>;                                    \
  INSTANTIATE triangular_solve_matrix<Scalar, Index, OnTheLeft, Lower, false, ColMajor, ColMajor, 1>;                                   \
  INSTANTIATE triangular_solve_matrix<Scalar, Index, OnTheLeft, Upper, false, RowMajor, ColMajor, 1>;                                   \
  }                                                                                                                                     \
  namespace cardan::linalg {                                                                                                            \
  INSTANTIATE Products<Scalar>;                                                                                                         \
  }

#define CARDAN_EIGEN_KERNELS_ELSEWHERE(Scalar)         \
  CARDAN_EIGEN_KERNELS(extern template struct, Scalar) \
  namespace cardan::linalg {                           \
  template <>                                          \
  inline constexpr bool kCompiledOnce<Scalar> = true;  \
  }

#ifndef CARDAN_EIGEN_KERNELS_HERE
CARDAN_EIGEN_KERNELS_ELSEWHERE(double)
#endif
