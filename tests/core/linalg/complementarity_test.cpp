#include "core/linalg/complementarity.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace cardan {
namespace {

/// Of one p the conditions are necessary and sufficient: random matrices of any rank.
TEST(Complementarity, MeetsItsConditions) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  int some_rest = 0;
  for (int k = 0; k < 300; ++k) {
    const int n = 1 + k % 9, rank = k % 2 == 0 ? n : 1 + k / 2 % n;
    const Eigen::MatrixXd half = Eigen::MatrixXd::NullaryExpr(n, rank, [&] { return normal(random); });
    const Eigen::MatrixXd W = half * half.transpose();
    const Eigen::VectorXd x = Eigen::VectorXd::NullaryExpr(n, [&] { return normal(random); });
    const Eigen::VectorXd less = Eigen::VectorXd::NullaryExpr(n, [&] { return k % 4 == 3 ? std::abs(normal(random)) : 0.0; });
    const Eigen::VectorXd b = rank == n ? x : Eigen::VectorXd(W * x.cwiseAbs() - less);  // of singular ones with a solution
    const Eigen::VectorXd p = complementarity(W, b), w = W * p - b;
    const double size = b.lpNorm<Eigen::Infinity>();
    for (int i = 0; i < n; ++i) {
      EXPECT_GE(p[i], 0.0);
      EXPECT_GE(w[i], -1e-9 * size) << n << ", " << rank;
      EXPECT_LE(std::abs(p[i] * w[i]), 1e-9 * size * p.lpNorm<Eigen::Infinity>()) << n << ", " << rank;
      if (p[i] == 0.0) ++some_rest;
    }
  }
  EXPECT_GT(some_rest, 100);
}

TEST(Complementarity, LeavesOutWhatNothingMoves) {
  Eigen::Matrix2d W;
  W << 2.0, 0.0, 0.0, 0.0;
  EXPECT_EQ(complementarity(W, Eigen::Vector2d(3.0, 1.0)), Eigen::VectorXd(Eigen::Vector2d(1.5, 0.0)));
}

}  // namespace
}  // namespace cardan
