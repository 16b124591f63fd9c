// Methods that take turns: which one steps when, and what the integrals of all of them together may be off by.
#include <utility>

#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

/// x = cos t, v = -sin t, and the integral of v^2; first by `exponential`, which has nothing linear there and is an explicit method of
/// order 3: at 1e-9 those of higher order cost a fraction of it.
std::unique_ptr<Integrator> taking_turns(std::vector<std::string> rivals, double fastest = 0.0) {
  OdeProblem p = oscillator(1e-8);
  p.n_quadrature = 1;
  p.integrands = [](double, const double* x, double* rate) { rate[0] = x[1] * x[1]; };
  IntegratorOptions o = adaptive("exponential", 1e-9);
  o.rivals = std::move(rivals), o.fastest = fastest;
  return make_by(std::move(p), o);
}

struct Stay {
  std::string method;
  long steps = 0, calls = 0;
};
/// The first ones of a run to t_end; `told`: methods that steps said go on.
std::vector<Stay> stays(Integrator& integrator, std::size_t number, std::vector<std::string>& told) {
  Values x = {1.0, 0.0};
  integrator.restart(0.0, x.data());
  std::vector<Stay> all = {{std::string(integrator.name())}};
  for (long calls = 0;;) {
    const StepReport report = integrator.step(1e9, x.data());
    if (integrator.name() != all.back().method) {
      if (all.size() == number) return all;
      all.push_back({std::string(integrator.name())});
    }
    const long now = integrator.statistics().rhs_calls;
    ++all.back().steps, all.back().calls += now - std::exchange(calls, now);
    if (!report.goes_on.empty()) told.emplace_back(report.goes_on);
  }
}

/// Two hundred steps, as much of each rival, ten times as much of what cost least; then anew, for twice as long
/// (docs/mathematics/integration.md, "Which method").
TEST(Alternating, GoesOnByWhatCostLeastForTwiceAsLongEachTime) {
  std::vector<std::string> told;
  const auto all = stays(*taking_turns({"dopri5"}), 6, told);
  const double evaluation = 3.3;  // of `exponential`, over that of an explicit method
  for (std::size_t i = 0; i < 6; i += 2) {
    EXPECT_EQ(all[i].method, "exponential");
    EXPECT_EQ(all[i].steps, 200);
    EXPECT_EQ(all[i + 1].method, "dopri5");
    const double budget = evaluation * static_cast<double>(all[i].calls), trial = 1.0,
                 stretch = 10.0 * std::exp2(0.5 * static_cast<double>(i));
    EXPECT_NEAR(static_cast<double>(all[i + 1].calls) / budget, trial + stretch, 0.02) << i;
  }
  EXPECT_EQ(told, std::vector<std::string>{"dopri5"});
}

TEST(Alternating, TriesAllRivalsInTurn) {
  std::vector<std::string> told;
  const auto all = stays(*taking_turns({"dop853", "multirate", "dopri5"}), 5, told);
  std::vector<std::string> methods;
  for (const Stay& stay : all) methods.push_back(stay.method);
  EXPECT_EQ(methods, (std::vector<std::string>{"exponential", "dop853", "multirate", "dopri5", "dop853"}));
  EXPECT_EQ(told, std::vector<std::string>{"dop853"});
}

/// An explicit method follows what is fastest, or is not stable: where a step is many times that, none is tried.
TEST(Alternating, TriesNoExplicitOneBesideStepsThatAreFarLonger) {
  std::vector<std::string> told, methods;
  for (const Stay& stay : stays(*taking_turns({"dop853", "multirate"}, 1e6), 4, told)) methods.push_back(stay.method);
  EXPECT_EQ(methods, (std::vector<std::string>{"exponential", "multirate", "exponential", "multirate"}));
}

/// Where ticks set its steps no rival has anything to gain.
TEST(Alternating, TriesNoneWhereTicksSetTheSteps) {
  const auto both = taking_turns({"dopri5"});
  Values x = {1.0, 0.0};
  both->restart(0.0, x.data());
  double t = 0.0;
  for (int tick = 1; tick <= 2000; ++tick)
    while (t < 1e-3 * tick) {
      t = both->step(1e-3 * tick, x.data()).t;
      ASSERT_EQ(both->name(), "exponential") << t;
    }
}

/// As integrals add up so does what they may be off by: none of it goes when the method does, and it is no less than what is seen.
TEST(Alternating, KeepsWhatIntegralsMayBeOffBy) {
  Values x = {1.0, 0.0};
  const auto both = taking_turns({"dopri5"});
  both->restart(0.0, x.data());
  double error = 0.0, of_those_before = 0.0;
  int others = 0;
  for (double t = 0.0; others < 4;) {
    const std::string was(both->name());
    t = both->step(1e9, x.data()).t;
    if (was != both->name()) ++others, of_those_before = error;
    double y = 0.0;
    both->integrals(t, &y, &error);
    ASSERT_GE(error, of_those_before) << t;
    const double of_state = 1.1e-8 * (1.0 + 0.5 * t * t);  // of an amplitude that is off by a tolerance more after each radian
    ASSERT_LT(std::abs(y - (0.5 * t - 0.25 * std::sin(2.0 * t))), error + of_state) << t;
  }
}

}  // namespace
}  // namespace cardan::test
