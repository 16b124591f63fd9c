// Methods that take turns: which one steps when, and what the integrals of all of them together may be off by.
#include <utility>

#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

/// x = cos t, v = -sin t, and the integral of v^2; by `exponential` in steps of some 0.01 s as long as they are not too short.
std::unique_ptr<Integrator> taking_turns(double give_way_below) {
  OdeProblem p = oscillator(1e-8);
  p.n_quadrature = 1;
  p.integrands = [](double, const double* x, double* rate) { rate[0] = x[1] * x[1]; };
  IntegratorOptions o = adaptive("exponential", 1e-9);
  o.give_way_below = give_way_below, o.give_way_to = "dopri5";
  return make_by(std::move(p), o);
}

/// Two hundred steps that are too short, 2000 of the other one, two hundred, 4000 (docs/mathematics/integration.md, "Which method").
TEST(Alternating, GivesWayForTwiceAsManyStepsEachTime) {
  Values x = {1.0, 0.0};
  const auto alone = taking_turns(1e-9);
  alone->restart(0.0, x.data());
  double t = 0.0;
  for (int i = 0; i < 1000; ++i) t = alone->step(1e9, x.data()).t;
  ASSERT_EQ(alone->name(), "exponential") << "its steps are long enough";
  const double length = t / 1000.0;

  x = {1.0, 0.0};
  const auto both = taking_turns(1.5 * length);
  both->restart(0.0, x.data());
  std::vector<long> turns;
  for (long steps = 0; turns.size() < 6; ++steps) {
    t = both->step(1e9, x.data()).t;
    if ((both->name() == "dopri5") != (turns.size() % 2 == 1)) turns.push_back(std::exchange(steps, 0));
    ASSERT_LT(t, 1e5);
  }
  EXPECT_EQ(turns, (std::vector<long>{200, 2000, 200, 4000, 200, 8000}));
}

/// As integrals add up so does what they may be off by: none of it goes when the method does, and it is no less than what is seen.
TEST(Alternating, KeepsWhatIntegralsMayBeOffBy) {
  Values x = {1.0, 0.0};
  const auto both = taking_turns(1.0);
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
    const double of_state = 1e-6 * (1.0 + t);  // a hundred tolerances in each radian
    ASSERT_LT(std::abs(y - (0.5 * t - 0.25 * std::sin(2.0 * t))), error + of_state) << t;
  }
}

}  // namespace
}  // namespace cardan::test
