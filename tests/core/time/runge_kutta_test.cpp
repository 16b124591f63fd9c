#include <cstdio>
#include <numbers>

#include "tests/core/time/problems.hpp"
#include "tests/support/malloc_counter.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

IntegratorOptions equal_steps(const std::string& method, double h) {
  if (method == "rk4") return rk4(h);
  IntegratorOptions o = adaptive(method, 0.5);  // never rejects: the largest step is taken every time
  o.initial_step = o.max_step = h;
  return o;
}

double end_error(const std::string& method, double h) {
  auto integrator = make_integrator(exp_sin(1e3), equal_steps(method, h));
  return std::abs(integrate(*integrator, 0.0, {1.0}, 2.0)[0] - std::exp(std::sin(2.0)));
}

/// Largest error of the dense output over the steps up to 2 s.
double dense_error(const std::string& method, double h) {
  auto integrator = make_integrator(exp_sin(1e3), equal_steps(method, h));
  double x = 1.0, worst = 0.0;
  integrator->restart(0.0, &x);
  for (double t = 0.0; t < 2.0;) {
    const double end = integrator->step(2.0, &x).t;
    for (double s : {0.2, 0.4, 0.6, 0.8}) {
      const double middle = t + s * (end - t);
      integrator->interpolate(middle, &x);
      worst = worse(worst, std::abs(x - std::exp(std::sin(middle))));
    }
    t = end;
  }
  return worst;
}

double slope(double coarse, double fine) { return std::log2(coarse / fine); }

TEST(RungeKutta, Rk4ConvergesWithOrderFour) { EXPECT_NEAR(slope(end_error("rk4", 0.04), end_error("rk4", 0.02)), 4.0, 0.1); }

TEST(RungeKutta, Dopri5ConvergesWithOrderFive) { EXPECT_NEAR(slope(end_error("dopri5", 0.08), end_error("dopri5", 0.04)), 5.0, 0.2); }

TEST(RungeKutta, DenseOutputOfRk4HasOrderFour) { EXPECT_NEAR(slope(dense_error("rk4", 0.04), dense_error("rk4", 0.02)), 4.0, 0.2); }

TEST(RungeKutta, DenseOutputOfDopri5HasOrderFour) {  // its error per step is h^5
  EXPECT_NEAR(slope(dense_error("dopri5", 0.08), dense_error("dopri5", 0.04)), 5.0, 0.3);
}

TEST(RungeKutta, Dop853ConvergesWithOrderEight) { EXPECT_NEAR(slope(end_error("dop853", 0.5), end_error("dop853", 0.25)), 8.0, 0.5); }

TEST(RungeKutta, DenseOutputOfDop853HasOrderSeven) {  // its error per step is h^8
  EXPECT_NEAR(slope(dense_error("dop853", 0.4), dense_error("dop853", 0.2)), 8.0, 0.5);
}

/// The largest error of the dense output over the steps to 6 s, each from the state at its start, in tolerances: absolute and relative.
double inside_in_tolerances(const std::string& method, OdeProblem p, std::vector<double> x, double tolerance) {
  p.looked_inside = true;
  const auto integrator = make_integrator(p, adaptive(method, tolerance));
  std::vector<double> inside(x.size());
  double t = 0.0, worst = 0.0;
  integrator->restart(t, x.data());
  while (t < 6.0) {
    const std::vector<double> x0 = x;
    const double end = integrator->step(6.0, x.data()).t;
    for (const double s : {0.1, 0.25, 0.5, 0.75, 0.9}) {
      const auto exact = make_integrator(p, adaptive("dop853", 1e-13));
      const Values there = integrate(*exact, t, x0, t + s * (end - t));
      integrator->interpolate(t + s * (end - t), inside.data());
      double sum = 0.0;
      for (std::size_t i = 0; i < x.size(); ++i)
        sum += std::pow((inside[i] - there[i]) / (tolerance * (1.0 + std::max(std::abs(x0[i]), std::abs(x[i])))), 2);
      worst = worse(worst, std::sqrt(sum / static_cast<double>(x.size())));
    }
    t = end;
  }
  return worst;
}

OdeProblem elliptic_orbit(double tolerance) {
  return problem(
      4,
      [](double, const double* x, double* xdot) {
        const double r = std::hypot(x[0], x[1]), pull = -1.0 / (r * r * r);
        xdot[0] = x[2], xdot[1] = x[3], xdot[2] = pull * x[0], xdot[3] = pull * x[1];
        return true;
      },
      tolerance);
}

/// Of the nine terms of order 5 that an elliptic orbit has its dense output leaves at most 7.87 times what the estimate has of each, and
/// that is at most the tolerance; docs/mathematics/integration.md, "Rows inside of steps".
TEST(RungeKutta, DenseOutputOfDopri5IsOffByEightTolerancesAtMost) {
  const double off = inside_in_tolerances("dopri5", elliptic_orbit(1e-7), {0.4, 0.0, 0.0, 2.0}, 1e-7);
  EXPECT_LT(off, 7.87);
  EXPECT_GT(off, 0.1) << "it is of this size";
}

/// Also of a fast swing that is no larger than the tolerance, beside a slow one: where nobody looks inside it is off by hundreds of them.
TEST(RungeKutta, DenseOutputOfDop853IsOffByThreeTolerancesAtMost) {
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    const OdeProblem swings = problem(
        4,
        [](double, const double* x, double* xdot) {
          xdot[0] = x[1], xdot[1] = -x[0], xdot[2] = x[3], xdot[3] = -400.0 * x[2];
          return true;
        },
        tolerance);
    EXPECT_LT(inside_in_tolerances("dop853", swings, {1.0, 0.0, tolerance, 0.0}, tolerance), 8.0 / 3.0) << tolerance;
    EXPECT_LT(inside_in_tolerances("dop853", elliptic_orbit(tolerance), {0.4, 0.0, 0.0, 2.0}, tolerance), 8.0 / 3.0) << tolerance;
  }
}

/// The order conditions sum_j a_ij = c_i and sum_i b_i c_i^k = 1 / (k + 1) of the 20 digits: x' = t^k over one step.
TEST(RungeKutta, Dop853IntegratesPolynomialsOfItsOrder) {
  for (int k = 0; k < 8; ++k) {
    auto integrator = make_integrator(problem(1,
                                              [k](double t, const double*, double* xdot) {
                                                xdot[0] = std::pow(t, k);
                                                return true;
                                              }),
                                      equal_steps("dop853", 1.0));
    double x = 0.0;
    integrator->restart(0.0, &x);
    integrator->step(1.0, &x);
    EXPECT_NEAR(x, 1.0 / (k + 1), 2e-15) << k;
    integrator->interpolate(0.4, &x);
    if (k < 7) {
      EXPECT_NEAR(x, std::pow(0.4, k + 1) / (k + 1), 1e-14) << k;
    }
  }
}

/// Twelve slopes a step, the last being the first of the next; three more where the state inside of a step is asked for.
TEST(RungeKutta, Dop853EvaluatesMoreOnlyForItsDenseOutput) {
  auto integrator = make_integrator(oscillator(), equal_steps("dop853", 0.1));
  double x[2] = {1.0, 0.0};
  integrator->restart(0.0, x);
  for (int k = 1; k <= 10; ++k) integrator->step(1.0, x);
  const IntegratorStatistics s = integrator->statistics();
  EXPECT_EQ(s.rhs_calls, 1 + 12 * s.steps);
  integrator->interpolate(0.97, x), integrator->interpolate(0.99, x);
  EXPECT_EQ(integrator->statistics().rhs_calls, s.rhs_calls + 3);
}

TEST(RungeKutta, Dop853KeepsItsTolerance) {
  double before = 1.0;
  for (double tolerance : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12}) {
    auto integrator = make_integrator(oscillator(tolerance), adaptive("dop853", tolerance));
    const double error = std::abs(integrate(*integrator, 0.0, {1.0, 0.0}, 20.0)[0] - std::cos(20.0));
    EXPECT_LT(error, 50.0 * tolerance);
    EXPECT_LT(error, 0.1 * before);
    before = error;
  }
}

TEST(RungeKutta, Dopri5KeepsItsTolerance) {
  double before = 1.0;
  for (double tolerance : {1e-4, 1e-6, 1e-8, 1e-10}) {
    auto integrator = make_integrator(oscillator(tolerance), adaptive("dopri5", tolerance));
    const double error = std::abs(integrate(*integrator, 0.0, {1.0, 0.0}, 20.0)[0] - std::cos(20.0));
    EXPECT_LT(error, 50.0 * tolerance);  // an error per step of the tolerance at most, adding up over 20 s
    EXPECT_LT(error, 0.1 * before);
    before = error;
  }
}

/// The estimate is of order h^5: a tolerance 1e5 times smaller needs ten times the steps.
TEST(RungeKutta, StepsOfDopri5GrowWithTheFifthRootOfTheTolerance) {
  const auto steps = [](double tolerance) {
    auto integrator = make_integrator(oscillator(tolerance), adaptive("dopri5", tolerance));
    integrate(*integrator, 0.0, {1.0, 0.0}, 100.0);
    return static_cast<double>(integrator->statistics().steps);
  };
  EXPECT_NEAR(steps(1e-11) / steps(1e-6), 10.0, 0.5);
  EXPECT_LT(steps(1e-6), 500);  // of 0.2 s; the constant of the estimate
}

/// A state that starts at zero is 1e155 and more absolute tolerances away after any step that can be seen: the square of that has no
/// double.
TEST(RungeKutta, BeginsWhereTheSquaresOfWhatIsToleratedVanish) {
  for (const char* method : {"dopri5", "dop853"})
    for (const double absolute : {1e-160, 1e-310, 5e-324}) {
      auto integrator = make_integrator(oscillator(absolute), adaptive(method, 1e-10));
      EXPECT_NEAR(integrate(*integrator, 0.0, {1.0, 0.0}, 2.0)[0], std::cos(2.0), 1e-8) << method << ", " << absolute;
      EXPECT_LT(integrator->statistics().steps, 300) << method << ", " << absolute;
    }
}

/// Quadrature weights: exact for polynomials of degree order - 1, up to round-off of the few steps.
TEST(RungeKutta, IntegralsOfPolynomialsAreExact) {
  for (const auto& [options, power] :
       {std::pair{rk4(0.3), 3}, std::pair{equal_steps("dopri5", 0.3), 4}, std::pair{equal_steps("dop853", 0.3), 7}}) {
    OdeProblem p = problem(1, [](double, const double*, double* xdot) {
      xdot[0] = 1.0;
      return true;
    });
    p.integrands = [power = power](double t, const double*, double* ydot) { ydot[0] = std::pow(t, power); };
    p.n_quadrature = 1;
    auto integrator = make_integrator(p, options);
    EXPECT_NEAR(integrate(*integrator, 0.0, {0.0}, 2.0, 1)[1], std::pow(2.0, power + 1) / (power + 1), 1e-13);
  }
}

/// One step of a motion that is followed exactly, however long, with a harmonic rate at each phase: there is none at which the estimate
/// sees nothing of the error. The tenfold is what balances allow.
TEST(RungeKutta, IntegralsOverLongStepsTellWhatTheyAreOffByAtEachPhase) {
  for (const double h : {0.1, 0.3, 1.0, 3.0})
    for (int i = 0; i < 400; ++i) {
      const double phase = std::numbers::pi * i / 400;
      OdeProblem p = problem(1, [](double, const double*, double* xdot) {
        xdot[0] = 1.0;
        return true;
      });
      p.integrands = [phase](double t, const double*, double* ydot) { ydot[0] = std::cos(t + phase); };
      p.n_quadrature = 1;
      auto integrator = make_integrator(p, equal_steps("dopri5", h));
      double x = 0.0, y = 0.0, error = 0.0;
      integrator->restart(0.0, &x);
      ASSERT_EQ(integrator->step(h, &x).t, h);
      integrator->integrals(h, &y, &error);
      const double off = std::abs(y - (std::sin(h + phase) - std::sin(phase)));
      EXPECT_LE(off, 5.0 * error + 1e-16) << h << " " << phase;
      EXPECT_LE(error, 1e-4 * std::pow(h, 4)) << h << " " << phase;
    }
}

/// The estimate of the code DOP853 [Hairer, Norsett, Wanner 1993, II.10]: of the errors of fifth and of third order,
/// e5^2 / sqrt(e5^2 + 0.01 e3^2), for one step of a rate of time alone.
TEST(RungeKutta, IntegralsOfDop853TellTheEstimateOfItsAuthors) {
  const double b[] = {0.0542937341165687622380535766363, 4.45031289275240888144113950566,  1.89151789931450038304281599044,
                      -5.8012039600105847814672114227,   0.31116436695781989440891606237,  -0.152160949662516078556178806805,
                      0.201365400804030348374776537501,  0.0447106157277725905176885569043};
  const double e5[] = {0.01312004499419488073250102996, -1.225156446376204440720569753,  -0.4957589496572501915214079952,
                       1.664377182454986536961530415,   -0.3503288487499736816886487290, 0.3341791187130174790297318841,
                       0.08192320648511571246570742613, -0.02235530786388629525884427845};
  const double places[] = {0.0, 1.0 / 3.0, 0.25, 4.0 / 13.0, 127.0 / 195.0, 0.6, 6.0 / 7.0, 1.0};
  const auto rate = [](double t) { return std::exp(1.3 * t); };
  for (const double h : {0.2, 1.0, 3.0}) {
    double third = -0.244094488188976377952755905512 * rate(0.0) - 0.733846688281611857341361741547 * rate(h * places[4]) -
                   0.220588235294117647058823529412e-1 * rate(h),
           fifth = 0.0;
    for (std::size_t i = 0; i < std::size(b); ++i) third += b[i] * rate(h * places[i]), fifth += e5[i] * rate(h * places[i]);
    OdeProblem p = problem(1, [](double, const double*, double* xdot) {
      xdot[0] = 1.0;
      return true;
    });
    p.integrands = [&](double t, const double*, double* ydot) { ydot[0] = rate(t); };
    p.n_quadrature = 1;
    auto integrator = make_integrator(p, equal_steps("dop853", h));
    double x = 0.0, y = 0.0, error = 0.0;
    integrator->restart(0.0, &x);
    ASSERT_EQ(integrator->step(h, &x).t, h);
    integrator->integrals(h, &y, &error);
    const double wanted = h * fifth * fifth / std::sqrt(fifth * fifth + 0.01 * third * third);
    EXPECT_NEAR(error, wanted, 1e-6 * wanted + 1e-15) << h;
  }
}

TEST(RungeKutta, FixedStepsDivideTheIntervalEvenly) {
  double x[2] = {1.0, 0.0};
  auto integrator = make_integrator(oscillator(), rk4(0.3));
  integrator->restart(0.0, x);
  for (double t : {0.25, 0.5, 0.75, 1.0}) EXPECT_NEAR(integrator->step(1.0, x).t, t, 1e-15);
}

/// (t_stop - t) / h is off by 4e-8 there: neither an eleventh step nor a sliver at the end.
TEST(RungeKutta, TenStepsStayTenStepsAfterAYear) {
  double x[2] = {1.0, 0.0};
  auto integrator = make_integrator(oscillator(), rk4(0.01));
  for (int k = 0; k < 20; ++k) {
    const double t0 = 31536000.0 + k / 10.0, t1 = 31536000.0 + (k + 1) / 10.0;
    const long before = integrator->statistics().steps;
    integrator->restart(t0, x);
    for (double t = t0; t < t1;) t = integrator->step(t1, x).t;
    EXPECT_EQ(integrator->statistics().steps - before, 10);
  }
}

TEST(RungeKutta, Rk4NeedsFourEvaluationsPerStep) {
  auto integrator = make_integrator(oscillator(), rk4(0.01));
  integrate(*integrator, 0.0, {1.0, 0.0}, 1.0);
  EXPECT_EQ(integrator->statistics().steps, 100);
  EXPECT_EQ(integrator->statistics().rhs_calls, 401);  // the slope at the end is the first stage of the next step
}

TEST(RungeKutta, AStepAllocatesNothing) {
  if (!counting) GTEST_SKIP() << "the sanitizer owns malloc";
  for (const std::string method : {"rk4", "dopri5", "dop853"}) {
    OdeProblem p = oscillator();
    p.n_quadrature = 1;
    p.integrands = [](double, const double* x, double* ydot) { ydot[0] = x[0]; };
    p.project = [](double, double*) {};
    p.n_roots = 1;
    p.roots = [](double, const double* x, double* g) { g[0] = x[0]; };
    auto integrator = make_integrator(p, accurate(method));
    double x[2] = {1.0, 0.0}, y = 0.0;
    int events = 0;
    const long before = malloc_calls;
    integrator->restart(0.0, x);
    for (double t = 0.0; t < 10.0;) {
      const StepReport report = integrator->step(10.0, x);
      t = report.t;
      if (!report.event) continue;
      ++events;
      integrator->interpolate(t - 1e-4, x);
      integrator->integrals(t, &y);
      integrator->interpolate(t, x);
      integrator->restart(t, x);
    }
    const long after = malloc_calls;
    EXPECT_EQ(after, before) << method;
    EXPECT_EQ(events, 3) << method;
  }
  EXPECT_GT(malloc_calls, 0);  // the counter counts
}

/// Two masses with a spring of 1e7 N/m and 1 m between them, 1.01 m from each other, the first at `far`.
OdeProblem two_masses(double relative) {
  return problem(
      4,
      [](double, const double* x, double* xdot) {
        const double pull = 1e7 * (x[1] - x[0] - 1.0);
        xdot[0] = x[2], xdot[1] = x[3], xdot[2] = pull / 500.0, xdot[3] = -pull / 800.0;
        return true;
      },
      relative);
}
long steps_of_spring(double far, double relative, double t_end) {
  auto integrator = make_integrator(two_masses(relative), adaptive("dop853", relative));
  integrate(*integrator, 0.0, {far, far + 1.01, 0.0, 0.0}, t_end);
  return integrator->statistics().steps;
}

/// Two masses that a spring of 1e7 N/m holds at 1 m, far out: an ulp of a place is 9.3e-10 m and 0.01 N. Counted from where they are the
/// same motion has all its digits, and with a tolerance that leaves rounding out steps are as accuracy has them.
TEST(RungeKutta, TellsWhereRoundingSetsTheSteps) {
  const auto looks = [](const std::string& method, double far, double relative) {
    auto integrator = make_integrator(two_masses(relative), adaptive(method, relative));
    Values x = {far, far + 1.01, 0.0, 0.0};
    integrator->restart(0.0, x.data());
    std::array<int, 2> told{};  // looks, and those that found it
    for (int step = 1; step <= 20'000; ++step) {
      const StepReport r = integrator->step(1e9, x.data());
      if (step % 1000 == 0) ++told[0], told[1] += r.rounding > 0.0;
      EXPECT_TRUE(r.rounding == 0.0 || r.rounded >= 2) << "of velocities, not " << r.rounded;
    }
    return told;
  };
  for (const std::string method : {"dopri5", "dop853"}) {
    const auto [all, tight] = looks(method, 7e6, 1e-14);
    EXPECT_EQ(all, 20);
    EXPECT_GE(tight, 10) << method;
    EXPECT_EQ(looks(method, 7e6, 1e-8)[1], 0) << method;
    EXPECT_EQ(looks(method, 0.0, 1e-12)[1], 0) << method;
  }
  for (const std::string method : {"cvode_adams", "cvode_bdf", "ark_explicit", "ark_implicit"}) {
    EXPECT_GT(looks(method, 7e6, 1e-13)[1], 0) << method;
    EXPECT_EQ(looks(method, 7e6, 1e-8)[1], 0) << method;
    EXPECT_EQ(looks(method, 0.0, 1e-12)[1], 0) << method;
  }
  const auto steps = [](double far, double relative) { return steps_of_spring(far, relative, 0.1); };
  const long near = steps(0.0, 1e-10), far = steps(7e6, 1e-10);
  std::printf("0.1 s by dop853 at 1e-10: %ld steps at the origin, %ld from 7e6 m; at 1e-8 %ld and %ld\n", near, far, steps(0.0, 1e-8),
              steps(7e6, 1e-8));
  EXPECT_GT(far, 5 * near);
}

}  // namespace
}  // namespace cardan::test
