#pragma once
// The loops of Eigen's dense products and triangular solutions, compiled once for doubles (eigen_kernels.cpp): else each file with a
// product compiles its own, which takes a third of a second. Among the headers that are parsed once (cmake/precompiled.cmake).
#include <Eigen/Core>

/// Of another scalar likewise: with `extern template struct` where it is declared, with `template struct` in one file.
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
  }

#ifndef CARDAN_EIGEN_KERNELS_HERE
CARDAN_EIGEN_KERNELS(extern template struct, double)
#endif
