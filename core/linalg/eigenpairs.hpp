#pragma once
// The lowest eigenpairs of K x = lambda M x by shift-invert Lanczos, reproducible bit for bit.
#include <Eigen/Core>

#include "core/linalg/linear_operator.hpp"
#include "core/linalg/sparse_factor.hpp"

namespace cardan {

struct Eigenpairs {
  Eigen::VectorXd values;   // k, ascending
  Eigen::MatrixXd vectors;  // n x k, X* M X = 1
};

/// The k eigenvalues above `sigma` nearest to it, for K = K* and M = M* >= 0; sigma must lie below the spectrum (0 for
/// K > 0, negative for a free body). Throws LinalgError when a pair does not converge, when its residual |K x - lambda
/// M x| / (|K| + |lambda| |M|) |x| (infinity norms) exceeds 1e-10, or when the inertia of K - mu M (Sylvester) shows
/// that an eigenvalue was missed.
///
/// One answer for one matrix: values ascend; each vector's largest component is positive (of components that tie within
/// 1e-6, the first counts); values closer than 1e-8 (lambda - sigma) form a cluster, whose basis is fixed by its
/// subspace alone: the first vector alone reaches the row of largest norm, the second that of what is left, and so on.
/// Pairs whose residual is too large are refined by inverse iteration first: high pairs lose digits to low ones, nu = 1 / (lambda -
/// sigma) being small beside the largest. `beyond`, if given, takes the next pairs that were found on the way (0 to 4, not checked);
/// `at_sigma` is the factor of K - sigma M, where there is one already.
Eigenpairs lowest_eigenpairs(const SparseMatrix& K, const SparseMatrix& M, int k, double sigma, Eigenpairs* beyond = nullptr,
                             const SparseFactor* at_sigma = nullptr);

/// The same from operators: `inverse` applies (K - sigma M)^-1, positive definite, and `mass` applies M. No residual
/// and no inertia check is possible here. Up to about 2 k unknowns, or unknowns with mass, a dense solver is used.
Eigenpairs lowest_eigenpairs(const LinearOperator& inverse, const LinearOperator& mass, int k, double sigma);

}  // namespace cardan
