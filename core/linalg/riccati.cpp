#include "core/linalg/riccati.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr int kMostDoublings = 60, kMostTerms = 40;
constexpr double kMostOfDt = 1100.0;  // halves of a time, of any size that a double has
constexpr double kRounding = 1e-15, kResidual = 1e-8;

MatrixXd symmetric(const MatrixXd& A) { return 0.5 * (A + A.transpose()); }

/// The stabilising H of H = A* H (1 + G H)^-1 A + H0 by doubling (Chu, Fan, Lin, Wang 2004): after k rounds the cost of 2^k steps.
std::optional<MatrixXd> doubled(MatrixXd A, MatrixXd G, MatrixXd H) {
  const MatrixXd one = MatrixXd::Identity(A.rows(), A.cols());
  for (int k = 0; k < kMostDoublings; ++k) {
    const LuSolution left = lu_solve(one + G * H, A);  // (1 + G H)^-1 A
    if (!(left.rcond > 0.0)) return {};
    const MatrixXd more = symmetric(A.transpose() * H * left.x);
    G = symmetric(G + A * lu_solve(one + G * H, G).x * A.transpose());
    A = (A * left.x).eval();
    H += more;
    if (!H.allFinite() || !G.allFinite()) return {};
    if (more.norm() <= kRounding * H.norm()) return H;
  }
  return {};
}

/// P of A* P + P A + Q = 0 with A stable, by Cayley's transform and doubling (Smith 1968).
std::optional<MatrixXd> lyapunov(const MatrixXd& A, const MatrixXd& Q, double shift) {
  const MatrixXd one = MatrixXd::Identity(A.rows(), A.cols()), inverse = lu_solve(A - shift * one, one).x;
  return doubled(one + 2.0 * shift * inverse, MatrixXd::Zero(A.rows(), A.cols()),
                 symmetric(2.0 * shift * inverse.transpose() * Q * inverse));
}

/// Newton's steps (Kleinman 1968; Hewer 1971): what is left of the equation of X is that of a linear one of the closed system.
template <class Equation, class Correction>
void refine(MatrixXd& X, const Equation& equation, const Correction& correction) {
  for (int i = 0; i < 2; ++i) {
    const MatrixXd before = X, left = equation();
    const auto more = correction(left);
    if (!more) return;
    X += *more;
    if (!(equation().norm() < left.norm())) {
      X = before;
      return;
    }
  }
}

/// X1 + X2 + ... of X_k = next(X_(k-1)) / k, until no entry changes: each has its digits, those too through which a chain of integrators
/// leads, and which are small beside all others.
template <class Next>
MatrixXd series(MatrixXd term, const Next& next) {
  MatrixXd sum = term;
  for (Index k = 2; k < kMostTerms + 2 * sum.rows(); ++k) {
    term = next(term) / static_cast<double>(k);
    sum += term;
    if ((term.array().abs() <= 1e-17 * sum.array().abs()).all()) break;
  }
  return sum;
}

/// The shift that halves the way, in powers, between the nearest and the farthest eigenvalue.
double shift_between(const Eigen::VectorXcd& values) {
  double least = 1e300, most = 0.0;
  for (const auto& z : values) least = std::min(least, std::abs(z)), most = std::max(most, std::abs(z));
  return std::sqrt(std::max(least, 1e-8 * most) * most);
}

}  // namespace

std::optional<Riccati> continuous_riccati(const MatrixXd& A, const MatrixXd& B, const MatrixXd& Q, const MatrixXd& R) {
  const Index n = A.rows();
  const auto L = cholesky(R);
  if (!L) return {};
  const MatrixXd gain = cholesky_solve(*L, B.transpose()), G = symmetric(B * gain), one = MatrixXd::Identity(n, n);
  MatrixXd hamiltonian(2 * n, 2 * n);
  hamiltonian << A, -G, -Q, -A.transpose();
  const Eigen::VectorXcd values = eigenvalues(hamiltonian);
  const double shift = shift_between(values);
  if (!(shift > 0.0 && std::isfinite(shift))) return {};
  const MatrixXd shifted = A - shift * one, inverse = lu_solve(shifted, one).x;
  const MatrixXd W = lu_solve(shifted.transpose() + Q * inverse * G, one).x;  // (A_s* + Q A_s^-1 G)^-1
  const auto X0 =
      doubled(one + 2.0 * shift * W.transpose(), symmetric(2.0 * shift * inverse * G * W), symmetric(2.0 * shift * W * Q * inverse));
  if (!X0) return {};
  MatrixXd X = *X0;
  const auto equation = [&] { return symmetric(A.transpose() * X + X * A - X * G * X + Q); };
  const auto size = [&] { return 2.0 * (X * A).norm() + (X * G * X).norm() + Q.norm(); };
  refine(X, equation, [&](const MatrixXd& left) { return lyapunov(A - G * X, left, shift); });
  const double residual = equation().norm() / size();
  const MatrixXd K = gain * X;
  const Eigen::VectorXcd closed = eigenvalues(A - B * K);
  if (!(residual <= kResidual) || !(closed.real().maxCoeff() < -kRounding * closed.cwiseAbs().maxCoeff())) return {};
  return Riccati{X, K, residual};
}

std::optional<Riccati> discrete_riccati(const MatrixXd& A, const MatrixXd& B, const MatrixXd& Q, const MatrixXd& R) {
  const auto L = cholesky(R);
  if (!L) return {};
  const auto X0 = doubled(A, symmetric(B * cholesky_solve(*L, B.transpose())), Q);
  if (!X0) return {};
  MatrixXd X = *X0;
  const auto gain = [&]() -> MatrixXd { return symmetric_solve(symmetric(R + B.transpose() * X * B), MatrixXd(B.transpose() * X * A)); };
  const auto equation = [&] { return symmetric(A.transpose() * X * (A - B * gain()) + Q - X); };
  refine(X, equation, [&](const MatrixXd& left) { return doubled(A - B * gain(), MatrixXd::Zero(A.rows(), A.cols()), left); });
  const MatrixXd K = gain();
  const double residual = equation().norm() / ((A.transpose() * X * A).norm() + Q.norm() + X.norm());
  if (!(residual <= kResidual) || !(eigenvalues(A - B * K).cwiseAbs().maxCoeff() < 1.0 - kRounding)) return {};
  return Riccati{X, K, residual};
}

Discretised discretised(const MatrixXd& A, const MatrixXd& B, const MatrixXd& W, double dt) {
  const Index n = A.rows();
  const MatrixXd one = MatrixXd::Identity(n, n);
  // Of so short a part of dt that A h is of size one; then of twice that, up to dt.
  const double size = A.lpNorm<1>() * dt;
  const int doublings = size > 1.0 ? static_cast<int>(std::min(std::ceil(std::log2(size)), kMostOfDt)) : 0;
  const double h = std::ldexp(dt, -doublings), density = W.lpNorm<Eigen::Infinity>();
  const MatrixXd Ah = A * h;
  // Without the sizes of B and W, which would cost digits: the integral of exp(A s) over s, and exp(A s), whose diagonal less 1 stands
  // beside it, in which what only adds up keeps its zeros.
  MatrixXd sum = series(h * one, [&](const MatrixXd&term) -> MatrixXd { return Ah * term; }), part = A * sum;
  Eigen::ArrayXd grows = part.diagonal();
  part += one;
  MatrixXd Wd = series(W * (density > 0.0 ? h / density : 0.0), [&](const MatrixXd& term) {
    const MatrixXd half = Ah * term;
    return MatrixXd(half + half.transpose());
  });
  for (int i = 0; i < doublings; ++i) {
    Wd += (part * Wd * part.transpose()).eval();
    sum += (part * sum).eval();
    const Eigen::ArrayXd through = (part - MatrixXd(part.diagonal().asDiagonal())).cwiseProduct(part.transpose()).rowwise().sum();
    part = (part * part).eval();
    grows = grows * (2.0 + grows) + through;
    const auto fades = grows < -0.5;  // to so little that a difference to 1 does not have its digits
    const Eigen::ArrayXd faded = part.diagonal();
    part.diagonal() = fades.select(faded, 1.0 + grows);
    grows = fades.select(faded - 1.0, grows).eval();
  }
  return {part, sum * B, density * symmetric(Wd)};
}

}  // namespace cardan
