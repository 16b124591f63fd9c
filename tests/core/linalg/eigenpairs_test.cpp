#include "core/linalg/eigenpairs.hpp"
#include "tests/support/worse.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <numbers>

extern "C" void dgemv_(const char* transposed, const int* rows, const int* columns, const double* alpha, const double* A, const int* lda,
                       const double* x, const int* x_step, const double* beta, double* y, const int* y_step, std::size_t text_length);

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// n equal masses on a line of equal springs; both ends to ground, or free: omega = 2 sin(k pi / (2 (n + 1))), or / (2
/// n).
SparseMatrix chain(int n, bool free = false) {
  SparseMatrix K(n, n);
  std::vector<Eigen::Triplet<double>> t;
  for (int i = 0; i < n; ++i) {
    t.emplace_back(i, i, free && (i == 0 || i == n - 1) ? 1.0 : 2.0);
    if (i + 1 < n) t.emplace_back(i, i + 1, -1.0), t.emplace_back(i + 1, i, -1.0);
  }
  K.setFromTriplets(t.begin(), t.end());
  return K;
}

SparseMatrix identity(int n) {
  SparseMatrix M(n, n);
  M.setIdentity();
  return M;
}

double chain_value(int k, int n) { return std::pow(2 * std::sin(0.5 * k * std::numbers::pi / (n + 1)), 2); }

/// The same chain `copies` times, not coupled: every eigenvalue `copies` times.
SparseMatrix repeated(const SparseMatrix& A, int copies) {
  const int n = static_cast<int>(A.rows());
  std::vector<Eigen::Triplet<double>> t;
  for (int c = 0; c < copies; ++c)
    for (int j = 0; j < n; ++j)
      for (SparseMatrix::InnerIterator it(A, j); it; ++it) t.emplace_back(c * n + static_cast<int>(it.row()), c * n + j, it.value());
  SparseMatrix B(copies * n, copies * n);
  B.setFromTriplets(t.begin(), t.end());
  return B;
}

// Relative error of lambda: rounding times lambda_max / lambda_1, 4 / 2e-5.
TEST(LowestEigenpairs, OfASpringChainAreTheClosedForm) {
  const int n = 700;
  const Eigenpairs found = lowest_eigenpairs(chain(n), identity(n), 12, 0.0);
  for (int k = 1; k <= 12; ++k) EXPECT_NEAR(found.values(k - 1) / chain_value(k, n), 1.0, 1e-10) << k;
  EXPECT_LE(test::largest(found.vectors.transpose() * found.vectors - MatrixXd::Identity(12, 12)), 1e-13);
}

TEST(LowestEigenpairs, OfAFreeChainBeginWithTheRigidMode) {
  const int n = 100;
  const Eigenpairs found = lowest_eigenpairs(chain(n, true), identity(n), 3, -1e-3);
  EXPECT_NEAR(found.values(0), 0.0, 1e-14);
  for (int k = 1; k < 3; ++k) EXPECT_NEAR(found.values(k) / chain_value(k, n - 1), 1.0, 1e-11);
  EXPECT_NEAR(found.vectors.col(0).minCoeff<Eigen::PropagateNaN>(), 0.1, 1e-10);  // 1 / sqrt(n), positive
  EXPECT_NEAR(found.vectors.col(0).maxCoeff<Eigen::PropagateNaN>(), 0.1, 1e-10);
}

TEST(LowestEigenpairs, AgreeBetweenTheDenseAndTheIterativeWay) {
  for (int n : {20, 40}) {  // 4 + 4 pairs want 24 Lanczos vectors: below that the dense solver is used
    const Eigenpairs found = lowest_eigenpairs(chain(n), identity(n), 4, 0.0);
    for (int k = 1; k <= 4; ++k) {
      EXPECT_NEAR(found.values(k - 1) / chain_value(k, n), 1.0, 1e-12);
      VectorXd shape(n);
      for (int i = 0; i < n; ++i) shape(i) = std::sin(k * std::numbers::pi * (i + 1) / (n + 1)) * std::sqrt(2.0 / (n + 1));
      Eigen::Index largest = 0;  // the first of the entries that tie
      while (std::abs(shape(largest)) < (1 - 1e-6) * test::largest(shape)) ++largest;
      if (shape(largest) < 0) shape = -shape;
      EXPECT_LE(test::largest(found.vectors.col(k - 1) - shape), 1e-10) << n << ", " << k;
    }
  }
}

TEST(LowestEigenpairs, UseTheMassMatrix) {
  const int n = 60;
  SparseMatrix M = 4.0 * identity(n);
  const Eigenpairs found = lowest_eigenpairs(chain(n), M, 2, 0.0);
  EXPECT_NEAR(found.values(0) * 4.0 / chain_value(1, n), 1.0, 1e-12);
  EXPECT_NEAR(found.vectors.col(0).squaredNorm(), 0.25, 1e-12);
}

TEST(LowestEigenpairs, TakeAMassMatrixWithEmptyRows) {
  const int n = 60;  // every second mass is zero: the chain of 30 masses is what remains, with springs in series... of
                     // half stiffness
  SparseMatrix M(n + 1, n + 1);
  std::vector<Eigen::Triplet<double>> t;
  for (int i = 1; i < n; i += 2) t.emplace_back(i, i, 1.0);
  M.setFromTriplets(t.begin(), t.end());
  const Eigenpairs found = lowest_eigenpairs(chain(n + 1), M, 5, 0.0);
  for (int k = 1; k <= 5; ++k) EXPECT_NEAR(found.values(k - 1) / (0.5 * chain_value(k, n / 2)), 1.0, 1e-12);
}

// Of a chain with four masses, and as many pairs as it has: fewer than the vectors of Lanczos' method.
TEST(LowestEigenpairs, TakeAMassMatrixOfFewMasses) {
  const int n = 99, apart = 20;
  SparseMatrix M(n, n);
  std::vector<Eigen::Triplet<double>> t;
  for (int i = apart - 1; i < n; i += apart) t.emplace_back(i, i, 1.0);
  M.setFromTriplets(t.begin(), t.end());
  const Eigenpairs found = lowest_eigenpairs(chain(n), M, 4, 0.0);
  for (int k = 1; k <= 4; ++k) EXPECT_NEAR(found.values(k - 1) / (chain_value(k, 4) / apart), 1.0, 1e-11);
  EXPECT_LE(test::largest(found.vectors.transpose() * M * found.vectors - MatrixXd::Identity(4, 4)), 1e-13);
  try {
    lowest_eigenpairs(chain(n), M, 5, 0.0);
    FAIL() << "more than have mass";
  } catch (const LinalgError& e) {
    EXPECT_STREQ(e.what(), "4 degrees of freedom that carry mass");
  }
}

TEST(LowestEigenpairs, FindEveryMemberOfAClusterAndPlaceItsBasisByTheSubspaceAlone) {
  const int n = 50, copies = 7;
  const Eigenpairs found = lowest_eigenpairs(repeated(chain(n), copies), identity(n * copies), 10, 0.0);
  for (int k = 0; k < copies; ++k) {
    EXPECT_NEAR(found.values(k) / chain_value(1, n), 1.0, 1e-11);
    // Copy k alone moves: its middle is the row of largest norm, and the copies come in their order.
    EXPECT_NEAR(found.vectors.col(k).segment(n * k, n).norm(), 1.0, 1e-7);
    EXPECT_GT(found.vectors(n * k + n / 2, k), 0.0);
  }
  for (int k = copies; k < 10; ++k) EXPECT_NEAR(found.values(k) / chain_value(2, n), 1.0, 1e-11);
}

TEST(LowestEigenpairs, AreTheSameBitForBitEveryTime) {
  const Eigenpairs first = lowest_eigenpairs(chain(300), identity(300), 9, -1e-3);
  lowest_eigenpairs(chain(77), identity(77), 3, 0.0);  // another problem between must not matter
  const Eigenpairs again = lowest_eigenpairs(chain(300), identity(300), 9, -1e-3);
  EXPECT_EQ(std::memcmp(first.values.data(), again.values.data(), sizeof(double) * first.values.size()), 0);
  EXPECT_EQ(std::memcmp(first.vectors.data(), again.vectors.data(), sizeof(double) * first.vectors.size()), 0);
}

TEST(LowestEigenpairs, ComeFromOperatorsAsWell) {
  const int n = 90;
  const SparseFactor factor(chain(n));
  const auto inverse = [&](const VectorXd& x, VectorXd& y) { y = factor.solve(x); };
  const auto mass = [](const VectorXd& x, VectorXd& y) { y = x; };
  const Eigenpairs found = lowest_eigenpairs({n, n, inverse, inverse}, {n, n, mass, mass}, 3, 0.0);
  for (int k = 1; k <= 3; ++k) EXPECT_NEAR(found.values(k - 1) / chain_value(k, n), 1.0, 1e-12);
}

TEST(LowestEigenpairs, RefuseWhatCannotBe) {
  try {
    lowest_eigenpairs(chain(30), identity(30), 31, 0.0);
    FAIL() << "more than there are";
  } catch (const LinalgError& e) {
    EXPECT_STREQ(e.what(), "31 eigenpairs of 30 unknowns");
  }
  EXPECT_THROW(lowest_eigenpairs(chain(30), identity(30), 2, 1.0), LinalgError);          // a shift inside the spectrum
  EXPECT_THROW(lowest_eigenpairs(chain(30), SparseMatrix(30, 30), 2, 0.0), LinalgError);  // no mass at all
  EXPECT_THROW(lowest_eigenpairs(chain(60), SparseMatrix(60, 60), 2, 0.0), LinalgError);
}

TEST(LowestEigenpairs, RefuseWhatIsNotFiniteAndEndNoProcess) {
  const auto mass = [](const VectorXd& x, VectorXd& y) { y = x; };
  for (const double bad : {std::nan(""), HUGE_VAL, 1e200}) {
    const auto inverse = [&](const VectorXd& x, VectorXd& y) { y = x, y(3) = bad; };
    EXPECT_THROW(lowest_eigenpairs({90, 90, inverse, inverse}, {90, 90, mass, mass}, 3, 0.0), LinalgError);
  }
  // LAPACK's answer to a wrong argument, through a Fortran routine, is an error of ours.
  const int n = 2, one = 1;
  const double a[4] = {}, x[2] = {}, scale = 1.0;
  double y[2] = {};
  try {
    dgemv_("?", &n, &n, &scale, a, &n, x, &one, &scale, y, &one, 1);
    FAIL() << "a transposition of '?'";
  } catch (const LinalgError& e) {
    EXPECT_EQ(std::string(e.what()).find("DGEMV"), 0u) << e.what();
  }
}

TEST(SparseFactorisation, SolvesAndCountsNegativeEigenvalues) {
  const int n = 40;
  const MatrixXd b = MatrixXd::Random(n, 2);
  EXPECT_LE(test::largest(chain(n) * SparseFactor(chain(n)).solve(b) - b), 1e-12);
  EXPECT_EQ(SparseFactor(chain(n)).negative_pivots(), 0);
  for (int k = 1; k < 5; ++k) {
    const double mu = 0.5 * (chain_value(k, n) + chain_value(k + 1, n));
    SparseMatrix shifted = chain(n) - mu * identity(n);
    shifted.makeCompressed();
    EXPECT_EQ(SparseFactor(shifted).negative_pivots(), k);
    EXPECT_LE(test::largest(shifted * SparseFactor(shifted).solve(b) - b), 1e-9);
  }
}

TEST(SparseFactorisation, TellsOfASingularMatrix) {
  EXPECT_LT(SparseFactor(repeated(chain(5), 2)).smallest_pivot().ratio, 1.0);
  EXPECT_GT(SparseFactor(repeated(chain(5), 2)).smallest_pivot().ratio, 0.1);
  EXPECT_THROW(SparseFactor(chain(6, true)), LinalgError);  // integers: the last pivot is exactly zero
  EXPECT_THROW(SparseFactor(SparseMatrix(3, 4)), LinalgError);
  SparseMatrix A = identity(5);
  A.coeffRef(2, 2) = 0.0;
  try {
    SparseFactor factor(A);
    FAIL() << "a zero pivot";
  } catch (const LinalgError& e) {
    EXPECT_EQ(e.row, 2);
  }
}

TEST(SparseFactorisation, IsTheSameBitForBitEveryTimeAndLeavesOutWhatIsZero) {
  SparseMatrix with_zeros = repeated(chain(40), 3);
  for (int j = 0; j < 120; ++j) with_zeros.coeffRef(j, 0) += 0.0, with_zeros.coeffRef(0, j) += 0.0;
  with_zeros.makeCompressed();
  const MatrixXd b = MatrixXd::Random(120, 1), x = SparseFactor(repeated(chain(40), 3)).solve(b);
  for (const SparseMatrix& A : {repeated(chain(40), 3), with_zeros}) {
    const MatrixXd again = SparseFactor(A).solve(b);
    EXPECT_EQ(std::memcmp(x.data(), again.data(), sizeof(double) * 120), 0);
  }
}

}  // namespace
}  // namespace cardan
