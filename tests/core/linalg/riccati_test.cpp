#include "core/linalg/riccati.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/linalg/dense.hpp"

namespace cardan::test {
namespace {

using Eigen::MatrixXd;

MatrixXd random_matrix(std::mt19937_64& rng, int rows, int cols) {
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, cols, [&] { return normal(rng); });
}

/// Examples 1 and 2 of Benner, Laub, Mehrmann (1995, CAREX) and example 1 of their DAREX, which have closed solutions.
TEST(Riccati, HasTheClosedSolutionsOfItsBenchmarks) {
  MatrixXd A(2, 2), B(2, 1), Q(2, 2);
  const MatrixXd R = MatrixXd::Ones(1, 1);
  A << 0, 1, 0, 0;
  B << 0, 1;
  Q << 1, 0, 0, 2;
  MatrixXd X(2, 2);
  X << 2, 1, 1, 2;
  const auto first = continuous_riccati(A, B, Q, R);
  ASSERT_TRUE(first);
  EXPECT_LE((first->X - X).norm(), 1e-14);
  EXPECT_LE((first->K - X.row(1)).norm(), 1e-14);
  A << 4, 3, -4.5, -3.5;
  B << 1, -1;
  Q << 9, 6, 6, 4;  // of rank 1
  EXPECT_LE((continuous_riccati(A, B, Q, R)->X - (1.0 + std::sqrt(2.0)) * Q).norm(), 1e-11);
  EXPECT_LE((discrete_riccati(A, B, Q, R)->X - 0.5 * (1.0 + std::sqrt(5.0)) * Q).norm(), 1e-11);
}

/// The equation as it is written, and a closed system that is stable; of its solutions that one alone makes it so.
TEST(Riccati, IsSolvedByWhatStabilises) {
  std::mt19937_64 rng(7);
  for (int trial = 0; trial < 40; ++trial) {
    const int n = 1 + trial % 9, m = 1 + trial % 3;
    const MatrixXd A = random_matrix(rng, n, n), B = random_matrix(rng, n, m), C = random_matrix(rng, 2, n), r = random_matrix(rng, m, m);
    const MatrixXd Q = C.transpose() * C, R = r * r.transpose() + 0.1 * MatrixXd::Identity(m, m);
    const auto c = continuous_riccati(A, B, Q, R);
    ASSERT_TRUE(c) << trial;
    const MatrixXd G = B * inverse(R) * B.transpose(), left = A.transpose() * c->X + c->X * A - c->X * G * c->X + Q;
    const double x = c->X.norm();  // rounding is that of products, of which little may be left
    EXPECT_LE(left.norm(), 1e-13 * (2.0 * x * A.norm() + x * x * G.norm() + Q.norm())) << trial;
    EXPECT_LE((c->K - inverse(R) * B.transpose() * c->X).norm(), 1e-11 * c->K.norm()) << trial;
    for (const auto& s : eigenvalues(A - B * c->K)) EXPECT_LT(s.real(), 0.0) << trial;
    const auto d = discrete_riccati(A, B, Q, R);
    ASSERT_TRUE(d) << trial;
    const MatrixXd inner = inverse(R + B.transpose() * d->X * B), across = A.transpose() * d->X * B;
    EXPECT_LE((A.transpose() * d->X * A - across * inner * across.transpose() + Q - d->X).norm(),
              1e-11 * d->X.norm() * (1.0 + A.squaredNorm()))
        << trial;
    for (const auto& z : eigenvalues(A - B * d->K)) EXPECT_LT(std::abs(z), 1.0) << trial;
  }
}

/// A spacecraft: rigid, with modes from 0.01 to 100 Hz that hardly decay.
TEST(Riccati, TakesModesFarApart) {
  constexpr int kModes = 5, n = 2 * (kModes + 1);
  MatrixXd A = MatrixXd::Zero(n, n), B = MatrixXd::Zero(n, 1), Q = MatrixXd::Zero(n, n);
  for (int k = 0; k <= kModes; ++k) {
    const double w = k == 0 ? 0.0 : 2.0 * M_PI * std::pow(10.0, k - 3);
    A(k, kModes + 1 + k) = 1.0;
    A(kModes + 1 + k, k) = -w * w, A(kModes + 1 + k, kModes + 1 + k) = -2e-4 * w;
    B(kModes + 1 + k, 0) = k == 0 ? 1e-3 : 1e-4 * k;
    Q(k, k) = 1.0 + w * w, Q(kModes + 1 + k, kModes + 1 + k) = 1.0;
  }
  const MatrixXd R = 1e-6 * MatrixXd::Ones(1, 1);
  const auto found = continuous_riccati(A, B, Q, R);
  ASSERT_TRUE(found);
  EXPECT_LE(found->residual, 1e-12);
  const Discretised step = discretised(A, B, MatrixXd::Zero(n, n), 0.01);
  EXPECT_TRUE(discrete_riccati(step.A, step.B, Q, R));
}

/// Control that costs little: doubling alone loses what one term of the equation is larger than X by. Gains by both in 113 bits.
TEST(Riccati, KeepsItsDigitsWhereControlIsCheap) {
  MatrixXd A(3, 3), B(3, 1), Q = MatrixXd::Zero(3, 3), R(1, 1), K(1, 3);
  A << 1, 1, 0, 0, 1, 1, 0, 0, 1;
  B << 0.2686667753230292, 1.214651529623888, -1.9765217689500731;
  Q(0, 0) = 1371892.795176804;
  R << 0.009984246680333929;
  K << -0.34217203129967622, -1.4470728406711579, -2.3363568711388196;
  const auto three = discrete_riccati(A, B, Q, R);
  ASSERT_TRUE(three);
  EXPECT_LE((three->K - K).norm(), 1e-10);
  A.resize(2, 2), B.resize(2, 1), Q = MatrixXd::Zero(2, 2), K.resize(1, 2);
  A << -0.20261696680729718, 6.928436512729438, -0.12726746255315616, -0.24017789404687828;
  B << -276.3591860945239, -29.24583083247103;
  Q.diagonal() << 630761.9669425888, 44728854.67162136;
  R << 0.010993581697358897;
  K << 0.0024248118160030627, -0.0095106339936267999;
  const auto two = discrete_riccati(A, B, Q, R);
  ASSERT_TRUE(two);
  EXPECT_LE((two->K - K).norm(), 1e-10 * K.norm());
}

TEST(Riccati, HasNoSolutionWhereNothingStabilises) {
  MatrixXd A(2, 2), B(2, 1);
  A << 0.5, 0, 0, -1;  // unstable, not moved
  B << 0, 1;
  const MatrixXd one = MatrixXd::Ones(1, 1);
  EXPECT_FALSE(continuous_riccati(A, B, MatrixXd::Identity(2, 2), one));
  A(0, 0) = 1.5, A(1, 1) = 0.5;
  EXPECT_FALSE(discrete_riccati(A, B, MatrixXd::Identity(2, 2), one));
  A << 0, 1, 0, 0;  // a drift that is not seen
  Eigen::Matrix2d Q;
  Q << 0, 0, 0, 1;
  EXPECT_FALSE(continuous_riccati(A, B, Q, one));
  A << 0, 1, -4, 0;  // an oscillation that is neither
  EXPECT_FALSE(continuous_riccati(A, MatrixXd::Zero(2, 1), MatrixXd::Identity(2, 2), one));
  EXPECT_FALSE(continuous_riccati(A, B, MatrixXd::Identity(2, 2), -one));
  // An oscillation that is neither, beside what is: rounding may bring its pole to either side.
  A = MatrixXd::Zero(4, 4), B = MatrixXd::Zero(4, 1);
  A(0, 1) = A(2, 3) = 1.0, A(3, 2) = -100.0;
  B(1, 0) = 1.0;
  MatrixXd weights = MatrixXd::Zero(4, 4);
  weights(0, 0) = weights(1, 1) = 1.0;
  EXPECT_FALSE(continuous_riccati(A, B, weights, one));
  for (const double dt : {0.01, 0.1, 0.2, 0.3}) {
    const Discretised step = discretised(A, B, MatrixXd::Zero(4, 4), dt);
    EXPECT_FALSE(discrete_riccati(step.A, step.B, weights, one)) << dt;
  }
}

/// An oscillator and a double integrator in closed form; noise of a random walk of a rate.
TEST(Discretised, IsTheMotionBetweenTwoTicks) {
  const double w = 3.0, dt = 0.4, c = std::cos(w * dt), s = std::sin(w * dt);
  MatrixXd A(2, 2), B(2, 1), W = MatrixXd::Zero(2, 2), Ad(2, 2), Bd(2, 1), Wd(2, 2);
  A << 0, 1, -w * w, 0;
  B << 0, 2;
  Ad << c, s / w, -w * s, c;
  Bd << 2.0 * (1.0 - c) / (w * w), 2.0 * s / w;
  const Discretised step = discretised(A, B, W, dt);
  EXPECT_LE((step.A - Ad).norm(), 1e-14);
  EXPECT_LE((step.B - Bd).norm(), 1e-14);
  EXPECT_EQ(step.W.norm(), 0.0);
  A << 0, 1, 0, 0;
  W(1, 1) = 5.0;
  Wd << dt * dt * dt / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt;
  EXPECT_LE((discretised(A, B, W, dt).W - 5.0 * Wd).norm(), 1e-14);
}

/// Whatever the unit of the input is, and of ticks that are long beside what is fast and of what only adds up.
TEST(Discretised, KeepsItsDigitsAtAnyInputAndOverLongTicks) {
  for (const double b : {1e-20, 1.0, 1e10, 1e20}) {
    const Discretised step = discretised(-MatrixXd::Ones(1, 1), b * MatrixXd::Ones(1, 1), b * MatrixXd::Ones(1, 1), 0.1);
    EXPECT_NEAR(step.A(0, 0), std::exp(-0.1), 2e-16) << b;
    EXPECT_NEAR(step.B(0, 0) / b, -std::expm1(-0.1), 2e-16) << b;
    EXPECT_NEAR(step.W(0, 0) / b, -0.5 * std::expm1(-0.2), 2e-16) << b;
  }
  MatrixXd A(3, 3), B(3, 1);
  A << 0, 1, 0, 0, 0, 0, 0, 0, -2;
  B << 0, 1, 6;
  for (const double dt : {1.0, 1e3, 1e6, 1e10}) {
    const Discretised step = discretised(A, B, MatrixXd::Zero(3, 3), dt);
    EXPECT_EQ(step.A(1, 1), 1.0);
    EXPECT_NEAR(step.A(0, 1) / dt, 1.0, 1e-15) << dt;
    EXPECT_NEAR(step.B(0, 0) / (0.5 * dt * dt), 1.0, 1e-15) << dt;
    EXPECT_NEAR(step.A(2, 2), std::exp(-2.0 * dt), 1e-15 * (1.0 + 2.0 * dt) * std::exp(-2.0 * dt)) << dt;
    EXPECT_NEAR(step.B(2, 0), -3.0 * std::expm1(-2.0 * dt), 1e-14) << dt;
  }
}

/// A chain of integrators at ticks of any length: every entry has its digits, the covariance of the first one too, which goes as T^(2 n -
/// 1).
TEST(Discretised, KeepsTheDigitsOfEachOfAChain) {
  for (const int n : {2, 3, 4, 6, 9})
    for (const double T : {1e-5, 1e-3, 0.1, 1.0, 10.0}) {
      MatrixXd A = MatrixXd::Zero(n, n), B = MatrixXd::Zero(n, 1), W = MatrixXd::Zero(n, n);
      A.diagonal(1).setOnes();
      B(n - 1, 0) = W(n - 1, n - 1) = 1.0;
      const Discretised step = discretised(A, B, W, T);
      for (int i = 0; i < n; ++i) {
        const int a = n - 1 - i;
        EXPECT_NEAR(step.B(i, 0) / (std::pow(T, a + 1) / std::tgamma(a + 2)), 1.0, 1e-13) << n << ", " << T << ": " << i;
        for (int j = 0; j < n; ++j) {
          const int b = n - 1 - j;
          EXPECT_NEAR(step.A(i, j), j < i ? 0.0 : std::pow(T, j - i) / std::tgamma(j - i + 1), j < i ? 0.0 : 1e-13 * step.A(i, j))
              << n << ", " << T;
          EXPECT_NEAR(step.W(i, j) / (std::pow(T, a + b + 1) / ((a + b + 1) * std::tgamma(a + 1) * std::tgamma(b + 1))), 1.0, 1e-13)
              << n << ", " << T << ": " << i << ", " << j;
        }
      }
    }
}

/// Lags in a row, the second in other units: what is left of both after many of their times has its digits too.
TEST(Discretised, KeepsTheDigitsOfWhatFades) {
  for (const double a : {1.0, 20.0, 40.0, 300.0})
    for (const double unit : {1e-12, 1.0, 1e12}) {
      MatrixXd A(2, 2);
      A << -a, 0, unit, -a;
      const Discretised step = discretised(A, MatrixXd(2, 0), MatrixXd::Zero(2, 2), 1.0);
      const double left = std::exp(-a), digits = 1e-15 * (1.0 + a);
      EXPECT_NEAR(step.A(0, 0) / left, 1.0, digits) << a << ", " << unit;
      EXPECT_NEAR(step.A(1, 0) / (unit * left), 1.0, digits) << a << ", " << unit;
      EXPECT_EQ(step.A(0, 1), 0.0);
    }
}

/// A motor that follows within a part of a tick turns a wheel: noise of density q on its rate, x'' = -a x' + w.
TEST(Discretised, TakesNoiseThroughWhatIsFastBesideATick) {
  const double q = 0.7, T = 0.5;
  for (const double a : {0.3, 20.0, 200.0, 2e4}) {
    MatrixXd A(2, 2), W = MatrixXd::Zero(2, 2);
    A << 0, 1, 0, -a;
    W(1, 1) = q;
    const Discretised step = discretised(A, MatrixXd(2, 0), W, T);
    const double once = -std::expm1(-a * T), twice = -std::expm1(-2.0 * a * T);
    MatrixXd Wd(2, 2);
    Wd(0, 0) = q / (a * a) * (T - 2.0 * once / a + 0.5 * twice / a);
    Wd(0, 1) = Wd(1, 0) = 0.5 * q * once * once / (a * a);
    Wd(1, 1) = 0.5 * q * twice / a;
    for (const auto& [r, c] : {std::pair{0, 0}, {0, 1}, {1, 1}})  // of a slow one the closed form takes three digits from the first
      EXPECT_NEAR(step.W(r, c) / Wd(r, c), 1.0, 1e-11) << a << ": " << r << ", " << c;
    EXPECT_NEAR(step.A(0, 1) * a / once, 1.0, 1e-11);
  }
}

}  // namespace
}  // namespace cardan::test
