// Decompositions of small dense matrices: their defining equations on matrices of random numbers.
#include "core/linalg/dense.hpp"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using test::largest;

constexpr double kRoundOff = 1e-13;  // relative, of condition numbers up to a hundred

MatrixXd random(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937_64 numbers(seed);
  std::uniform_real_distribution<double> even(-1.0, 1.0);
  return MatrixXd::NullaryExpr(rows, columns, [&] { return even(numbers); });
}

TEST(Dense, SolvesByTheFactorOfCholesky) {
  const MatrixXd X = random(7, 7, 1), A = X * X.transpose() + MatrixXd::Identity(7, 7), B = random(7, 3, 2);
  const auto L = cholesky(A);
  ASSERT_TRUE(L);
  EXPECT_EQ(largest(L->triangularView<Eigen::StrictlyUpper>().toDenseMatrix()), 0.0);
  EXPECT_LT(largest(*L * L->transpose() - A), kRoundOff * largest(A));
  EXPECT_LT(largest(A * cholesky_solve(*L, B) - B), kRoundOff);
  EXPECT_FALSE(cholesky(A - 20.0 * MatrixXd::Identity(7, 7)));
}

TEST(Dense, DividesATallMatrixIntoOrthonormalColumnsAndATriangle) {
  for (const Eigen::Index columns : {1, 4, 9}) {
    const MatrixXd A = random(9, columns, 3);
    const auto [Q, R] = thin_qr(A);
    ASSERT_EQ(Q.rows(), 9);
    ASSERT_EQ(R.rows(), columns);
    EXPECT_LT(largest(Q * R - A), kRoundOff);
    EXPECT_LT(largest(Q.transpose() * Q - MatrixXd::Identity(columns, columns)), kRoundOff);
    EXPECT_TRUE(R.isUpperTriangular(0.0));
  }
}

/// Equal oscillators side by side: what couples them is rounding, which balancing must not chase for ever.
TEST(Dense, FindsEigenvaluesBesideRounding) {
  for (unsigned seed = 0; seed < 2000; ++seed) {
    MatrixXd A = 1e-12 * random(3, 3, seed).cwiseAbs2().cwiseProduct(random(3, 3, seed + 1));
    A.diagonal().setConstant(1284.8051878541421);
    EXPECT_LT(largest(eigenvalues(A).cwiseAbs().array() - A(0, 0)), kRoundOff * A(0, 0)) << seed;
  }
  MatrixXd pair(2, 2);
  pair << 1284.8051878541421, 1.3514305529529802e-12, -1.7017466992078908e-13, 1284.8051878541421;
  EXPECT_EQ(eigenvalues(MatrixXd(0, 0)).size(), 0);
  EXPECT_LT(largest(eigenvalues(pair).cwiseAbs().array() - pair(0, 0)), kRoundOff * pair(0, 0));
}

TEST(Dense, SolvesByPivotsAndTellsHowNearTheMatrixIsToASingularOne) {
  MatrixXd A = random(6, 6, 4);
  A(0, 0) = 0.0;
  const MatrixXd B = random(6, 2, 5);
  const LuSolution good = lu_solve(A, B);
  EXPECT_LT(largest(A * good.x - B), kRoundOff);
  EXPECT_GT(good.rcond, 1e-3);
  // of a diagonal the 1-norms are those of its largest and smallest elements
  EXPECT_NEAR(lu_solve(Eigen::Vector3d(2.0, -8.0, 4.0).asDiagonal().toDenseMatrix(), MatrixXd::Zero(3, 1)).rcond, 0.25, 1e-15);
  A.row(5) = A.row(1) - 2.0 * A.row(2);
  EXPECT_LT(lu_solve(A, B).rcond, 1e-15);
}

}  // namespace
}  // namespace cardan
