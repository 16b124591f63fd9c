// ARPACK-NG, implicitly restarted Lanczos (Lehoucq, Sorensen, Yang 1998) in shift-invert mode, by reverse
// communication.
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <arpack/arpack.hpp>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <numeric>
#include <optional>
#include <vector>

#include "core/base/poll.hpp"
#include "core/linalg/dense.hpp"
#include "core/linalg/eigenpairs.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kClusterGap = 1e-8;      // of lambda - sigma
constexpr double kGroupGap = 1e-3;        // likewise, of pairs that are refined together
constexpr double kOffset = 1e-9;          // relative, of the shift of their inverse iteration: K - rho M is not singular
constexpr double kTie = 1e-6;             // relative
constexpr double kResidualLimit = 1e-10;  // backward error; a converged pair has about 1e-15
constexpr int kMaxRestarts = 1000;
constexpr double kLargest = 1e150;  // of a vector: its square is finite

/// Fixed start vector with entries in (-1, 1): splitmix64 (Steele, Lea, Flood 2014) from a fixed seed.
VectorXd start_vector(int n) {
  VectorXd x(n);
  std::uint64_t state = 20140914;
  for (double& value : x) {
    std::uint64_t z = (state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    value = static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1.0;
  }
  return x;
}

/// All pairs of M x = nu (K - sigma M) x with the dense inverse A^-1 = L L*: L* M L y = nu y, x = L y. Returns the k
/// largest nu.
Eigenpairs dense_pairs(const LinearOperator& inverse, const LinearOperator& mass, int k) {
  const int n = inverse.rows;
  MatrixXd A_inv(n, n), M(n, n);
  VectorXd column(n);
  for (int j = 0; j < n; ++j) {
    Poll::now();
    inverse.mult(VectorXd::Unit(n, j), column);
    A_inv.col(j) = column;
    mass.mult(VectorXd::Unit(n, j), column);
    M.col(j) = column;
  }
  const std::optional<MatrixXd> L = cholesky(0.5 * (A_inv + A_inv.transpose()));
  if (!L) throw LinalgError("the shifted stiffness is not positive definite: an eigenvalue lies below the shift");
  const DensePairs pairs = symmetric_pairs(L->transpose() * M * *L);
  return {pairs.values.tail(k), *L * pairs.vectors.rightCols(k)};
}

/// The same where few rows of M are not empty: of x_m, the components with mass, (A^-1)_mm M_mm x_m = nu x_m, and x = A^-1 M x / nu.
Eigenpairs pairs_of_few_masses(const LinearOperator& inverse, const LinearOperator& mass, int k, const std::vector<int>& with_mass) {
  const auto m = static_cast<Eigen::Index>(with_mass.size());
  MatrixXd solved(inverse.rows, m), A_inv(m, m), M(m, m);  // A^-1 of a unit at each of them, its components there
  VectorXd column(inverse.rows);
  for (Eigen::Index j = 0; j < m; ++j) {
    Poll::now();
    const VectorXd unit = VectorXd::Unit(inverse.rows, with_mass[static_cast<std::size_t>(j)]);
    inverse.mult(unit, column);
    solved.col(j) = column;
    A_inv.col(j) = column(with_mass);
    mass.mult(unit, column);
    M.col(j) = column(with_mass);
  }
  const std::optional<MatrixXd> L = cholesky(0.5 * (A_inv + A_inv.transpose()));
  if (!L) throw LinalgError("the shifted stiffness is not positive definite: an eigenvalue lies below the shift");
  const DensePairs pairs = symmetric_pairs(L->transpose() * M * *L);
  const VectorXd nu = pairs.values.tail(k);
  return {nu, solved * (M * (*L * pairs.vectors.rightCols(k))) * nu.cwiseInverse().asDiagonal()};
}

/// The k largest nu of the same problem by ARPACK.
Eigenpairs arpack_pairs(const LinearOperator& inverse, const LinearOperator& mass, int k, int n_lanczos) {
  static std::mutex one_at_a_time;  // ARPACK keeps its state in static variables
  const std::lock_guard lock(one_at_a_time);
  const int n = inverse.rows;
  VectorXd residual = start_vector(n), workd(3 * n), workl(n_lanczos * (n_lanczos + 8));
  MatrixXd basis(n, n_lanczos);
  VectorXd x(n), Mx(n), y(n);
  int ido = 0, info = 1;  // info = 1: the start vector is ours
  int iparam[11] = {1, 0, kMaxRestarts, 1, 0, 0, 3, 0, 0, 0, 0}, ipntr[14] = {};
  const auto work = [&](int slot) { return workd.segment(ipntr[slot] - 1, n); };
  for (;;) {
    arpack::saupd(ido, arpack::bmat::generalized, n, arpack::which::largest_algebraic, k, 0.0, residual.data(), n_lanczos, basis.data(), n,
                  iparam, ipntr, workd.data(), workl.data(), static_cast<int>(workl.size()), info);
    if (ido == 99) break;
    Poll::now();
    x = work(0);
    if (ido == 2) {
      mass.mult(x, y);
    } else {
      if (ido == 1)
        Mx = work(2);
      else
        mass.mult(x, Mx);
      inverse.mult(Mx, y);
    }
    if (!(y.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < kLargest))
      throw LinalgError("the factor gives values that are not finite, or too large: the stiffness is nearly singular");
    work(1) = y;
  }
  if (info == 1) throw LinalgError(fmt::format("{} of {} eigenpairs converged in {} restarts", iparam[4], k, kMaxRestarts));
  if (info == -9999) throw LinalgError(fmt::format("{} of {} pairs: the mass matrix has no more that are finite", iparam[4], k));
  if (info != 0) throw LinalgError(fmt::format("ARPACK dsaupd returned {}", info));
  std::vector<int> select(static_cast<std::size_t>(n_lanczos));
  Eigenpairs out{VectorXd(k), MatrixXd(n, k)};
  // sigma = 0 here: the values come back as 1/nu.
  arpack::seupd(1, arpack::howmny::ritz_vectors, select.data(), out.values.data(), out.vectors.data(), n, 0.0, arpack::bmat::generalized, n,
                arpack::which::largest_algebraic, k, 0.0, residual.data(), n_lanczos, basis.data(), n, iparam, ipntr, workd.data(),
                workl.data(), static_cast<int>(workl.size()), info);
  if (info != 0) throw LinalgError(fmt::format("ARPACK dseupd returned {}", info));
  out.values = out.values.cwiseInverse();
  return out;
}

/// First index whose value ties with the largest.
int first_of_largest(const VectorXd& magnitude) {
  const double limit = (1.0 - kTie) * magnitude.maxCoeff();
  int i = 0;
  while (!(magnitude(i) >= limit)) ++i;
  return i;
}

/// Turns the basis of one cluster (columns of X) so that it depends on the subspace alone: column j is the only one of
/// columns j, j+1, ... that reaches the row in which these are largest.
void fix_basis(Eigen::Ref<MatrixXd> X) {
  for (Eigen::Index j = 0; j + 1 < X.cols(); ++j) {
    auto rest = X.rightCols(X.cols() - j);
    const VectorXd row = rest.row(first_of_largest(rest.rowwise().norm())).transpose();
    VectorXd v = row;  // reflection that takes `row` to the first axis
    v(0) += row(0) < 0.0 ? -row.norm() : row.norm();
    const VectorXd turned = rest * v;
    rest -= turned * (2.0 / v.squaredNorm()) * v.transpose();
  }
}

/// Every basis of a cluster to the one of its subspace, and signs.
void fix_vectors(Eigenpairs& pairs, int begin, int end, double sigma) {
  MatrixXd& X = pairs.vectors;
  for (int first = begin, last; first < end; first = last) {
    last = first + 1;
    while (last < end && pairs.values(last) - pairs.values(last - 1) < kClusterGap * (pairs.values(last) - sigma)) ++last;
    fix_basis(X.middleCols(first, last - first));
  }
  for (int j = begin; j < end; ++j)
    if (X(first_of_largest(X.col(j).cwiseAbs()), j) < 0.0) X.col(j) *= -1.0;
}

/// Inverse iteration of pairs first ... last - 1 about their mean, then the best vectors of the space they span (Rayleigh, Ritz).
void refine(const SparseMatrix& K, const SparseMatrix& M, const auto& shifted, int first, int last, double sigma, Eigenpairs& pairs) {
  const int m = last - first;
  const double rho = pairs.values.segment(first, m).mean() * (1.0 + kOffset);
  const SparseFactor factor = shifted(rho);
  MatrixXd X = pairs.vectors.middleCols(first, m);
  for (int i = 0; i < 2; ++i) {
    X = factor.solve(MatrixXd(M * X));
    for (int j = 0; j < m; ++j) X.col(j) /= std::sqrt(X.col(j).dot(M * X.col(j)));
  }
  const MatrixXd A = X.transpose() * (K * X), B = X.transpose() * (M * X);
  const std::optional<DensePairs> ritz = generalised_pairs(0.5 * (A + A.transpose()), 0.5 * (B + B.transpose()));
  if (!ritz) return;  // as they were: the residual tells
  pairs.values.segment(first, m) = ritz->values;
  pairs.vectors.middleCols(first, m) = X * ritz->vectors;
  fix_vectors(pairs, first, last, sigma);
}

}  // namespace

/// What BLAS and LAPACK call when an argument is wrong. Theirs writes a line and ends the process, with status 0.
extern "C" [[gnu::visibility("default")]] void xerbla_(const char* routine, const int* argument, std::size_t length) {
  throw LinalgError(fmt::format("{}: argument {} is wrong", std::string_view(routine, length), *argument));
}

Eigenpairs lowest_eigenpairs(const LinearOperator& inverse, const LinearOperator& mass, int k, double sigma) {
  const int n = inverse.rows;
  if (k < 1 || k > n) throw LinalgError(fmt::format("{} eigenpairs of {} unknowns", k, n));
  const int n_lanczos = std::max(2 * k + 8, 24);
  std::vector<int> with_mass;  // Lanczos' vectors are as many as these at most
  VectorXd Mx(n);
  mass.mult(start_vector(n), Mx);
  for (int i = 0; i < n; ++i)
    if (Mx(i) != 0.0) with_mass.push_back(i);
  if (k > std::ssize(with_mass)) throw LinalgError(fmt::format("{} degrees of freedom that carry mass", with_mass.size()));
  Eigenpairs found = n_lanczos >= n                       ? dense_pairs(inverse, mass, k)
                     : n_lanczos >= std::ssize(with_mass) ? pairs_of_few_masses(inverse, mass, k, with_mass)
                                                          : arpack_pairs(inverse, mass, k, n_lanczos);
  if (!(found.values.minCoeff() > 0.0))
    throw LinalgError(fmt::format("fewer than {} finite eigenvalues above {}: too few degrees of freedom carry mass", k, sigma));

  std::vector<int> order(static_cast<std::size_t>(k));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return found.values(a) > found.values(b); });
  Eigenpairs out{VectorXd(k), MatrixXd(n, k)};
  for (int j = 0; j < k; ++j) {
    out.values(j) = sigma + 1.0 / found.values(order[static_cast<std::size_t>(j)]);
    out.vectors.col(j) = found.vectors.col(order[static_cast<std::size_t>(j)]);
  }

  // X* M X = 1 to the last bits.
  MatrixXd& X = out.vectors;
  MatrixXd MX(n, k);
  VectorXd column(n);
  for (int j = 0; j < k; ++j) {
    mass.mult(X.col(j), column);
    MX.col(j) = column;
  }
  X = orthonormalised(X, X.transpose() * MX);

  fix_vectors(out, 0, k, sigma);
  return out;
}

Eigenpairs lowest_eigenpairs(const SparseMatrix& K, const SparseMatrix& M, int k, double sigma, Eigenpairs* beyond,
                             const SparseFactor* at_sigma) {
  const int n = static_cast<int>(K.rows());
  const auto infinity_norm = [n](const SparseMatrix& A) {
    VectorXd sums = VectorXd::Zero(n);
    for (int j = 0; j < A.outerSize(); ++j)
      for (SparseMatrix::InnerIterator it(A, j); it; ++it) sums(it.row()) += std::abs(it.value());
    return sums.maxCoeff();
  };
  const auto shifted = [&](double mu) {
    SparseMatrix A = K - mu * M;
    A.makeCompressed();
    return SparseFactor(A);
  };
  std::optional<SparseFactor> own;
  if (!at_sigma) own.emplace(shifted(sigma));
  const SparseFactor& factor = at_sigma ? *at_sigma : *own;
  if (factor.negative_pivots() > 0) throw LinalgError(fmt::format("{} eigenvalues lie below the shift", factor.negative_pivots()));
  const auto solve = [&](const VectorXd& x, VectorXd& y) { y = factor.solve(x); };
  const auto multiply = [&](const VectorXd& x, VectorXd& y) { y.noalias() = M * x; };

  // A few pairs more than asked, to find a gap above the last one wanted for the inertia check.
  const int wanted = std::max(k, std::min(n, k + 4));
  Eigenpairs found;
  try {
    found = lowest_eigenpairs({n, n, solve, solve}, {n, n, multiply, multiply}, wanted, sigma);
  } catch (const LinalgError&) {
    if (wanted == k) throw;
    found = lowest_eigenpairs({n, n, solve, solve}, {n, n, multiply, multiply}, k, sigma);
  }

  const double K_norm = infinity_norm(K), M_norm = infinity_norm(M);
  const auto residual = [&](int j) {
    const VectorXd x = found.vectors.col(j);
    const double lambda = found.values(j);
    const double size = (K_norm + std::abs(lambda) * M_norm) * x.cwiseAbs().maxCoeff();
    return (K * x - lambda * (M * x)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() / size;
  };
  const int n_found = static_cast<int>(found.values.size());
  for (int j = 0; j < k; ++j) {
    if (residual(j) <= kResidualLimit) continue;
    int first = j, last = j + 1;  // with its close neighbours, found or not yet good
    const auto close = [&](int i) { return found.values(i) - found.values(i - 1) < kGroupGap * (found.values(i) - sigma); };
    while (first > 0 && close(first)) --first;
    while (last < n_found && close(last)) ++last;
    refine(K, M, shifted, first, last, sigma, found);
    if (const double error = residual(j); !(error <= kResidualLimit))
      throw LinalgError(fmt::format("eigenpair {} has a residual of {:.2g}", j + 1, error));
  }

  int below = std::min<int>(k, static_cast<int>(found.values.size()) - 1);  // eigenvalues below mu
  const auto gap = [&](int j) { return (found.values(j) - found.values(j - 1)) / (found.values(j) - sigma); };
  while (below > 0 && below + 1 < found.values.size() && gap(below) < 1e-4) ++below;
  while (below > 0 && gap(below) < 1e-4) --below;
  if (below > 0) {
    const double mu = 0.5 * (found.values(below - 1) + found.values(below));
    const int there = shifted(mu).negative_pivots();
    if (there != below) throw LinalgError(fmt::format("{} eigenvalues found below {:.6g}, but there are {}", below, mu, there));
  }
  if (beyond) *beyond = {found.values.tail(n_found - k), found.vectors.rightCols(n_found - k)};
  found.values.conservativeResize(k);
  found.vectors.conservativeResize(Eigen::NoChange, k);
  return found;
}

}  // namespace cardan
