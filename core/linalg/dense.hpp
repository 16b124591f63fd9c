#pragma once
// Decompositions of dense matrices by Eigen, compiled once: a file that names one of Eigen's takes seconds longer for each.
#include <Eigen/Core>
#include <optional>
#include <vector>

namespace cardan {

/// Eigenvalues, ascending, and their vectors, one a column.
struct DensePairs {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
/// Of A = A*, of which the lower triangle is read.
DensePairs symmetric_pairs(const Eigen::MatrixXd& A);
Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& A);
/// K x = lambda M x with K, M symmetric, X* M X = 1; nothing where M is not positive definite.
std::optional<DensePairs> generalised_pairs(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M);
std::optional<Eigen::VectorXd> generalised_eigenvalues(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M);
/// Those of K without negative eigenvalues, as of modes: where the largest is c times the smallest, rounding takes sqrt(c) epsilon of the
/// smallest, not c epsilon.
std::optional<DensePairs> modal_pairs(const Eigen::MatrixXd& K, const Eigen::MatrixXd& M);
/// Of any real matrix, in no order.
Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& A);
/// With their right vectors, of length 1, one a column; A is taken as it is, where eigenvalues() balances its rows and columns first.
struct ComplexPairs {
  Eigen::VectorXcd values;
  Eigen::MatrixXcd vectors;
};
ComplexPairs eigenpairs(const Eigen::MatrixXd& A);

/// Descending.
Eigen::VectorXd singular_values(const Eigen::MatrixXd& A);
struct RightSingular {
  Eigen::VectorXd values;   // descending
  Eigen::MatrixXd vectors;  // all of the right ones, one a column
};
RightSingular right_singular(const Eigen::MatrixXd& A);

/// The lower L of A = L L*; nothing where A is not positive definite.
std::optional<Eigen::MatrixXd> cholesky(const Eigen::MatrixXd& A);
/// A^-1 B of A = L L*, by the L of cholesky().
Eigen::MatrixXd cholesky_solve(const Eigen::MatrixXd& L, const Eigen::MatrixXd& B);
/// A^-1 of a positive definite A; nothing where it is not.
std::optional<Eigen::MatrixXd> positive_inverse(const Eigen::MatrixXd& A);
/// X U^-1 with gram = U* U: where gram = X* M X, the columns of the result are orthonormal in M.
Eigen::MatrixXd orthonormalised(const Eigen::MatrixXd& X, const Eigen::MatrixXd& gram);
/// A^-1 b of a symmetric A by L D L* with pivots.
Eigen::VectorXd symmetric_solve(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);
Eigen::MatrixXd symmetric_solve(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);
/// The shortest x that brings A x nearest to b (complete orthogonal decomposition).
Eigen::VectorXd least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);
Eigen::MatrixXd inverse(const Eigen::MatrixXd& A);
double determinant(const Eigen::MatrixXd& A);
/// Pivots of a complete elimination, as many as exceed `limit` in absolute value: where they stand in A, and what they are.
struct Pivots {
  std::vector<int> rows, columns;
  std::vector<double> values;
};
Pivots complete_pivots(Eigen::MatrixXd A, double limit);

/// A = Q R of a matrix that has no more columns than rows, by reflections: Q* Q = 1, R upper triangular and square.
struct ThinQr {
  Eigen::MatrixXd Q, R;
};
ThinQr thin_qr(const Eigen::MatrixXd& A);
/// A square B with B B* = A, of A = A* without negative eigenvalues (L D L* with pivots).
Eigen::MatrixXd semidefinite_root(const Eigen::MatrixXd& A);
/// A^-1 B by L U with pivots, and the reciprocal condition number of A by its factors: where that is below the precision of numbers, x is
/// worth nothing.
struct LuSolution {
  double rcond;
  Eigen::MatrixXd x;
};
LuSolution lu_solve(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

}  // namespace cardan
