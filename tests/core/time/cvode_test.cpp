#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

double oscillator_error(const std::string& method, double tolerance) {
  auto integrator = make_integrator(oscillator(tolerance), adaptive(method, tolerance));
  return std::abs(integrate(*integrator, 0.0, {1.0, 0.0}, 20.0)[0] - std::cos(20.0));
}

/// An error per step near the tolerance adds up over some hundred (Adams) or thousand (BDF) steps.
TEST(Cvode, AdamsFollowsItsTolerance) {
  for (double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) EXPECT_LT(oscillator_error("cvode_adams", tolerance), 5e2 * tolerance);
}

TEST(Cvode, BdfFollowsItsTolerance) {
  for (double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) EXPECT_LT(oscillator_error("cvode_bdf", tolerance), 2e3 * tolerance);
}

TEST(Cvode, BdfSolvesRobertsonsKinetics) { expect_robertsons_kinetics(adaptive("cvode_bdf", 1e-9), 5000); }

/// The relaxation oscillation with eps = 1e-6; same source, problem VDPOL.
TEST(Cvode, BdfSolvesTheStiffVanDerPolEquation) {
  auto integrator = make_integrator(problem(
                                        2,
                                        [](double, const double* x, double* xdot) {
                                          xdot[0] = x[1];
                                          xdot[1] = ((1.0 - x[0] * x[0]) * x[1] - x[0]) / 1e-6;
                                          return true;
                                        },
                                        1e-10),
                                    adaptive("cvode_bdf", 1e-10));
  const Values x = integrate(*integrator, 0.0, {2.0, 0.0}, 2.0);
  EXPECT_NEAR(x[0], 0.1706167732170483e1, 1e-7);
  EXPECT_NEAR(x[1], -0.8928097010247975, 1e-7);
  EXPECT_LT(integrator->statistics().steps, 20000);
}

/// A fast oscillator with little damping that follows cos t, x'' = -w^2 (x - cos t) - 2 zeta w x': once it has come to
/// rest, orders above 2 are unstable for steps near and above 1/w, and the error test would keep the steps there.
TEST(Cvode, BdfIsNotHeldByItsStability) {
  constexpr double w = 1e4, zeta = 0.05;
  auto integrator = make_integrator(problem(
                                        2,
                                        [](double t, const double* x, double* xdot) {
                                          xdot[0] = x[1];
                                          xdot[1] = -w * w * (x[0] - std::cos(t)) - 2.0 * zeta * w * x[1];
                                          return true;
                                        },
                                        1e-8),
                                    adaptive("cvode_bdf", 1e-6));
  EXPECT_NEAR(integrate(*integrator, 0.0, {1.0, 0.0}, 10.0)[0], std::cos(10.0), 1e-5);
  EXPECT_LT(integrator->statistics().steps, 40000);  // 90,000 without
}

/// x follows a moving place by a stiff force, within the tolerance; the force is off by as much of it as Newton's iteration leaves, a
/// tenth, times its stiffness of 1e6. Integrals are those of the last evaluation of f, and what they lack of the momentum is told.
TEST(Cvode, IntegralsOfStiffForcesBalanceWhatTheyMove) {
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    double force = 0.0;
    OdeProblem p = problem(
        1,
        [&](double t, const double* x, double* xdot) {
          const double off = x[0] - 0.1 * std::sin(3.0 * t);
          xdot[0] = force = -1e3 * off / std::sqrt(1e-6 + off * off);
          return true;
        },
        tolerance);
    p.n_quadrature = 1;
    p.integrands = [&](double, const double*, double* ydot) { ydot[0] = force; };
    auto integrator = make_integrator(p, adaptive("cvode_bdf", tolerance));
    constexpr double end = 5.0;
    const double x = integrate(*integrator, 0.0, {0.0}, end)[0];
    double y = 0.0, error = 0.0;
    integrator->integrals(end, &y, &error);
    EXPECT_LT(std::abs(x - y), 0.1 * 1e6 * tolerance * end) << tolerance;
    EXPECT_LT(std::abs(x - y), 10.0 * (tolerance * integrator->statistics().error_sum + error)) << tolerance;
  }
}

TEST(Cvode, AdamsReachesHighOrder) {
  auto integrator = make_integrator(oscillator(), adaptive("cvode_adams", 1e-12));
  integrate(*integrator, 0.0, {1.0, 0.0}, 20.0);
  EXPECT_GE(integrator->statistics().last_order, 6);
  EXPECT_GT(integrator->statistics().last_step, 0.0);
  EXPECT_LT(integrator->statistics().rhs_calls, 4 * integrator->statistics().steps);
}

/// The counts go on over restarts, which CVODES' own do not.
TEST(Cvode, StatisticsAddUpOverRestarts) {
  auto integrator = make_integrator(oscillator(), adaptive("cvode_adams", 1e-10));
  integrate(*integrator, 0.0, {1.0, 0.0}, 20.0);
  const IntegratorStatistics one = integrator->statistics();
  integrate(*integrator, 0.0, {1.0, 0.0}, 20.0);
  const IntegratorStatistics two = integrator->statistics();
  EXPECT_GT(one.rejected.all(), 0);
  EXPECT_EQ(two.steps, 2 * one.steps);
  EXPECT_EQ(two.rhs_calls, 2 * one.rhs_calls);
  EXPECT_EQ(two.rejected.all(), 2 * one.rejected.all());
  EXPECT_EQ(two.restarts, 2);
}

}  // namespace
}  // namespace cardan::test
