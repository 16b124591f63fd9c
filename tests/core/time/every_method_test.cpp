#include <malloc.h>

#include <array>
#include <limits>
#include <stdexcept>

#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

TEST_P(EveryMethod, FollowsTheOscillator) {
  auto integrator = make(oscillator());
  const Values x = integrate(*integrator, 0.0, {1.0, 0.0}, 20.0);
  EXPECT_NEAR(x[0], std::cos(20.0), 2e-8);  // BDF at 1e-11 loses three digits over 20 s; the others are nearer
  EXPECT_NEAR(x[1], -std::sin(20.0), 2e-8);
  EXPECT_EQ(integrator->name(), GetParam());
}

/// SUNDIALS begin with what the rates change a state that is zero by its tolerance in, 3e-16 s here: that is no step at 1000 s. It ended
/// runs, or was a node of integrals.
TEST_P(EveryMethod, StartsLateWhereRatesAreLargeBesideTheTolerance) {
  if (GetParam() == "rk4") GTEST_SKIP() << "has no error test";
  for (const double t : {0.0, 7.0, 1e3, 1e5}) {
    OdeProblem p;
    p.n = p.n_quadrature = p.n_roots = 1;
    p.absolute_tolerance = {1e-12};
    p.rhs = [](double, const double* x, double* xdot) { return xdot[0] = 3000.0 - 900.0 * x[0], true; };
    p.integrands = [](double, const double* x, double* y) { y[0] = 3000.0 - 900.0 * x[0]; };
    p.roots = [](double, const double* x, double* g) { g[0] = x[0] - 1.0; };
    IntegratorOptions options;
    options.method = GetParam();
    options.relative_tolerance = 1e-9;
    const auto integrator = make_by(p, options);
    const double end = t + 0.0078125, exact = 3000.0 / 900.0 * -std::expm1(-900.0 * 0.0078125), rounding = 3000.0 * 1e-15 * t;
    Values x = {0.0};
    integrator->restart(t, x.data());
    double now = t, crossed = 0.0;
    while (now < end) {
      const StepReport report = integrator->step(end, x.data());
      now = report.t;
      if (report.event) crossed = now - t;
    }
    double integral = 0.0, error = 0.0;
    integrator->integrals(end, &integral, &error);
    EXPECT_NEAR(x[0], exact, 1e-7 + rounding) << t;
    EXPECT_NEAR(integral, exact, 1e-6 + rounding) << t;
    EXPECT_LT(error, 1e-4) << t;
    EXPECT_NEAR(crossed, -std::log(0.7) / 900.0, 1e-10 + 1e-15 * t) << t;
  }
}

/// A vehicle of which everything is locked has no states; SUNDIALS cannot do without, and what stands in rests, whatever its memory held.
TEST_P(EveryMethod, NeedsNoStates) {
  mallopt(M_PERTURB, 0xBE);  // fills what is handed out with 2e6
  OdeProblem p;
  p.n_roots = 1;
  p.rhs = [](double, const double*, double*) { return true; };
  p.roots = [](double t, const double*, double* g) { g[0] = t - 2.5; };
  const auto integrator = make(p);
  mallopt(M_PERTURB, 0);
  integrator->restart(0.0, nullptr);
  double now = 0.0, crossed = 0.0;
  while (now < 10.0) {
    const StepReport report = integrator->step(10.0, nullptr);
    if (report.event) crossed = report.t;
    EXPECT_NE(report.limit, StepLimit::error);
    now = report.t;
  }
  EXPECT_NEAR(crossed, 2.5, 1e-12);
}

/// An oscillator among 200 states that rest: in one group with it they hide its error, sqrt(101) in the norm, and the steps grow; in a
/// group of their own they take part in it by sqrt(2), whatever their number.
TEST_P(EveryMethod, DoesNotLetManySmoothStatesDiluteTheOthers) {
  if (GetParam() == "rk4") GTEST_SKIP() << "has no error test";
  const auto steps_with = [&](int still, bool grouped) {
    OdeProblem p = oscillator();
    p.n = 2 + still;
    p.absolute_tolerance.assign(static_cast<std::size_t>(p.n), 1e-8);
    if (grouped) {
      p.group.assign(static_cast<std::size_t>(p.n), 1);
      p.group[0] = p.group[1] = 0;
    }
    p.rhs = [n = p.n](double, const double* x, double* xdot) {
      std::fill_n(xdot, n, 0.0);
      xdot[0] = x[1], xdot[1] = -x[0];
      return true;
    };
    IntegratorOptions options;
    options.method = GetParam();
    options.relative_tolerance = 1e-8;
    const auto integrator = make_by(p, options);
    Values x(static_cast<std::size_t>(p.n), 1.0);
    integrate(*integrator, 0.0, x, 20.0);
    return static_cast<double>(integrator->statistics().steps);
  };
  const double alone = steps_with(0, false), diluted = steps_with(200, false);
  EXPECT_LT(diluted, 0.9 * alone);
  if (GetParam() == "dopri5") {  // the others change their order too
    EXPECT_GT(steps_with(20, true), 0.9 * alone);
  }
  EXPECT_NEAR(steps_with(200, true), steps_with(20, true), 0.03 * alone);
}

/// Two oscillators, the fast one in the states 2 and 3 or 0 and 1: its error sets the steps.
TEST_P(EveryMethod, NamesTheStateWhoseErrorSetsItsSteps) {
  for (const int fast : {0, 2}) {
    OdeProblem p = oscillator();
    p.n = 4;
    p.absolute_tolerance.assign(4, 1e-9);
    p.rhs = [fast](double, const double* x, double* xdot) {
      for (const int i : {0, 2}) xdot[i] = x[i + 1], xdot[i + 1] = -(i == fast ? 900.0 : 1.0) * x[i];
      return true;
    };
    const auto integrator = make_by(p, GetParam() == "rk4" ? rk4(0.01) : adaptive(GetParam(), GetParam() == "exponential" ? 1e-6 : 1e-9));
    Values x = {1.0, 0.0, 1.0, 0.0};
    integrator->restart(0.0, x.data());
    int by_error = 0, of_fast = 0, by_stop = 0;
    for (double t = 0.0; t < 5.0;) {
      const StepReport report = integrator->step(5.0, x.data());
      t = report.t;
      by_stop += report.limit == StepLimit::stop;
      if (report.limit != StepLimit::error) continue;
      ++by_error;
      of_fast += integrator->worst() == fast || integrator->worst() == fast + 1;
    }
    if (GetParam() == "rk4") {
      EXPECT_EQ(by_error + by_stop, 0);
      EXPECT_EQ(integrator->worst(), -1);
      continue;
    }
    EXPECT_GT(by_error, 10);
    EXPECT_GE(of_fast, 9 * by_error / 10);
    EXPECT_LE(by_stop, 3) << "the last ones share what is left";
  }
}

/// A bump in the rate of one of two states: trials that run into it are rejected, in the name of its group.
TEST_P(EveryMethod, CountsRejectionsByGroup) {
  if (GetParam() == "rk4") GTEST_SKIP() << "rejects nothing";
  for (const int bumped : {0, 1})
    for (const int group : {1, 7}) {
      OdeProblem p = problem(2, [bumped](double t, const double* x, double* xdot) {
        xdot[0] = -x[0], xdot[1] = -x[1];
        xdot[bumped] += 1e3 * std::exp(-std::pow((t - 3.0) / 1e-2, 2));
        return true;
      });
      p.group = {0, group};
      IntegratorOptions options = adaptive(GetParam(), 1e-6);
      options.max_step = 0.05;  // none steps over it
      const auto integrator = make_by(p, options);
      Values x = {1.0, 1.0};
      integrator->restart(0.0, x.data());
      Rejections before;
      for (double t = 0.0; t < 3.0;) {
        if (t < 2.0) before = integrator->statistics().rejected;
        t = integrator->step(4.0, x.data()).t;
      }
      Rejections r = integrator->statistics().rejected;
      const int of_bump = bumped == 0 ? 0 : std::min(group, 2);
      for (const int i : {0, 1, 2}) {
        const long n = r.by_error[static_cast<std::size_t>(i)] - before.by_error[static_cast<std::size_t>(i)];
        if (i == of_bump) {
          EXPECT_GT(n, 0);
        } else {
          EXPECT_EQ(n, 0) << "group " << i;
        }
      }
    }
}

/// Stops that come early, late, closely together and at one unit in the last place.
TEST_P(EveryMethod, NeverEvaluatesBeyondTheStop) {
  double t_stop = 0.0;
  OdeProblem p = oscillator();
  p.n_quadrature = 1;
  p.rhs = [&](double t, const double* x, double* xdot) {
    EXPECT_LE(t, t_stop);
    xdot[0] = x[1];
    xdot[1] = -x[0];
    return true;
  };
  p.integrands = [](double, const double* x, double* ydot) { ydot[0] = x[1]; };
  auto integrator = make(p);
  double x[2] = {1.0, 0.0}, y = 0.0, t = 0.0;
  integrator->restart(0.0, x);
  std::vector<double> stops;
  for (int k = 1; k <= 30; ++k) {
    stops.push_back(k * 0.1);
    stops.push_back(std::nextafter(k * 0.1, 100.0));
    stops.push_back(k * 0.1 + 1e-9);
  }
  for (double stop : stops) {
    t_stop = stop;
    while (t < stop) {
      const double reached = integrator->step(stop, x).t;
      ASSERT_GT(reached, t);
      t = reached;
    }
    EXPECT_EQ(t, stop);
  }
  EXPECT_NEAR(x[0], std::cos(t), 1e-8);
  integrator->integrals(t, &y);
  EXPECT_NEAR(y, std::cos(t) - 1.0, 1e-8);
  EXPECT_EQ(integrator->step(t_stop, x).t, t_stop);  // already there
}

TEST_P(EveryMethod, IntegralsKeepPaceWithTheStates) {
  OdeProblem p = oscillator();
  p.n_quadrature = 3;
  p.rhs = [](double, const double* x, double* xdot) {
    xdot[0] = x[1];
    xdot[1] = -x[0];
    return true;
  };
  p.integrands = [](double t, const double* x, double* ydot) { ydot[0] = x[0], ydot[1] = x[1] * x[1], ydot[2] = std::sin(3.0 * t); };
  auto integrator = make(p);
  const Values z = integrate(*integrator, 0.0, {1.0, 0.0}, 10.0, 3);
  EXPECT_NEAR(z[2], std::sin(10.0), 2e-8);
  EXPECT_NEAR(z[3], 5.0 - std::sin(20.0) / 4.0, 2e-8);
  const double own = GetParam() == "ark_implicit" ? 2e-8 : 1e-9;  // error, three times as fast as the states; the longest steps of all
  EXPECT_NEAR(z[4], (1.0 - std::cos(30.0)) / 3.0, own);
}

/// A vehicle that has become another one is looked at before its first step, at an instant of the run.
TEST_P(EveryMethod, IntegralsAreZeroBeforeTheFirstStep) {
  OdeProblem p = oscillator();
  p.n_quadrature = 1;
  p.integrands = [](double, const double* x, double* ydot) { ydot[0] = x[0]; };
  double y = 1.0, error = 1.0;
  make(p)->integrals(1.6, &y, &error);
  EXPECT_EQ(y, 0.0);
  EXPECT_EQ(error, 0.0);
}

/// Rates that jump at a restart, beside states that do not: integrals go on, each stretch with its own.
TEST_P(EveryMethod, IntegralsGoOnOverRestarts) {
  OdeProblem p = oscillator();
  double u = 1.0;
  p.n_quadrature = 1;
  p.integrands = [&](double t, const double*, double* ydot) { ydot[0] = u * std::cos(t); };
  auto integrator = make(p);
  double x[2] = {1.0, 0.0}, y = 0.0, truth = 0.0;
  for (int k = 0; k < 10; ++k, u = -2.0 * u) {
    integrator->restart(0.3 * k, x);
    for (double t = 0.3 * k; t < 0.3 * (k + 1);) t = integrator->step(0.3 * (k + 1), x).t;
    truth += u * (std::sin(0.3 * (k + 1)) - std::sin(0.3 * k));
    integrator->integrals(0.3 * (k + 1), &y);
    EXPECT_NEAR(y, truth, 1e-8 * std::abs(u));
  }
}

/// Rates that are faster than the states, have kinks or jump inside of steps: what the integrals are off by is told.
TEST_P(EveryMethod, IntegralsTellWhatTheyAreOffBy) {
  const double corner = std::acos(0.3);  // of |cos t - 0.3|, and of its sign
  for (const double relative : {1e-4, 1e-6, 1e-8, 1e-10}) {
    OdeProblem p = oscillator();
    p.n_quadrature = 3;
    p.integrands = [](double t, const double*, double* ydot) {
      ydot[0] = std::cos(7.0 * t);
      ydot[1] = std::abs(std::cos(t) - 0.3);
      ydot[2] = std::cos(t) > 0.3 ? 1.0 : -2.0;
    };
    auto integrator = make_by(p, GetParam() == "rk4" ? rk4(std::pow(relative, 0.25)) : adaptive(GetParam(), relative));
    const double end = 2.0;
    Values x = {1.0, 0.0};
    double longest = 0.0;
    integrator->restart(0.0, x.data());
    for (double t = 0.0; t < end;) {
      const double before = t;
      t = integrator->step(end, x.data()).t;
      longest = std::max(longest, t - before);
    }
    const double truth[] = {std::sin(7.0 * end) / 7.0, 2.0 * std::sin(corner) - std::sin(end) - 0.3 * (2.0 * corner - end),
                            corner - 2.0 * (end - corner)};
    double y[3], error[3];
    integrator->integrals(end, y, error);
    const int order = GetParam() == "exponential" ? 3 : 4;  // of the estimate
    const double most[] = {1e3 * std::pow(longest, order), 20.0 * longest, 100.0 * longest};
    for (std::size_t i = 0; i < 3; ++i) {
      const double allowed = i == 0 ? 2.0 : 50.0;  // one kink or jump may lie where the estimate hardly sees it
      EXPECT_LT(std::abs(y[i] - truth[i]), allowed * error[i] + 1e-14) << i << " at " << relative;
      EXPECT_LT(error[i], most[i]) << i << " at " << relative;
    }
    integrator->restart(end, x.data());  // what was off stays so
    double after[3];
    integrator->integrals(end, y, after);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(after[i], error[i]);
  }
}

/// What is stored in a contact that parts goes out at its depth, which is small beside the states, times a speed: a step that goes all the
/// way shows there what its stages, of a lower order than its end, are off by.
TEST(StagesOfAStep, TellWhatIntegralsOfTheStatesAreOffBy) {
  constexpr double kStart = 0.6, kAllowed = 10.0;  // [rad]; as the verdict of the ledger allows
  for (const char* method : {"ark_explicit", "ark_implicit", "ark_imex"})
    for (const double relative : {1e-4, 1e-6, 1e-8, 1e-10, 1e-12})
      for (const double way : {0.03, 0.1, 0.3}) {
        OdeProblem p = oscillator();
        p.n_quadrature = 1;
        p.integrands = [way](double, const double* x, double* ydot) { ydot[0] = (x[0] - std::cos(kStart + way)) * x[1]; };
        auto integrator = make_by(p, adaptive(method, relative));
        Values x = {std::cos(kStart), -std::sin(kStart)};
        integrator->restart(0.0, x.data());
        while (integrator->step(way, x.data()).t < way) {
        }
        double y, error;
        integrator->integrals(way, &y, &error);
        const double truth = -0.5 * std::pow(std::cos(kStart) - std::cos(kStart + way), 2);
        EXPECT_LT(std::abs(y - truth), kAllowed * error + 1e-16) << method << " at " << relative << " over " << way;
        EXPECT_LT(error, 1e-3 * std::abs(truth)) << method << " at " << relative << " over " << way;
      }
}

/// A command moves by a thousandth where a step ends: methods of one step go on with their step and order, those of several begin at order
/// 1 with short steps.
TEST_P(EveryMethod, KeepsItsStepOverATickUnlessItIsOfSeveralSteps) {
  double u = 1.0;
  OdeProblem p = problem(
      2,
      [&u](double, const double* x, double* xdot) {
        xdot[0] = x[1], xdot[1] = u - x[0];
        return true;
      },
      1e-9);
  auto integrator = make_by(p, GetParam() == "rk4" ? rk4(0.01) : adaptive(GetParam(), 1e-7));
  const double far = 1e3;  // no stop shortens the steps
  double x[2] = {0.0, 0.0}, t = 0.0;
  integrator->restart(0.0, x);
  int order = 0, worse = 0;
  for (int tick = 0; tick < 10; ++tick) {
    double h = 0.0;
    for (int k = 0; k < 40; ++k) {
      const StepReport report = integrator->step(far, x);
      h = report.t - t, t = report.t, order = report.order;
    }
    u *= 1.001;
    integrator->restart(t, x);
    const StepReport first = integrator->step(far, x);
    if (GetParam().starts_with("cvode")) {
      EXPECT_EQ(first.order, 1);
      EXPECT_LT(first.t - t, 0.1 * h);
    } else {
      EXPECT_EQ(first.order, order);
      worse += first.t - t < 0.7 * h;
    }
    t = first.t;
  }
  EXPECT_LE(worse, 1) << "a step that would have been shorter without a tick";
}

/// Large rates that change faster than the states.
TEST_P(EveryMethod, IntegralsTakeNoPartInTheSteps) {
  const auto run = [&](bool with) {
    OdeProblem p = oscillator();
    p.n_quadrature = with;
    p.integrands = [](double, const double* x, double* ydot) { ydot[0] = 1e6 * x[0] * x[1] * x[1]; };
    auto integrator = make(p);
    Values x = integrate(*integrator, 0.0, {1.0, 0.0}, 10.0);
    x.push_back(static_cast<double>(integrator->statistics().steps));
    x.push_back(static_cast<double>(integrator->statistics().rhs_calls));
    return x;
  };
  EXPECT_EQ(run(true), run(false));
}

TEST_P(EveryMethod, InterpolatesInsideTheLastStep) {
  OdeProblem p = oscillator();
  p.n_quadrature = 1;
  p.rhs = [](double, const double* x, double* xdot) {
    xdot[0] = x[1];
    xdot[1] = -x[0];
    return true;
  };
  p.integrands = [](double, const double* x, double* ydot) { ydot[0] = x[0]; };
  auto integrator = make(p);
  double x[2] = {1.0, 0.0}, y = 0.0;
  integrator->restart(0.0, x);
  for (double t = 0.0; t < 5.0;) {
    const double end = integrator->step(5.0, x).t;
    const double at_end = x[0];
    for (double s : {0.0, 0.3, 0.7}) {
      const double middle = t + s * (end - t);
      integrator->interpolate(middle, x);
      EXPECT_NEAR(x[0], std::cos(middle), 2e-8);
      integrator->integrals(middle, &y);
      EXPECT_NEAR(y, std::sin(middle), 2e-8);
    }
    integrator->interpolate(end, x);
    EXPECT_NEAR(x[0], at_end, 1e-15);
    t = end;
  }
}

/// x'' = u with u = +1, then -1: rest to rest over 1 m. Polynomials: all methods are exact but for their start.
TEST_P(EveryMethod, BangBangEndsAtRest) {
  double u = 1.0;
  auto integrator = make(problem(2, [&](double, const double* x, double* xdot) {
    xdot[0] = x[1];
    xdot[1] = u;
    return true;
  }));
  const Values middle = integrate(*integrator, 0.0, {0.0, 0.0}, 1.0);
  u = -1.0;
  const Values end = integrate(*integrator, 1.0, middle, 2.0);
  EXPECT_NEAR(end[0], 1.0, 1e-9);
  EXPECT_NEAR(end[1], 0.0, 1e-9);
  EXPECT_EQ(integrator->statistics().restarts, 2);
}

TEST_P(EveryMethod, RepeatsEveryBit) {
  const auto run = [](Integrator& integrator) {
    Values trace, x = {1.0, 0.0};
    integrator.restart(0.0, x.data());
    for (double t = 0.0; t < 3.0;) {
      t = integrator.step(3.0, x.data()).t;
      trace.insert(trace.end(), {t, x[0], x[1]});
    }
    return trace;
  };
  auto one = make(oscillator()), two = make(oscillator());
  const Values first = run(*one);
  EXPECT_EQ(first, run(*two));
  EXPECT_EQ(first, run(*one));  // nothing of the first run is left after restart
}

TEST_P(EveryMethod, ReturnsTheProjectedState) {
  OdeProblem p = oscillator();  // x, v on the unit circle
  p.project = [](double, double* x) {
    const double r = std::hypot(x[0], x[1]);
    x[0] /= r;
    x[1] /= r;
  };
  auto integrator = make_by(p, GetParam() == "rk4" ? rk4(0.1) : adaptive(GetParam(), 1e-4));
  double x[2] = {1.0, 0.0}, t = 0.0;
  integrator->restart(0.0, x);
  while (t < 5.0) {
    const double begin = t;
    t = integrator->step(5.0, x).t;
    EXPECT_NEAR(std::hypot(x[0], x[1]), 1.0, 4e-16);
    integrator->interpolate(0.5 * (begin + t), x);
    EXPECT_NEAR(std::hypot(x[0], x[1]), 1.0, 4e-16);
  }
}

/// No state, no error control: the largest step alone decides.
TEST_P(EveryMethod, RunsWithIntegralsAlone) {
  OdeProblem p = problem(0, [](double, const double*, double*) { return true; });
  p.integrands = [](double t, const double*, double* ydot) { ydot[0] = 3.0 * t * t; };
  p.n_quadrature = 1;
  IntegratorOptions o = accurate(GetParam());
  if (GetParam() != "rk4") o.max_step = 1e-3;
  auto integrator = make_by(p, o);
  EXPECT_NEAR(integrate(*integrator, 0.0, {}, 2.0, 1)[0], 8.0, 1e-12);  // a polynomial: exact
}

RunFailure failure_of(Integrator& integrator, Values x, double t_end) {
  try {
    integrate(integrator, 0.0, std::move(x), t_end);
  } catch (const NumericsError& e) {
    return e.failure();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

bool is_integration_failure(const RunFailure& f) { return f.code == Code::step_too_small || f.code == Code::integrator_failed; }

TEST_P(EveryMethod, NanEndsTheRunAndNamesTheState) {
  for (double t_bad : {-1.0, 0.5}) {  // from the start; on the way
    OdeProblem p = oscillator();
    p.rhs = [t_bad](double t, const double* x, double* xdot) {
      xdot[0] = x[1];
      xdot[1] = t > t_bad ? std::numeric_limits<double>::quiet_NaN() : -x[0];
      return true;
    };
    auto integrator = make(p);
    const RunFailure f = failure_of(*integrator, {1.0, 0.0}, 2.0);
    EXPECT_TRUE(is_integration_failure(f));
    EXPECT_NE(f.what.find("the rate of state 1 is nan"), std::string::npos) << f.what;
    EXPECT_NEAR(f.t, std::max(t_bad, 0.0), 3e-3);
  }
}

TEST_P(EveryMethod, RefusedStatesEndTheRun) {
  OdeProblem p = problem(1, [](double, const double* x, double* xdot) {
    xdot[0] = 1.0;
    return x[0] <= 0.5;
  });
  auto integrator = make(p);
  const RunFailure f = failure_of(*integrator, {0.0}, 2.0);
  EXPECT_TRUE(is_integration_failure(f));
  EXPECT_NE(f.what.find("the right-hand side cannot be evaluated"), std::string::npos) << f.what;
  EXPECT_NEAR(f.t, 0.5, 3e-3);
}

/// x' = x^2 is infinite at t = 1.
TEST_P(EveryMethod, ASingularityEndsTheRun) {
  OdeProblem p = problem(1, [](double, const double* x, double* xdot) {
    xdot[0] = x[0] * x[0];
    return true;
  });
  auto integrator = make(p);
  const RunFailure f = failure_of(*integrator, {1.0}, 2.0);
  EXPECT_TRUE(is_integration_failure(f)) << f.what;
  EXPECT_NEAR(f.t, 1.0, 1e-2);
}

TEST_P(EveryMethod, WhatTheRightHandSideThrowsArrives) {
  OdeProblem p = problem(1, [](double t, const double*, double* xdot) {
    if (t > 0.5) throw std::domain_error("hinge inertia is singular");
    xdot[0] = 1.0;
    return true;
  });
  auto integrator = make(p);
  try {
    integrate(*integrator, 0.0, {0.0}, 2.0);
    FAIL() << "nothing was thrown";
  } catch (const std::domain_error& e) {
    EXPECT_STREQ(e.what(), "hinge inertia is singular");
  }
}

/// x' = -1e4 (x - cos t), once it follows cos t: the steps of explicit methods are those of their stability.
TEST_P(EveryMethod, ExplicitMethodsTellWhenStabilitySetsTheirSteps) {
  const auto told = [&](double rate) {
    auto integrator = make_by(problem(
                                  1,
                                  [rate](double t, const double* x, double* xdot) {
                                    xdot[0] = -rate * (x[0] - std::cos(t));
                                    return true;
                                  },
                                  1e-6),
                              GetParam() == "rk4" ? rk4(1e-4) : adaptive(GetParam(), 1e-6));
    double x = 1.0;
    bool stiff = false;
    integrator->restart(0.0, &x);
    for (double t = 0.0; t < 3.0;) {
      const StepReport report = integrator->step(3.0, &x);
      t = report.t, stiff = stiff || report.stiff;
    }
    return stiff;
  };
  // Of `exponential` and `multirate` it is their linear part that decays.
  EXPECT_EQ(told(1e4),
            !GetParam().starts_with("ark_im") && GetParam() != "rk4" && GetParam() != "cvode_bdf" && !advances_linear_part(GetParam()));
  EXPECT_FALSE(told(1.0));
}

INSTANTIATE_TEST_SUITE_P(, EveryMethod,
                         testing::Values("ark_explicit", "ark_imex", "ark_implicit", "cvode_adams", "cvode_bdf", "dop853", "dopri5",
                                         "exponential", "multirate", "rk4"),
                         parameter_name);

}  // namespace
}  // namespace cardan::test
