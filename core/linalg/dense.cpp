#include "core/linalg/dense.hpp"

#include <Eigen/Dense>

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

Eigen::VectorXcd eigenvalues(const MatrixXd& A) { return Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues(); }

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

ThinQr thin_qr(const MatrixXd& A) {
  const Eigen::HouseholderQR<MatrixXd> qr(A);
  return {qr.householderQ() * MatrixXd::Identity(A.rows(), A.cols()), qr.matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>()};
}
LuSolution lu_solve(const MatrixXd& A, const MatrixXd& B) {
  const Eigen::PartialPivLU<MatrixXd> lu(A);
  return {lu.rcond(), lu.solve(B)};
}

}  // namespace cardan
