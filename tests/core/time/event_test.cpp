#include <array>
#include <limits>
#include <numbers>

#include "core/time/event_finder.hpp"
#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

constexpr double kPi = std::numbers::pi;

class EveryMethodEvents : public EveryMethod {
 protected:
  struct Event {
    double t;
    std::vector<int> crossed;
  };

  /// Runs without restart and notes what is reported.
  static std::vector<Event> events(Integrator& integrator, Values x, double t_end) {
    std::vector<Event> found;
    integrator.restart(0.0, x.data());
    for (double t = 0.0; t < t_end;) {
      const StepReport report = integrator.step(t_end, x.data());
      EXPECT_GE(report.t, t);
      t = report.t;
      if (report.event) found.push_back({t, {report.crossed.begin(), report.crossed.end()}});
    }
    return found;
  }

  static OdeProblem with_roots(OdeProblem p, int n, std::function<void(double, const double*, double*)> roots) {
    p.n_roots = n;
    p.roots = std::move(roots);
    return p;
  }
};

TEST_P(EveryMethodEvents, CrossingsHaveTimeAndDirection) {
  auto integrator = make(with_roots(oscillator(), 1, [](double, const double* x, double* g) { g[0] = x[0]; }));
  const auto found = events(*integrator, {1.0, 0.0}, 10.0);
  ASSERT_EQ(found.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(found[k].t, (k + 0.5) * kPi, 1e-8);  // the accuracy of the solution
    EXPECT_EQ(found[k].crossed, std::vector<int>{k % 2 == 0 ? -1 : 1});
  }
}

TEST_P(EveryMethodEvents, AFunctionOfTimeIsLocatedToTwelveDigits) {
  auto integrator = make(with_roots(oscillator(), 1, [](double t, const double*, double* g) { g[0] = std::cos(t * t) - 0.3; }));
  const auto found = events(*integrator, {1.0, 0.0}, 2.0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].t, std::sqrt(std::acos(0.3)), 1e-12);
}

/// Steps of 0.5 s: five crossings in one, of which two belong to the same function in later steps only.
TEST_P(EveryMethodEvents, SeveralInOneStepComeInOrder) {
  IntegratorOptions o = GetParam() == "rk4" ? rk4(0.5) : adaptive(GetParam(), 1e-9);
  const Values levels = {0.12, -0.05, 0.10, 0.02};
  auto integrator = make_by(with_roots(oscillator(), 5,
                                       [&](double t, const double* x, double* g) {
                                         for (int i = 0; i < 4; ++i) g[i] = x[0] - levels[i];
                                         g[4] = t - 1.5;
                                       }),
                            o);
  const auto found = events(*integrator, {1.0, 0.0}, 3.0);
  ASSERT_EQ(found.size(), 5u);
  const std::vector<int> order = {0, 2, 4, 3, 1};
  for (std::size_t k = 0; k < 5; ++k) {
    std::vector<int> crossed(5);
    crossed[order[k]] = order[k] == 4 ? 1 : -1;
    EXPECT_EQ(found[k].crossed, crossed) << k;
    const double exact = order[k] == 4 ? 1.5 : std::acos(levels[order[k]]);
    EXPECT_NEAR(found[k].t, exact, GetParam() == "rk4" ? 2e-3 : 1e-6);
  }
}

/// Not the interpolant but a step of its own gives the state at the event: on the surface also with a coarse step.
TEST_P(EveryMethodEvents, TheStateLiesOnTheSurface) {
  IntegratorOptions o = GetParam() == "rk4" ? rk4(0.5) : adaptive(GetParam(), 1e-6);
  auto integrator = make_by(with_roots(oscillator(), 1, [](double, const double* x, double* g) { g[0] = x[0] * x[0] * x[0] - 0.1; }), o);
  double x[2] = {1.0, 0.0};
  integrator->restart(0.0, x);
  StepReport report;
  while (!report.event) report = integrator->step(3.0, x);
  EXPECT_NEAR(x[0], std::cbrt(0.1), 1e-12);
}

/// (t - 1)^2 - depth: two crossings, or none when it stays above.
TEST_P(EveryMethodEvents, GrazingIsSeenFromBothSides) {
  const OdeProblem parabola = problem(1, [](double t, const double*, double* xdot) {
    xdot[0] = 2.0 * (t - 1.0);
    return true;
  });
  IntegratorOptions o = GetParam() == "rk4" ? rk4(7e-4) : adaptive(GetParam(), 1e-12);
  if (GetParam() != "rk4") o.max_step = 7e-4;
  const double depth = 1e-6;
  const auto surface = [](double, const double* x, double* g) { g[0] = x[0]; };
  auto integrator = make_by(with_roots(parabola, 1, surface), o);
  const auto through = events(*integrator, {1.0 - depth}, 2.0);
  ASSERT_EQ(through.size(), 2u);
  EXPECT_NEAR(through[0].t, 1.0 - 1e-3, 1e-7);  // an error of the solution counts 1/(2e-3) times
  EXPECT_NEAR(through[1].t, 1.0 + 1e-3, 1e-7);
  EXPECT_EQ(through[0].crossed[0], -1);
  EXPECT_EQ(through[1].crossed[0], 1);
  EXPECT_TRUE(events(*integrator, {1.0 + depth}, 2.0).empty());
}

/// Two crossings in one step of half a second, by a parabola, a corner and a swing; and one that does not reach zero.
TEST_P(EveryMethodEvents, ADipInsideOfAStepIsTwoCrossings) {
  IntegratorOptions o = GetParam() == "rk4" ? rk4(0.5) : adaptive(GetParam(), GetParam() == "cvode_bdf" ? 1e-6 : 1e-7);
  auto integrator = make_by(with_roots(oscillator(), 4,
                                       [](double t, const double* x, double* g) {
                                         g[0] = (t - 1.23) * (t - 1.23) - 1e-6;
                                         g[1] = 2e-3 - std::abs(t - 1.77);
                                         g[2] = 0.98 - x[0];
                                         g[3] = x[0] + 1.02;
                                       }),
                            o);
  const auto found = events(*integrator, {1.0, 0.0}, 7.0);
  struct Expected {
    double t;
    int which, direction;
  };
  const double beside = std::acos(0.98);
  const Expected expected[] = {{beside, 2, 1},
                               {1.229, 0, -1},
                               {1.231, 0, 1},
                               {1.768, 1, 1},
                               {1.772, 1, -1},
                               {2.0 * kPi - beside, 2, -1},
                               {2.0 * kPi + beside, 2, 1}};
  ASSERT_EQ(found.size(), std::size(expected));
  for (std::size_t k = 0; k < found.size(); ++k) {
    std::vector<int> crossed(4);
    crossed[expected[k].which] = expected[k].direction;
    EXPECT_EQ(found[k].crossed, crossed) << k;
    EXPECT_NEAR(found[k].t, expected[k].t, expected[k].which < 2 ? 1e-12 : GetParam() == "rk4" ? 0.1 : 1e-3) << k;
  }
}

/// A step of any length is exact where a body is thrown: its distance from a point that it passes has a corner there and a hump above it.
/// Each crossing of it, whether the method starts anew there or not.
TEST_P(EveryMethodEvents, ALongStepHasAllOfItsCrossings) {
  const double g = 9.81, up = 7.0, height = up * up / (2.0 * g);
  for (const bool anew : {false, true})
    for (const double level : {0.01, 0.1, 0.5, 1.3, 2.0, 2.4, 2.49}) {
      OdeProblem thrown = problem(2, [&](double, const double* x, double* xdot) { return xdot[0] = x[1], xdot[1] = -g, true; });
      auto integrator = make_by(with_roots(thrown, 1, [&](double, const double* x, double* out) { out[0] = std::abs(x[0]) - level; }),
                                GetParam() == "rk4" ? rk4(0.7) : adaptive(GetParam(), 1e-8));
      const double to = std::sqrt(up * up - 2.0 * g * level), below = std::sqrt(up * up + 2.0 * g * level),
                   down = std::sqrt(up * up + 2.0 * g * 3.0);
      // From 3 below the point: at -level, level, level, -level.
      const double crossings[] = {(down - below) / g, (down - to) / g, (down + to) / g, (down + below) / g};
      double x[2] = {-3.0, down}, t = 0.0;
      integrator->restart(t, x);
      std::vector<double> found;
      while (t < 5.0) {
        const StepReport report = integrator->step(5.0, x);
        t = report.t;
        if (!report.event) continue;
        found.push_back(t);
        if (anew) integrator->restart(t, x);
      }
      ASSERT_EQ(found.size(), 4u) << level << (anew ? " anew" : "");
      for (int k = 0; k < 4; ++k) EXPECT_NEAR(found[k], crossings[k], 1e-6 * height / std::min(to, 1.0)) << level << " " << k;
    }
}

/// A cubic between two ends may be zero three times, or twice where its slopes at the ends do not point inwards.
TEST_P(EveryMethodEvents, ACubicHasAllOfItsCrossings) {
  const double zeros[][3] = {{0.2, 0.45, 0.8}, {0.2, 0.55, 0.8}, {-0.05, 0.45, 0.65}, {0.1, 0.15, 1.3}, {0.3, 0.9, 0.95}};
  for (const auto& at : zeros) {
    auto integrator = make_by(with_roots(problem(1, [](double, const double*, double* xdot) { return xdot[0] = 0.0, true; }), 1,
                                         [&](double t, const double*, double* g) { g[0] = (t - at[0]) * (t - at[1]) * (t - at[2]); }),
                              GetParam() == "rk4" ? rk4(1.0) : adaptive(GetParam(), 1e-6));
    double x = 1.0, t = 0.0;
    integrator->restart(t, &x);
    std::vector<double> found;
    while (t < 1.0) {
      const StepReport report = integrator->step(1.0, &x);
      t = report.t;
      if (report.event) found.push_back(t);
    }
    std::vector<double> expected;
    for (const double zero : at)
      if (zero > 0.0 && zero < 1.0) expected.push_back(zero);
    ASSERT_EQ(found.size(), expected.size()) << at[0] << " " << at[1] << " " << at[2];
    for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-11);
  }
}

/// Each look costs a step, so few are made: of smooth functions some eight, to 1e-13 of the step. A jump takes a bisection in four at
/// least.
TEST(EventFinder, LocatesInFewLooks) {
  const auto looks = [](const std::function<double(double)>& g, double at) {
    OdeProblem p = problem(1, [](double, const double*, double* xdot) { return xdot[0] = 1.0, true; });
    p.n_roots = 1, p.roots = [&](double t, const double*, double* out) { out[0] = g(t); };
    EventFinder finder(p);
    const double x = 0.0;
    double t = 1.0;
    finder.restart(0.0, &x);
    const auto state_at = [&](double) { return &x; };
    EXPECT_TRUE(finder.find(t, state_at, state_at, [&](double, double) { return &x; }));
    EXPECT_NEAR(t, at, 1e-13);
    return finder.evaluations() - 5;  // both ends, both slopes, the event itself
  };
  const int n = 40;
  long line = 0, parabola = 0, grows = 0, sine = 0;
  for (int k = 0; k < n; ++k) {
    const double at = (k + 0.5) / n;
    line += looks([&](double t) { return 3.0 * (at - t); }, at);
    parabola += looks([&](double t) { return (t - at) * (t + 0.3); }, at);
    grows += looks([&](double t) { return std::exp(8.0 * t) - std::exp(8.0 * at); }, at);
    sine += looks([&](double t) { return std::sin(1.5 * t) - std::sin(1.5 * at); }, at);
    EXPECT_LE(looks([&](double t) { return t < at ? -1e-3 : 1.0; }, at), 3.0 * std::log2(1e13));
    EXPECT_LE(looks([&](double t) { return std::pow(t - at, 3); }, at), 3.0 * std::log2(1e13));
  }
  EXPECT_LE(line, 3 * n);
  EXPECT_LE(parabola, 9 * n);
  EXPECT_LE(grows, 12 * n);
  EXPECT_LE(sine, 8 * n);
}

/// What is zero but for rounding, or near it, has no waves to be looked for.
TEST_P(EveryMethodEvents, RoundingIsNotLookedInto) {
  for (const double beside : {0.0, 2e-15, 5e-14}) {
    auto integrator = make(with_roots(oscillator(), 1, [&](double t, const double*, double* g) {
      g[0] = std::sin(t + 0.1) - (std::sin(t) * std::cos(0.1) + std::cos(t) * std::sin(0.1)) + beside;
    }));
    double x[2] = {1.0, 0.0}, t = 0.0;
    integrator->restart(t, x);
    long events = 0;
    while (t < 20.0) {
      const StepReport report = integrator->step(20.0, x);
      t = report.t;
      events += report.event ? 1 : 0;
    }
    const IntegratorStatistics s = integrator->statistics();
    EXPECT_LT(s.root_evaluations, 20 * (s.steps + 3 * events)) << beside;
    if (beside > 1e-14) {
      EXPECT_EQ(events, 0);
    }
  }
}

/// The same where the step before had no inside: a run that was stopped a rounding later.
TEST_P(EveryMethodEvents, ADipIsSeenBehindAStepOfRounding) {
  auto integrator = make_by(with_roots(oscillator(), 1, [](double t, const double*, double* g) { g[0] = (t - 1.25) * (t - 1.25) - 1e-6; }),
                            GetParam() == "rk4" ? rk4(0.5) : adaptive(GetParam(), 1e-5));
  double x[2] = {1.0, 0.0}, t = 1.0;
  integrator->restart(t, x);
  std::vector<double> found;
  for (const double stop : {std::nextafter(1.0, 2.0), 2.0})
    while (t < stop) {
      const StepReport report = integrator->step(stop, x);
      t = report.t;
      if (report.event) found.push_back(t);
    }
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0], 1.249, 1e-12);
  EXPECT_NEAR(found[1], 1.251, 1e-12);
}

/// A step of a few units in the last place has no state inside of it, and may have an event there.
TEST_P(EveryMethodEvents, AStepOfRoundingMayHaveAnEvent) {
  constexpr double eps = std::numeric_limits<double>::epsilon();
  for (const int units : {1, 2, 3, 5, 6, 7, 8, 9, 12, 20}) {
    const double begin = 1.0, stop = begin + units * eps, at = begin + 0.5 * (units + 1) * eps;
    auto integrator = make_by(with_roots(oscillator(), 1, [&](double t, const double*, double* g) { g[0] = t - at; }),
                              GetParam() == "rk4" ? rk4(0.5) : adaptive(GetParam(), 1e-5));
    double x[2] = {1.0, 0.0}, t = begin;
    integrator->restart(t, x);
    int met = 0;
    for (const double until : {stop, 2.0})
      while (t < until) {
        const StepReport report = integrator->step(until, x);
        t = report.t;
        if (!report.event) continue;
        ++met;
        EXPECT_NEAR(t, at, 16.0 * eps) << units;
      }
    EXPECT_EQ(met, 1) << units;
    EXPECT_NEAR(x[0], std::cos(1.0), 1e-3);
  }
}

/// A body of mass 1 thrown up to a stiff spring, which it meets for 2 / w atan(v w / g): steps far longer than that before it.
TEST_P(EveryMethodEvents, AShortContactIsNotPassed) {
  const double g = 9.81, up = 5.0;
  const auto run = [&](double w, double level, const IntegratorOptions& options, double tolerance) {
    OdeProblem ball = problem(2, [&](double, const double* x, double* xdot) {
      xdot[0] = x[1];
      xdot[1] = -g - (x[0] > level ? w * w * (x[0] - level) : 0.0);
      return true;
    });
    ball.absolute_tolerance.assign(2, options.relative_tolerance);
    auto integrator = make_by(with_roots(ball, 1, [&](double, const double* x, double* out) { out[0] = x[0] - level; }), options);
    double x[2] = {0.0, up}, t = 0.0;
    integrator->restart(t, x);
    int met = 0;
    while (t < 20.0) {
      const StepReport report = integrator->step(20.0, x);
      t = report.t;
      EXPECT_TRUE(report.limit != StepLimit::error || integrator->worst() >= 0) << level << " at " << t;
      if (report.event) ++met, integrator->restart(t, x);
    }
    EXPECT_EQ(met, 2) << level;
    const double into = std::sqrt(up * up - 2.0 * g * level), back = 2.0 * (up - into) / g + 2.0 / w * std::atan(into * w / g),
                 left = 20.0 - back, down = up * left + 0.5 * g * left * left;
    EXPECT_NEAR(x[0], -down, tolerance * down) << level << " " << w;
  };
  const bool fixed = GetParam() == "rk4";
  for (const double w : fixed ? std::vector{20.0, 50.0} : std::vector{20.0, 50.0, 300.0, 3000.0})
    for (int k = 0; k < 60; ++k) {
      const double level = 1.274 - 0.674 * std::pow((k + 0.5) / 60.0, 2);  // it rises to 1.2742
      if (fixed)
        run(w, level, rk4(1e-3), 1e-6);
      else
        for (const double tolerance : {1e-5, 1e-7, 1e-9}) run(w, level, adaptive(GetParam(), tolerance), 100.0 * tolerance);
    }
}

/// One that gives back nothing of what pushes it far: of a step past it all of dopri5's stages but the second feel none of it, and that one
/// has no weight, neither in the step nor in its error.
TEST_P(EveryMethodEvents, AShortContactIsNotPassedByTheStageWithoutWeight) {
  const double g = 9.81, up = 1.5785894252515869, level = 0.11920942665876993, stiffness = 1490330.0, loss = 0.2;
  OdeProblem ball = problem(2, [&](double, const double* x, double* xdot) {
    const double depth = std::max(0.0, x[0] - level);
    xdot[0] = x[1];
    xdot[1] = -g - std::max(0.0, stiffness * std::pow(depth, 1.5) * (1.0 + loss * x[1]));
    return true;
  });
  ball.absolute_tolerance.assign(2, 1e-8);
  auto integrator = make_by(with_roots(ball, 1, [&](double, const double* x, double* out) { out[0] = x[0] - level; }),
                            GetParam() == "rk4" ? rk4(1e-4) : adaptive(GetParam(), 1e-8));
  double x[2] = {0.0, up}, t = 0.0;
  integrator->restart(t, x);
  while (t < 1.0) {
    const StepReport report = integrator->step(1.0, x);
    t = report.t;
    if (report.event) integrator->restart(t, x);
  }
  const double passes = up - g * 1.0;  // had it not been felt
  EXPECT_GT(std::abs(x[1] - passes), 0.3);
}

/// Their rates have a corner there, beyond which the step goes on: what follows it is no part of them.
TEST_P(EveryMethodEvents, IntegralsEndThereAsWell) {
  constexpr double level = 0.3;
  OdeProblem p = with_roots(oscillator(), 1, [](double, const double* x, double* g) { g[0] = x[0] - level; });
  p.n_quadrature = 1;
  p.integrands = [](double, const double* x, double* ydot) { ydot[0] = std::max(0.0, x[0] - level); };
  auto integrator = make(p);
  double x[2] = {1.0, 0.0}, y = 0.0, t = 0.0;
  integrator->restart(t, x);
  while (t < 3.0) {
    const StepReport report = integrator->step(3.0, x);
    t = report.t;
    if (report.event) integrator->restart(t, x);
  }
  integrator->integrals(t, &y);
  const double until = std::acos(level);
  EXPECT_NEAR(y, std::sin(until) - level * until, GetParam() == "multirate" ? 1e-6 : 1e-8);  // of three rates in a long step
}

/// Near them, by the state as it is known inside of the step: an event of the same function takes at least as many right-hand sides. Each
/// once, whether the method starts anew there or not; ARKODE does so by itself and chooses its first step anew, which may be lucky.
TEST_P(EveryMethodEvents, ACornerEndsAStep) {
  const auto run = [&](int corners, bool anew) {
    OdeProblem p = with_roots(oscillator(), 1, [](double, const double* x, double* g) { g[0] = x[0] - 0.3; });
    p.n_corners = corners;
    auto integrator = make(p);
    double x[2] = {1.0, 0.0}, t = 0.0;
    integrator->restart(t, x);
    std::vector<Event> found;
    while (t < 10.0) {
      const StepReport report = integrator->step(10.0, x);
      t = report.t;
      if (!report.event) continue;
      found.push_back({t, {report.crossed.begin(), report.crossed.end()}});
      if (anew) integrator->restart(t, x);
    }
    return std::pair(found, integrator->statistics().rhs_calls);
  };
  for (const bool anew : {false, true}) {
    const auto [corners, calls] = run(1, anew);
    const auto [events, calls_of_events] = run(0, anew);
    ASSERT_EQ(corners.size(), 3u) << anew;
    ASSERT_EQ(events.size(), 3u) << anew;
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(corners[k].t, events[k].t, 1e-5) << anew;
      EXPECT_EQ(corners[k].crossed, events[k].crossed) << anew;
    }
    if (!GetParam().starts_with("ark")) {
      EXPECT_LE(calls, calls_of_events) << anew;
    }
  }
}

/// A push that is away from 90 s to 110 s, and goes and comes in 0.1 s, in steps that are longer than all of that: up to a corner a step is
/// that of one which ends there, whatever the stages of the whole one met beyond.
TEST_P(EveryMethodEvents, ACornerIsReachedByAStepOfItsOwn) {
  OdeProblem p = with_roots(problem(2,
                                    [](double, const double* x, double* xdot) {
                                      xdot[0] = 1.0;
                                      xdot[1] = -std::clamp(10.0 * (std::abs(x[0] - 100.0) - 9.9), 0.0, 1.0);
                                      return true;
                                    }),
                            2, [](double, const double* x, double* g) {
                              const double off = std::abs(x[0] - 100.0);
                              g[0] = off - 10.0, g[1] = off - 9.9;
                            });
  p.n_corners = 2;
  auto integrator = make_by(p, GetParam() == "rk4" ? rk4(7.0) : adaptive(GetParam(), 1e-9));
  double x[2] = {0.0, 0.0}, t = 0.0;
  integrator->restart(t, x);
  while (t < 1000.0) {
    const StepReport report = integrator->step(1000.0, x);
    t = report.t;
    if (report.event) integrator->restart(t, x);
  }
  EXPECT_NEAR(x[1], -980.1, 1e-5);
}

TEST_P(EveryMethodEvents, RestartAtAnEventDoesNotRepeatIt) {
  auto integrator = make(with_roots(oscillator(), 1, [](double, const double* x, double* g) { g[0] = x[0]; }));
  double x[2] = {1.0, 0.0}, t = 0.0;
  std::vector<double> times;
  integrator->restart(0.0, x);
  while (t < 10.0) {
    const StepReport report = integrator->step(10.0, x);
    t = report.t;
    if (!report.event) continue;
    times.push_back(t);
    integrator->restart(t, x);
  }
  ASSERT_EQ(times.size(), 3u);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(times[k], (k + 0.5) * kPi, 1e-8);
}

/// A ball dropped from 1 m that keeps half its speed: the surface is left to the side it came from.
TEST_P(EveryMethodEvents, ABouncingBallBouncesOnTime) {
  const double gravity = 10.0, restitution = 0.5;
  OdeProblem ball = problem(2, [&](double, const double* x, double* xdot) {
    xdot[0] = x[1];
    xdot[1] = -gravity;
    return true;
  });
  auto integrator = make(with_roots(ball, 1, [](double, const double* x, double* g) { g[0] = x[0]; }));
  double x[2] = {1.0, 0.0}, t = 0.0, speed = std::sqrt(2.0 * gravity), due = speed / gravity;
  integrator->restart(0.0, x);
  int bounces = 0;
  while (bounces < 8) {
    const StepReport report = integrator->step(2.0, x);
    t = report.t;
    ASSERT_LT(t, 2.0) << "it fell through the floor";
    if (!report.event) continue;
    ++bounces;
    EXPECT_NEAR(t, due, 1e-7) << bounces;
    EXPECT_EQ(report.crossed[0], -1);
    speed *= restitution;
    due += 2.0 * speed / gravity;
    x[1] = -restitution * x[1];
    integrator->restart(t, x);
  }
}

TEST_P(EveryMethodEvents, AFunctionThatStartsAtZeroDoesNotFire) {
  auto integrator = make(with_roots(oscillator(), 1, [](double, const double* x, double* g) { g[0] = -x[1]; }));
  const auto found = events(*integrator, {1.0, 0.0}, 4.0);  // g = sin t
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].t, kPi, 1e-8);
  EXPECT_EQ(found[0].crossed[0], -1);
}

TEST_P(EveryMethodEvents, ZeroExactlyAtTheStopIsReportedThereOnce) {
  auto integrator = make(with_roots(oscillator(), 1, [](double t, const double*, double* g) { g[0] = t - 0.5; }));
  double x[2] = {1.0, 0.0}, t = 0.0;
  int count = 0;
  integrator->restart(0.0, x);
  for (double stop : {0.5, 1.0})
    while (t < stop) {
      const StepReport report = integrator->step(stop, x);
      t = report.t;
      if (!report.event) continue;
      ++count;
      EXPECT_NEAR(t, 0.5, 1e-15);
      EXPECT_EQ(report.crossed[0], 1);
    }
  EXPECT_EQ(count, 1);
}

TEST_P(EveryMethodEvents, TwinsAreOneEvent) {
  auto integrator = make(with_roots(oscillator(), 3, [](double, const double* x, double* g) {
    g[0] = x[0];
    g[1] = -3.0 * x[0] + 1e-15;  // the same surface but for round-off
    g[2] = x[0] + 5.0;           // never
  }));
  const auto found = events(*integrator, {1.0, 0.0}, 2.0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].crossed, (std::vector<int>{-1, 1, 0}));
}

TEST_P(EveryMethodEvents, NanInAnEventFunctionEndsTheRun) {
  auto integrator = make(with_roots(oscillator(), 2, [](double t, const double*, double* g) {
    g[0] = 1.0;
    g[1] = t > 0.5 ? std::numeric_limits<double>::quiet_NaN() : 1.0;
  }));
  try {
    events(*integrator, {1.0, 0.0}, 1.0);
    FAIL() << "nothing was thrown";
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::not_finite);
    EXPECT_EQ(e.failure().what, "event function 1 = nan");
  }
}

/// A long step is divided by states that lie inside of it, here before those of steps that end there. An event is where the latter have
/// passed: one reported before would be met again, for ever where a step is too short to move the state.
TEST(EventFinder, InADividedStepTheStateHasPassed) {
  OdeProblem p;
  p.n_roots = 1;
  p.roots = [](double, const double* x, double* g) { g[0] = x[0]; };
  EventFinder finder(p);
  double x = 0.0;
  const auto fall = [&](double t, double lead) { return x = 0.4101 * 0.4101 - t * t - lead, &x; };
  finder.restart(0.0, fall(0.0, 0.0));
  double t = 1.0;
  ASSERT_TRUE(finder.find(
      t, [&](double at) { return fall(at, 0.0); }, [&](double at) { return fall(at, 1e-3); },
      [&](double at, double dt) { return fall(at + dt, 0.0); }, [&](double) { return x = 1.0, &x; }));
  EXPECT_NEAR(t, 0.4101, 1e-12);
  EXPECT_LE(*fall(t, 0.0), 0.0);
}

/// A corner is located by states that are less accurate: where these have passed it, and so ends the step, though the accurate one is still
/// a little before it.
TEST(EventFinder, ACornerHasPassedWhereItWasLocated) {
  OdeProblem p;
  p.n_roots = p.n_corners = 1;
  p.roots = [](double, const double* x, double* g) { g[0] = x[0] - 0.5; };
  EventFinder finder(p);
  double x = 0.0, end = 1.0;
  const auto state_at = [&](double t) { return x = t, &x; };
  const auto near_at = [&](double t) { return x = t + 1e-4 * t * (1.0 - t), &x; };
  finder.restart(0.0, &x);
  ASSERT_TRUE(finder.find(end, state_at, near_at, [&](double t, double dt) { return state_at(t + dt); }));
  EXPECT_LT(end, 0.5);
  EXPECT_NEAR(end, 0.5, 3e-5);
  EXPECT_EQ(finder.crossed()[0], 1);
}

/// Functions of one surface, each rounded by itself, as those of places far from the origin are. Whatever is on the other side at the state
/// of an event has passed, and nothing else, where their own crossings are a little before or later: nobody would ever tell of it.
TEST(EventFinder, TheStateOfAnEventTellsWhatHasPassed) {
  for (int phase = 0; phase < 100; ++phase) {
    OdeProblem p;
    p.n_roots = 3;
    p.roots = [&](double t, const double*, double* g) {
      for (int i = 0; i < 3; ++i) g[i] = t - 0.5 + 1e-11 * std::sin((i + 1) * 1e15 * t + phase);
    };
    const double x = 0.0;
    std::array<double, 3> g{};
    EventFinder finder(p);
    finder.restart(0.0, &x);
    double t = 1.0;
    ASSERT_TRUE(finder.find(t, [&](double) { return &x; }));
    p.roots(t, &x, g.data());
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(finder.crossed()[i], g[i] >= 0.0 ? 1 : 0) << phase;
  }
}

INSTANTIATE_TEST_SUITE_P(, EveryMethodEvents,
                         testing::Values("ark_explicit", "ark_imex", "ark_implicit", "cvode_adams", "cvode_bdf", "dop853", "dopri5",
                                         "multirate", "rk4"),
                         parameter_name);

}  // namespace
}  // namespace cardan::test
