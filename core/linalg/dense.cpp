#include "core/linalg/dense.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace cardan {

using Eigen::MatrixXd;
using Eigen::VectorXd;

DensePairs symmetric_pairs(const MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}
VectorXd symmetric_eigenvalues(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

std::optional<DensePairs> generalised_pairs(const MatrixXd& K, const MatrixXd& M) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(K, M);
  if (solver.info() != Eigen::Success) return {};
  return DensePairs{solver.eigenvalues(), solver.eigenvectors()};
}
std::optional<VectorXd> generalised_eigenvalues(const MatrixXd& K, const MatrixXd& M) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(K, M, Eigen::EigenvaluesOnly | Eigen::Ax_lBx);
  if (solver.info() != Eigen::Success) return {};
  return solver.eigenvalues();
}

// K = R R*, M = L L*: the roots of the eigenvalues are the singular values of R* L^-*.
std::optional<DensePairs> modal_pairs(const MatrixXd& K, const MatrixXd& M) {
  const std::optional<MatrixXd> L = cholesky(M);
  if (!L) return {};
  const RightSingular roots = right_singular(L->triangularView<Eigen::Lower>().solve(semidefinite_root(K)).transpose());
  return DensePairs{roots.values.reverse().cwiseAbs2(),
                    L->transpose().triangularView<Eigen::Upper>().solve(roots.vectors.rowwise().reverse())};
}

/// Rows and columns of like size by powers of 2, without rounding (Parlett and Reinsch 1969; Osborne 1960). Without it the squares of a
/// stiff mode, beside rates that count once, take the digits of all other eigenvalues.
static void balance(MatrixXd& A) {
  constexpr double kWorth = 0.95;  // less of the norm is no gain
  // Of what stands beside the diagonal alone: a sum less the diagonal is rounding where that is large, and no factor makes it smaller.
  const VectorXd diagonal = A.diagonal();
  A.diagonal().setZero();
  for (bool changed = true; changed;) {
    changed = false;
    for (Eigen::Index i = 0; i < A.rows(); ++i) {
      const double column = A.col(i).lpNorm<1>(), row = A.row(i).lpNorm<1>();
      if (!(column > 0.0 && row > 0.0) || !std::isfinite(column + row)) continue;
      const double factor = std::exp2(std::round(0.5 * std::log2(row / column)));
      if (factor * column + row / factor >= kWorth * (column + row)) continue;
      A.col(i) *= factor, A.row(i) /= factor;
      changed = true;
    }
  }
  A.diagonal() = diagonal;
}
Eigen::VectorXcd eigenvalues(const MatrixXd& A) {
  if (A.rows() == 0) return {};  // Eigen's solver reads beyond it
  MatrixXd balanced = A;
  balance(balanced);
  return Eigen::EigenSolver<MatrixXd>(balanced, false).eigenvalues();
}
ComplexPairs eigenpairs(const MatrixXd& A) {
  const Eigen::EigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

VectorXd singular_values(const MatrixXd& A) { return Eigen::JacobiSVD<MatrixXd>(A).singularValues(); }
RightSingular right_singular(const MatrixXd& A) {
  const Eigen::JacobiSVD<MatrixXd> svd(A, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

std::optional<MatrixXd> cholesky(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> factor(A);
  if (factor.info() != Eigen::Success) return {};
  return MatrixXd(factor.matrixL());
}
MatrixXd cholesky_solve(const MatrixXd& L, const MatrixXd& B) {
  const MatrixXd half = L.triangularView<Eigen::Lower>().solve(B);
  return L.transpose().triangularView<Eigen::Upper>().solve(half);
}
std::optional<MatrixXd> positive_inverse(const MatrixXd& A) {
  const Eigen::LLT<MatrixXd> factor(A);
  if (factor.info() != Eigen::Success) return {};
  return MatrixXd(factor.solve(MatrixXd::Identity(A.rows(), A.cols())));
}
MatrixXd orthonormalised(const MatrixXd& X, const MatrixXd& gram) {
  return Eigen::LLT<MatrixXd>(gram).matrixU().solve<Eigen::OnTheRight>(X);
}
VectorXd symmetric_solve(const MatrixXd& A, const VectorXd& b) { return A.ldlt().solve(b); }
MatrixXd symmetric_solve(const MatrixXd& A, const MatrixXd& B) { return A.ldlt().solve(B); }
VectorXd least_squares(const MatrixXd& A, const VectorXd& b) { return Eigen::CompleteOrthogonalDecomposition<MatrixXd>(A).solve(b); }
MatrixXd inverse(const MatrixXd& A) { return A.inverse(); }
double determinant(const MatrixXd& A) { return A.determinant(); }
Pivots complete_pivots(MatrixXd A, double limit) {
  Pivots out;
  std::vector<int> row(static_cast<std::size_t>(A.rows())), column(static_cast<std::size_t>(A.cols()));
  std::iota(row.begin(), row.end(), 0);
  std::iota(column.begin(), column.end(), 0);
  for (Eigen::Index p = 0; p < std::min(A.rows(), A.cols()); ++p) {
    Eigen::Index i, j;
    const double most = A.bottomRightCorner(A.rows() - p, A.cols() - p).cwiseAbs().maxCoeff(&i, &j);
    if (!(most > limit)) break;
    A.row(p).swap(A.row(p + i)), A.col(p).swap(A.col(p + j));
    std::swap(row[static_cast<std::size_t>(p)], row[static_cast<std::size_t>(p + i)]);
    std::swap(column[static_cast<std::size_t>(p)], column[static_cast<std::size_t>(p + j)]);
    for (Eigen::Index k = p + 1; k < A.rows(); ++k) A.row(k).tail(A.cols() - p) -= (A(k, p) / A(p, p)) * A.row(p).tail(A.cols() - p).eval();
    out.rows.push_back(row[static_cast<std::size_t>(p)]), out.columns.push_back(column[static_cast<std::size_t>(p)]);
    out.values.push_back(most);
  }
  return out;
}

ThinQr thin_qr(const MatrixXd& A) {
  const Eigen::HouseholderQR<MatrixXd> qr(A);
  return {qr.householderQ() * MatrixXd::Identity(A.rows(), A.cols()), qr.matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>()};
}
MatrixXd semidefinite_root(const MatrixXd& A) {
  const Eigen::LDLT<MatrixXd> factor(A);
  const MatrixXd L = factor.matrixL();
  const MatrixXd scaled = L * factor.vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  return factor.transpositionsP().transpose() * scaled;
}
LuSolution lu_solve(const MatrixXd& A, const MatrixXd& B) {
  const Eigen::PartialPivLU<MatrixXd> lu(A);
  return {lu.rcond(), lu.solve(B)};
}

}  // namespace cardan
