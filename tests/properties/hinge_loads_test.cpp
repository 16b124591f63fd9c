// Stops and friction on hinges: published and closed-form values, and what every analysis makes of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "bodies/modal/lumped.hpp"
#include "core/base/diagnostic.hpp"
#include "core/base/impact.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/operators/linear_model.hpp"
#include "core/reference/dense_dynamics.hpp"
#include "core/sim/fastest_motion.hpp"
#include "core/sim/newton_operators.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/trees.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

/// A mass on a slide, at x moving at v.
SystemSpec slide(double mass, double x, double v, std::vector<HingeLoadSpec> loads, std::vector<SpringDamper> springs = {}) {
  BodySpec b = on(particle("m", mass, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  b.hinge.q = {x}, b.hinge.v = {v};
  b.hinge.loads = std::move(loads);
  b.hinge.springs = std::move(springs);
  return system({b});
}

/// k d^n/m without dissipation: the deepest point has (m v^2 / 2) = k d^(n+1) / (n+1), and the mass leaves as fast as it came.
TEST(Stop, WithoutDissipationGivesBackAllItTook) {
  const double m = 2.0, v = 0.7, k = 5e4, n = 1.5;
  Simulation sim(compiled(slide(m, 0.0, v, {{0, HingeLaw::stop, {-kNever, 0.01, k, n, 0.0}, {}}})), accurate());
  double deepest = 0.0;
  sim.add_event(
      {"turns", [](double, const double*, const double* rate) { return rate[0]; }, 0, [&] { deepest = sim.state().q[0] - 0.01; }});
  sim.run(0.2);
  EXPECT_NEAR(deepest, std::pow(0.5 * m * v * v * (n + 1.0) / k, 1.0 / (n + 1.0)), 1e-9);
  EXPECT_NEAR(sim.state().v[0], -v, 1e-9);
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().linear_relative << " of " << sim.ledger().linear_limit << ", "
                                 << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
}

HingeLoadSpec hard_stop(double lower, double upper, double stiffness, double restitution, double speed) {
  const double a = dissipation_times_speed(std::max(restitution, 0.05)) / speed;
  return {0, HingeLaw::stop, {lower, upper, stiffness, 1.0, a}, {}, {restitution, speed}};
}

/// Each limit takes e of the rate, in no time: after three of them at x = 0.1, -0.1, 0.1 the place is that of four straight ways.
TEST(HardStop, BouncesAtOnce) {
  const double v = 0.5, e = 0.6, width = 0.1;
  Simulation sim(compiled(slide(2.0, 0.0, v, {hard_stop(-width, width, 1e5, e, 0.01)})), accurate());
  const double t = width / v * (1.0 + 2.0 / e + 2.0 / (e * e)) + 0.05;
  sim.run(t);
  EXPECT_NEAR(sim.state().v[0], -v * e * e * e, 1e-14);
  EXPECT_NEAR(sim.state().q[0], width - v * e * e * e * 0.05, 1e-11);
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  EXPECT_NEAR(sim.energy().kinetic, v * v * std::pow(e, 6), 1e-14);
}

/// Two bodies that float, an arm about the mass centres of both: the rate between them turns over by e, what is lost is that of the reduced
/// inertia, momentum stays. Off the mass centres momentum stays as well.
TEST(HardStop, KeepsMomentumOfWhatFloats) {
  const double J_bus = 3.0, J_arm = 0.7, e = 0.35, w = 0.8;
  for (const double off : {0.0, 0.4}) {
    BodySpec bus = on(rigid("bus", 10.0, {0, 0, 0}, diagonal({2, 2, J_bus})), "", "free");
    bus.hinge.v = {0, 0, 0.2, 0.1, 0, 0};
    BodySpec arm = on(rigid("arm", 2.0, {off, 0, 0}, diagonal({0.5, 0.6, J_arm})), "bus", "revolute", {{0, 0, 1}});
    arm.hinge.v = {w};
    arm.hinge.loads = {hard_stop(-kNever, 0.3, 1e4, e, 0.05)};
    Simulation sim(compiled(system({bus, arm})), accurate());
    const Momentum before = sim.momentum();
    const double energy = sim.energy().total();
    double at = 0.0;
    sim.add_event({"near", [](double, const double* q, const double*) { return q[7] - 0.299; }, +1, [&] { at = sim.state().v[6]; }});
    sim.run(0.5);
    const Momentum after = sim.momentum();
    EXPECT_LT((after.linear - before.linear).norm(), 1e-12);  // of the steps
    EXPECT_LT((after.angular - before.angular).norm(), 1e-11);
    EXPECT_TRUE(sim.ledger().pass);
    EXPECT_LT(sim.state().v[6], 0.0);
    if (off != 0.0) continue;
    EXPECT_NEAR(at, w, 1e-12);
    EXPECT_NEAR(sim.state().v[6], -e * w, 1e-12);
    EXPECT_NEAR(energy - sim.energy().total(), 0.5 * (1.0 - e * e) * w * w * J_bus * J_arm / (J_bus + J_arm), 1e-12);
  }
}

/// In orbit as well: the balances see the blow, and nothing of how its size was found.
TEST(HardStop, KeepsMomentumInOrbit) {
  BodySpec bus = on(rigid("bus", 10.0, {0, 0, 0}, diagonal({2, 2, 3})), "", "free");
  bus.hinge.q = {1, 0, 0, 0, 7e6, 0, 0}, bus.hinge.v = {0, 0, 0.2, 0, 7546, 0};
  BodySpec arm = on(rigid("arm", 2.0, {0.4, 0, 0}, diagonal({0.1, 0.2, 0.2})), "bus", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
  arm.hinge.v = {0.5}, arm.hinge.loads = {hard_stop(-kNever, 0.3, 1e4, 0.6, 0.05)};
  Simulation sim(compiled(system({bus, arm}, central_gravity(3.986e14, true))), accurate("dop853", 1e-12));
  sim.run(1.0);
  EXPECT_LT(sim.state().v[6], 0.0);
  const LedgerState ledger = sim.ledger();
  EXPECT_TRUE(ledger.pass) << ledger.linear_relative << ", " << ledger.angular_relative << ", " << ledger.energy_relative;
}

/// Where a gear couples two hinges, both turn over: what the stop meets is J_1 + n^2 J_2.
TEST(HardStop, MeetsAllThatAGearCouples) {
  const double J_1 = 1.0, J_2 = 4.0, n = 2.0, e = 0.5;
  BodySpec a = on(rigid("a", 1.0, {0, 0, 0}, diagonal({J_1, J_1, J_1})), "", "revolute", {{0, 0, 1}});
  BodySpec b = on(rigid("b", 1.0, {0, 0, 0}, diagonal({J_2, J_2, J_2})), "", "revolute", {{0, 0, 1}});
  a.hinge.v = {1.0}, b.hinge.v = {n};
  a.hinge.loads = {hard_stop(-kNever, 1.0, 100.0, e, 0.1)};
  SystemSpec spec = system({a, b});
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.terms = {{"a", n, {}}, {"b", -1.0, {}}}, gear.offset = 0.0;
  spec.loops = {gear};
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    spec.loop_form = form;
    Simulation sim(compiled(spec), accurate());
    const double energy = sim.energy().total();
    sim.run(1.5);
    EXPECT_NEAR(sim.state().v[0], -e, 1e-12);
    EXPECT_NEAR(sim.state().v[1], -e * n, 1e-12);
    EXPECT_NEAR(energy - sim.energy().total(), 0.5 * (1.0 - e * e) * (J_1 + n * n * J_2), 1e-12);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// A mass that falls on a stop bounces less each time, v = sqrt(2 g h) e^k, and comes to rest m g / k deep; without restitution at once.
TEST(HardStop, LetsWhatFallsComeToRest) {
  const double m = 2.0, g = 9.81, h = 0.05, k = 2e5;
  for (const double e : {0.5, 0.0}) {
    BodySpec b = on(particle("m", m, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
    b.hinge.q = {h};
    b.hinge.loads = {hard_stop(0.0, kNever, k, e, 0.02)};
    Simulation sim(compiled(system({b}, uniform_gravity({0, 0, -g}))), accurate());
    const double first = std::sqrt(2.0 * h / g);
    sim.run(first * 1.01);
    EXPECT_NEAR(sim.state().v[0], e > 0.0 ? e * std::sqrt(2.0 * g * h) - g * 0.01 * first : 0.0,
                e > 0.0 ? 1e-11 : 0.035);  // g sqrt(m / k) at most where it sinks in
    sim.run(3.0);
    EXPECT_NEAR(sim.state().q[0], -m * g / k, 1e-7);  // it still swings a little: losses of a slow motion are small
    EXPECT_LT(std::abs(sim.state().v[0]), 1e-4);
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  }
}

/// A mass that has sunk into a stop comes off it, and is thrown at it from elsewhere in that instant: it is not at the stop there.
TEST(HardStop, DoesNotStrikeWhatAnEventHasMovedAway) {
  Simulation sim(compiled(slide(2.0, -1e-4, 0.005, {hard_stop(-kNever, 0.0, 1e4, 0.5, 0.01)})), accurate());
  double moved = -1.0;
  sim.add_event({"leaves", [](double, const double* q, const double*) { return q[0]; }, -1,
                 [&] {
                   sim.q(0) = -1.0, sim.v(0) = 5.0;
                   moved = sim.time();
                 }});
  sim.run(0.1);
  ASSERT_GT(moved, 0.0);
  EXPECT_EQ(sim.state().v[0], 5.0);
  EXPECT_NEAR(sim.state().q[0], -1.0 + 5.0 * (0.1 - moved), 1e-12);
}

/// Two of different rates on a cart, of which one is 5e-12 m behind when the other strikes: rounding of places, and no blow after the
/// other, which would leave it 0.05 m/s in place of 0.8. It comes 6e-12 s later, beyond what is one event in steps of 0.1 s.
TEST(HardStop, WhatIsBehindByRoundingIsTurnedOverWithWhatStrikes) {
  std::vector<BodySpec> all = {on(particle("cart", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})};
  for (const auto& [name, rate, behind] : {std::tuple("a", 1.0, 0.0), {"b", 0.8, 5e-12}}) {
    BodySpec b = on(particle(name, 1.0, {0, 0, 0}), "cart", "prismatic", {{1, 0, 0}});
    b.hinge.q = {-0.1 * rate - behind}, b.hinge.v = {rate};
    b.hinge.loads = {hard_stop(-kNever, 0.0, 1e5, 0.5, 0.001)};
    all.push_back(b);
  }
  Simulation sim(compiled(system(all)), accurate());
  sim.run(0.11);
  EXPECT_NEAR(sim.state().v[1], -0.5, 1e-12);
  EXPECT_NEAR(sim.state().v[2], -0.4, 1e-12);
}

/// Two wings of a free hub that come to their stops in one instant: both leave with e of their rates, in whatever order they are
/// described, and alike ones do not turn the hub.
TEST(HardStop, WhatStrikesInOneInstantIsTurnedOverTogether) {
  const double e = 0.5, rate = 0.3;
  for (const double other : {10.0, 17.0})
    for (const bool in_flight : {false, true}) {
      if (in_flight && other != 10.0) continue;  // the hub's own motion brings them there one after the other
      const auto wing = [&](const char* name, double mass, double side) {
        BodySpec b =
            on(rigid(name, mass, {0, side, 0}, mass * diagonal({0.3, 0.01, 0.3})), "hub", "revolute", {{side, 0, 0}}, {0, 0.5 * side, 0});
        b.hinge.q = {in_flight ? -0.3 : 0.0}, b.hinge.v = {rate};
        b.hinge.loads = {hard_stop(-kNever, 0.0, 1e5, e, 0.001)};
        return b;
      };
      const BodySpec hub = on(rigid("hub", 100.0, {0, 0, 0}, diagonal({20, 20, 20})), "", "free");
      for (const bool turned : {false, true}) {
        const BodySpec left = wing("left", 10.0, 1.0), right = wing("right", other, -1.0);
        Simulation sim(compiled(turned ? system({hub, right, left}) : system({hub, left, right})), accurate());
        const double before = sim.energy().total();
        sim.run(in_flight ? 1.1 : 1e-9);
        const Eigen::VectorXd& v = sim.state().v;
        EXPECT_TRUE(sim.ledger().pass);
        if (in_flight) {
          EXPECT_LT(v[6], -0.9 * e * rate);
          EXPECT_NEAR(v[6], v[7], 1e-12);
          EXPECT_NEAR(v.head<3>().norm(), 0.0, 1e-12);
        } else {
          EXPECT_NEAR(v[6], -e * rate, 1e-9);
          EXPECT_NEAR(v[7], -e * rate, 1e-9);
          EXPECT_LT(sim.energy().total(), before);
        }
      }
    }
}

/// Wings that rounding (here 1e-12 rad) or the error of the steps (1e-10 rad at 1e-9) has moved apart come to their stops one after the
/// other, and are turned over together all the same: the first blow would turn the hub, and the second would not turn it back.
TEST(HardStop, WhatRoundingKeepsFromTheSameInstantIsTurnedOverTogether) {
  const double e = 0.5, rate = 0.3;
  for (const double apart : {1e-12, -1e-12, 1e-10, -1e-10}) {
    const auto wing = [&](const char* name, double side, double angle) {
      BodySpec b = on(rigid(name, 10.0, {0, side, 0}, diagonal({3, 0.1, 3})), "hub", "revolute", {{side, 0, 0}}, {0, 0.5 * side, 0});
      b.hinge.q = {angle}, b.hinge.v = {rate};
      b.hinge.loads = {hard_stop(-kNever, 0.0, 1e5, e, 0.001)};
      return b;
    };
    const BodySpec hub = on(rigid("hub", 100.0, {0, 0, 0}, diagonal({20, 20, 20})), "", "free");
    Simulation sim(compiled(system({hub, wing("left", 1.0, -0.03), wing("right", -1.0, -0.03 - apart)})),
                   accurate("dopri5", std::abs(apart) < 1e-11 ? 1e-12 : 1e-9));
    sim.run(0.2);
    const Eigen::VectorXd& v = sim.state().v;
    EXPECT_TRUE(sim.ledger().pass);
    EXPECT_LT(v[6], -0.9 * e * rate);
    EXPECT_NEAR(v[6], v[7], 10.0 * std::abs(apart));
    EXPECT_NEAR(v.head<3>().norm(), 0.0, 10.0 * std::abs(apart));
  }
}

/// What rises from its stop by less than the error of a multistep method falls back and presses into it: their first steps went through the
/// stop at once with a rate away from it, and each time began anew.
TEST(HardStop, WhatRisesByLessThanTheErrorOfTheStepsFallsBackOnce) {
  for (const char* method : {"cvode_bdf", "cvode_adams"})
    for (double e = 0.03; e < 0.3; e += 0.01) {
      BodySpec ball = on(particle("ball", 1.0, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
      ball.hinge.q = {0.2}, ball.hinge.loads = {hard_stop(0.0, kNever, 700.0, e, 2e-4)};
      SystemSpec spec = system({ball});
      spec.gravity = uniform_gravity({0, 0, -26.0});
      Simulation sim(compiled(spec), accurate(method, 1e-9));
      sim.run(0.3);
      EXPECT_LT(sim.statistics().restarts, 50) << method << " " << e;
    }
}

/// A heavy ball that touches a light one at a wall turns back after pi sqrt(m_2 / m_1) blows without loss [Galperin 2003], all at once: it
/// is told where they are cut off.
TEST(HardStop, TellsWhereBlowsOfOneInstantAreCutOff) {
  for (const double heavy : {1e4, 1e8}) {
    BodySpec light = on(particle("light", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
    light.hinge.loads = {hard_stop(0.0, kNever, 1e6, 1.0, 1e-6)};
    BodySpec ball = on(particle("heavy", heavy, {0, 0, 0}), "light", "prismatic", {{1, 0, 0}});
    ball.hinge.v = {-1.0}, ball.hinge.loads = {hard_stop(0.0, kNever, 1e6, 1.0, 1e-6)};
    Simulation sim(compiled(system({light, ball})), accurate());
    sim.run(1e-9);
    const auto& told = sim.warnings().all();
    if (heavy == 1e4) {  // 314 blows
      EXPECT_TRUE(told.empty());
      EXPECT_NEAR(sim.state().v[0] + sim.state().v[1], 1.0, 2e-4);
    } else {
      ASSERT_EQ(told.size(), 1u);
      EXPECT_EQ(told[0].what.code, Code::beyond_the_model);
      EXPECT_NE(told[0].what.about.find("1000 blows in one instant"), std::string::npos) << told[0].what.about;
    }
    EXPECT_NEAR(sim.energy().total(), 0.5 * heavy, 1e-9 * heavy);
  }
}

/// Bodies on a line that touch: `relative` is the rate of each against the one before it, and so are stops of restitution e.
Simulation row_of_balls(const std::vector<double>& masses, const std::vector<double>& relative, double e, double gap_behind_first) {
  std::vector<BodySpec> balls;
  for (std::size_t i = 0; i < masses.size(); ++i) {
    BodySpec b = on(particle(fmt::format("ball_{}", i), masses[i], {0, 0, 0}), i == 0 ? "" : balls.back().name, "prismatic", {{1, 0, 0}});
    b.hinge.q = {i == 1 ? gap_behind_first : 0.0}, b.hinge.v = {relative[i]};
    if (i > 0) b.hinge.loads = {hard_stop(0.0, kNever, 1e6, e, 1e-6)};
    balls.push_back(b);
  }
  return {compiled(system(balls)), accurate()};
}

/// What moves into a stop turns over by e whatever forces bend the modes beside it: here a thousand million times an impulse of one unit,
/// on masses that hardly feel them. Their rounding was in the blow, 1e-7 of it.
TEST(HardStop, BouncesWhateverBendsBesideIt) {
  constexpr double e = 0.5, u = 0.3, size = 1e9;
  constexpr int modes = 5;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto numbers = [&](int rows) { return Eigen::MatrixXd::NullaryExpr(rows, modes, [&] { return number(random); }).eval(); };
  std::vector<MassNode> masses(5);
  for (MassNode& m : masses) m.mass = size, m.Phi = numbers(3);
  masses[0].Phi.setZero();
  const Eigen::MatrixXd shape = numbers(modes);
  BodySpec b;
  b.name = "b", b.type = "modal_flexible", b.level = 1;
  b.modal = std::make_shared<const ModalData>(lumped_modal_data(masses, size * shape.transpose() * shape, {}, {}));
  b.eta.assign(modes, 0.9), b.etadot.assign(modes, 0.0);
  b = on(b, "", "prismatic", {{1, 0, 0}});
  b.hinge.v = {u}, b.hinge.loads = {hard_stop(-kNever, 0.0, 1e6, e, 0.01)};
  Simulation sim(compiled(system({b})), accurate());
  sim.run(1e-13);  // the bounce, and 1e-13 of what the modes do in a second
  EXPECT_NEAR(sim.state().v[0], -e * u, 1e-11);
}

/// What moves into the stop that it stands at when the run begins comes to it as well.
TEST(HardStop, BouncesWhatStandsAtItAtTheStart) {
  for (const double e : {1.0, 0.5, 0.0}) {
    Simulation sim = row_of_balls({2.0, 1.0}, {0.3, -1.2}, e, 0.0);
    sim.run(0.1);
    EXPECT_NEAR(sim.state().v[1], 1.2 * e, 1e-14);
    EXPECT_NEAR(sim.state().v[0], 0.3 - (1.0 + e) * 1.2 / 3.0, 1e-14);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// Nothing is told of what is right: the first steps of a method of many, of low order, count each.
TEST(HardStop, WhatBouncesIsBalanced) {
  for (int k = 0; k < 12; ++k)
    for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
      SystemSpec spec = slide(0.5 + 0.2 * k, 0.0, 1.0 + 0.37 * k, {hard_stop(-kNever, 0.05 + 0.01 * k, 1e5, 0.3 + 0.05 * k, 0.05)});
      spec.gravity = uniform_gravity({-9.81, 0, 0});
      SimulationOptions o;
      o.integrator.method = method, o.integrator.relative_tolerance = 1e-8;
      Simulation sim(compiled(spec), o);
      for (const double t : {0.01, 0.03, 0.1, 1.0}) {
        sim.run(t);
        EXPECT_TRUE(sim.ledger().pass) << method << " " << k << " at " << t;
      }
    }
}

/// Newton's cradle: a blow goes through balls that touch, and the last one leaves. With losses by the same blows one after the other, by
/// hand.
TEST(HardStop, PassesABlowOn) {
  Simulation cradle = row_of_balls({1, 1, 1, 1}, {2, -2, 0, 0}, 1.0, 0.5);
  cradle.run(0.5);
  EXPECT_LT((cradle.state().v - Eigen::Vector4d(0, 0, 0, 2)).norm(), 1e-14);
  EXPECT_LT((cradle.state().q - Eigen::Vector4d(0.5, 0, 0, 0.5)).norm(), 1e-12);

  Simulation lossy = row_of_balls({1, 1, 1}, {2, -2, 0}, 0.5, 0.5);
  lossy.run(0.5);
  std::array<double, 3> v = {2, 0, 0};
  for (const std::size_t i : {0, 1, 0, 1}) {  // 0.5 | 1.5, 0.375 | 1.125, 0.40625 | 0.46875: they part
    const double u = v[i] - v[i + 1];
    if (u > 0.0) v[i] -= 0.75 * u, v[i + 1] += 0.75 * u;
  }
  EXPECT_NEAR(lossy.state().v[0], v[0], 1e-14);
  EXPECT_NEAR(lossy.state().v[0] + lossy.state().v[1], v[1], 1e-14);
  EXPECT_NEAR(lossy.state().v[0] + lossy.state().v[1] + lossy.state().v[2], v[2], 1e-14);
  EXPECT_TRUE(lossy.ledger().pass);
}

/// A step that comes to a hard stop does not feel it before it is there, so that steps need not be as short as the stiffness asks: a ball
/// that falls on one of 1e7 N/m (2e3 rad/s) bounces by methods of a given step as by any other.
TEST(HardStop, IsNotFeltBeforeItIsReached) {
  const double m = 2.0, g = 9.81, h = 2.0, e = 0.8, t = std::sqrt(2.0 * h / g), v = g * t;
  BodySpec b = on(particle("m", m, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
  b.hinge.q = {h};
  b.hinge.loads = {hard_stop(0.0, kNever, 1e7, e, 1e-3)};
  const SystemSpec spec = system({b}, uniform_gravity({0, 0, -g}));
  for (const std::string method : {"rk4", "variational4", "dopri5", "cvode_bdf", "ark_implicit"}) {
    SimulationOptions options = accurate(method, 1e-10);
    if (method == "rk4" || method == "variational4") options.integrator.fixed_step = 0.01;
    Simulation sim(compiled(spec), options);
    const double after = t + 2.0 * e * v / g;  // back on the floor
    sim.run(after + 0.1);
    const bool exact = method != "cvode_bdf";  // its orders go up from 1
    EXPECT_NEAR(sim.state().v[0], e * e * v - g * 0.1, exact ? 1e-9 : 1e-6) << method;
    EXPECT_NEAR(sim.state().q[0], e * e * v * 0.1 - 0.5 * g * 0.01, exact ? 1e-9 : 1e-6) << method;
    EXPECT_TRUE(sim.ledger().pass) << method;
  }
}

/// A ball that stands at its stop and is pressed into it by what is slower than `speed` does not bounce when another one is struck.
TEST(HardStop, LeavesWhatPressesIntoAnotherStop) {
  BodySpec a = on(particle("a", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  a.hinge.v = {0.005}, a.hinge.loads = {hard_stop(-kNever, 0.0, 100.0, 0.5, 0.01)};
  BodySpec b = on(particle("b", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  b.hinge.q = {-0.05}, b.hinge.v = {1.0}, b.hinge.loads = {hard_stop(-kNever, 0.0, 100.0, 0.5, 0.01)};
  Simulation both(compiled(system({a, b})), accurate()), alone(compiled(system({a})), accurate());
  both.run(0.1), alone.run(0.1);
  EXPECT_NEAR(both.state().v[0], alone.state().v[0], 1e-12);
  EXPECT_NEAR(both.state().v[1], -0.5, 1e-12);
}

/// What a force presses into a stop, by then faster than `speed`, is not struck where the vehicle becomes another one.
TEST(HardStop, IsNotStruckByAVehicleThatChanges) {
  const auto model = compiled(slide(2.0, 0.0, 0.005, {hard_stop(-kNever, 0.0, 100.0, 0.5, 0.01)}));
  Simulation changes(model, accurate()), goes_on(model, accurate());
  changes.set_force(0, 5.0), goes_on.set_force(0, 5.0);
  changes.every({1, 20}, [&] { changes.adopt(model); }, {1, 20});
  changes.run(0.09), goes_on.run(0.09);
  ASSERT_GT(goes_on.state().v[0], 0.01);
  EXPECT_NEAR(changes.state().v[0], goes_on.state().v[0], 1e-9);
}

TEST(Stop, ThatIsPassedAtTheStartIsTold) {
  for (const double q : {0.25, 0.3, 0.35}) {
    Simulation sim(compiled(slide(2.0, q, 0.0, {hard_stop(-kNever, 0.3, 10.0, 0.5, 0.01)})), accurate());
    sim.run(0.1);
    const auto told = std::ranges::count(sim.warnings().all(), Code::unusual_value, [](const Warning& w) { return w.what.code; });
    EXPECT_EQ(told, q > 0.3 ? 1 : 0) << q;
  }
}

/// Exponent 1, no dissipation: half a period of the spring, and the same at the lower end.
TEST(Stop, OfExponentOneIsBacklash) {
  const double m = 1.5, k = 400.0, gap = 0.05, v = 0.3, omega = std::sqrt(k / m);
  Simulation sim(compiled(slide(m, 0.0, v, {{0, HingeLaw::stop, {-gap, gap, k, 1.0, 0.0}, {}}})), accurate());
  const double period = 4.0 * gap / v + 2.0 * std::numbers::pi / omega;
  sim.run(period);
  EXPECT_NEAR(sim.state().q[0], 0.0, 1e-8);
  EXPECT_NEAR(sim.state().v[0], v, 1e-8);
}

/// Of Hunt and Crossley's law the speed after depends on that before alone: a (v_i + v_o) = ln((1 + a v_i) / (1 - a v_o)), for every k, n.
TEST(Stop, LosesWhatItsDissipationSays) {
  const double v_in = 0.4, a = 0.8;
  for (const double k : {1e4, 3e5}) {
    Simulation sim(compiled(slide(3.0, 0.0, v_in, {{0, HingeLaw::stop, {-kNever, 0.0, k, 1.5, a}, {}}})), accurate());
    sim.run(0.5);
    const double v_out = -sim.state().v[0];
    EXPECT_GT(v_out, 0.0);
    EXPECT_LT(v_out, 0.9 * v_in);
    EXPECT_NEAR(a * (v_in + v_out), std::log((1.0 + a * v_in) / (1.0 - a * v_out)), 1e-8) << k;
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().linear_relative << " of " << sim.ledger().linear_limit << ", "
                                   << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  }
}

/// Pulled by a spring whose end moves slowly away, smoothed Coulomb friction holds the mass creeping: v = w atanh(F / Fc) while F < Fc.
TEST(Friction, HoldsBelowBreakawayUpToItsWidth) {
  const double force = 0.6, coulomb = 1.0, width = 1e-3;
  Simulation sim(compiled(slide(1.0, 0.0, 0.0, {{0, HingeLaw::friction, {coulomb, coulomb, 1.0, 0.0, width}, {}}})), accurate());
  sim.set_force(0, force);
  sim.run(0.5);
  EXPECT_NEAR(sim.state().v[0], width * std::atanh(force / coulomb), 1e-9);
  sim.set_force(0, 1.5);
  sim.run(2.5);
  EXPECT_NEAR(sim.state().v[0], 2.0 * 0.5, 2e-3) << "sliding: (F - Fc) t / m";
}

TEST(Friction, KeepsItsLedgerAtTheUsualTolerance) {
  for (const std::string method : {"dopri5", "dop853", "cvode_bdf", "cvode_adams"}) {
    SimulationOptions options;
    options.integrator.method = method;
    Simulation sim(compiled(slide(1.0, 0.0, 0.0, {{0, HingeLaw::friction, {1.0, 1.3, 0.05, 0.1, 1e-3}, {}}}, {{0, 20.0, 0.3, 0.0, {}}})),
                   options);
    sim.run(3.0);
    const LedgerState l = sim.ledger();
    EXPECT_TRUE(l.pass) << method << ": " << l.linear_relative << " of " << l.linear_limit << ", " << l.energy_relative << " of "
                        << l.energy_limit;
  }
}

/// m v' = -Fc - c v from v_0 >> width: stops after (m / c) ln(1 + c v_0 / Fc).
TEST(Friction, BringsASlideToRest) {
  const double m = 2.0, v0 = 1.2, fc = 0.9, c = 0.5;
  Simulation sim(compiled(slide(m, 0.0, v0, {{0, HingeLaw::friction, {fc, fc, 1.0, c, 1e-5}, {}}})), accurate());
  const double t = m / c * std::log(1.0 + c * v0 / fc);
  sim.run(0.9 * t);
  EXPECT_NEAR(sim.state().v[0], (v0 + fc / c) * std::exp(-c * 0.9 * t / m) - fc / c, 1e-8);
}

TEST(HingeLaws, NeverGiveEnergyOfTheirOwn) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> positive(0.0, 1.0);
  for (int i = 0; i < 2000; ++i) {
    const HingeLoad stop{HingeLaw::stop, 0, 0, {-0.2, 0.3, positive(random) * 100, 1.0 + positive(random), positive(random)}};
    const double low = positive(random);
    const HingeLoad friction{
        HingeLaw::friction, 0, 0, {low, low + positive(random), 0.1 + positive(random), positive(random), 0.01 + positive(random)}};
    for (const HingeLoad& load : {stop, friction}) {
      const double q = (2.0 * positive(random) - 1.0), v = 3.0 * (2.0 * positive(random) - 1.0);
      const double lost = (hinge_laws::force(load, q, 0.0) - hinge_laws::force(load, q, v)) * v;
      EXPECT_GE(lost, 0.0);
      const double h = 1e-6;
      EXPECT_NEAR(hinge_laws::force(load, q, 0.0), -(hinge_laws::energy(load, q + h) - hinge_laws::energy(load, q - h)) / (2 * h), 1e-3);
    }
  }
}

/// Sweeps and twin have these laws by formulas of their own.
TEST(HingeLoads, AreThoseOfTheTwin) {
  for_all_trees({.bodies = 6, .flexible = 0.4, .locked = 0.2, .springs = true, .loads = true}, 1e-14, [](const RandomTree& tree) {
    const Loaded s(tree);
    const auto twin = reference::DenseTwin<double>(tree.spec).at(s.state.q, s.state.v);
    VectorXd tau = VectorXd::Zero(s.model->nv);
    hinge_laws::add_forces(*s.model, s.state.q.data(), s.state.v.data(), tau.data());
    return apart(tau, twin.hinge_force, 1.0);
  });
}

TEST(HingeLoads, AreInTheDerivativesOfTheRightHandSide) {
  const HingeLoadSpec stop{0, HingeLaw::stop, {-kNever, 0.0, 300.0, 1.5, 0.4}, {}},
      friction{0, HingeLaw::friction, {0.4, 0.7, 0.8, 0.2, 0.5}, {}};
  const double m = 2.0, q = 0.04, v = 0.3;
  const auto model = compiled(slide(m, q, v, {stop, friction}));
  const hinge_laws::Linear a = hinge_laws::linear(model->loads[0], q, v), b = hinge_laws::linear(model->loads[1], q, v);
  EXPECT_NEAR(a.stiffness, 1.5 * 300.0 * std::sqrt(q) * (1.0 + 0.4 * v), 1e-12);
  EXPECT_NEAR(a.damping, 300.0 * std::pow(q, 1.5) * 0.4, 1e-13);
  EXPECT_EQ(b.stiffness, 0.0);
  SimulationOptions options;
  options.integrator.method = "cvode_bdf", options.integrator.linear_solver = "krylov";
  Simulation sim(model, options);
  const OdeProblem ode = sim.ode();
  const double x[2] = {q, v}, d[2] = {1.0, 2.0};
  double out[2];
  ASSERT_TRUE(ode.jacobian_times(0.0, x, d, out));
  EXPECT_EQ(out[0], 2.0);
  EXPECT_NEAR(out[1], -((a.stiffness + b.stiffness) * 1.0 + (a.damping + b.damping) * 2.0) / m, 1e-12);
  // 1 - gamma J is 2 x 2 here, and the preconditioner its inverse
  const double gamma = 0.03, r[2] = {0.7, -0.2};
  double z[2];
  ASSERT_TRUE(ode.prepare(0.0, x, gamma, true));
  ASSERT_TRUE(ode.precondition(r, z));
  const double k = (a.stiffness + b.stiffness) / m, c = (a.damping + b.damping) / m;
  EXPECT_NEAR(z[0] - gamma * z[1], r[0], 1e-13);
  EXPECT_NEAR(z[1] + gamma * (k * z[0] + c * z[1]), r[1], 1e-13);
  EXPECT_NEAR(fastest_motion(model, x).rate,
              std::max(std::sqrt(1.5 * 300.0 * std::sqrt(q) / m), (0.4 * 0.0 + (0.7 / 0.5 + 0.2 + 300.0 * std::pow(q, 1.5) * 0.4)) / m),
              1e-9);
}

TEST(HingeLoads, ThatMakeNoSenseAreRefused) {
  const auto refused = [](const HingeLoadSpec& load, Code code, const char* hinge = "prismatic") {
    SystemSpec spec = slide(1.0, 0.0, 0.0, {load});
    spec.bodies[0].hinge.type = hinge;
    if (std::string_view(hinge) == "ball") {
      spec.bodies[0] = on(rigid("b", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "ball");
      spec.bodies[0].hinge.loads = {load};
    }
    try {
      compiled(spec);
    } catch (const InputError& e) {
      return e.diagnostics().at(0).code == code;
    }
    return false;
  };
  EXPECT_TRUE(refused({0, HingeLaw::stop, {0.2, 0.1, 1.0, 1.5, 0.0}, {}}, Code::out_of_range));
  EXPECT_TRUE(refused({0, HingeLaw::stop, {-kNever, kNever, 1.0, 1.5, 0.0}, {}}, Code::missing_key));
  EXPECT_TRUE(refused({0, HingeLaw::stop, {0.0, 1.0, -1.0, 1.5, 0.0}, {}}, Code::out_of_range));
  EXPECT_TRUE(refused({0, HingeLaw::stop, {0.0, 1.0, 1.0, 0.5, 0.0}, {}}, Code::out_of_range));
  EXPECT_TRUE(refused({0, HingeLaw::stop, {0.0, 1.0, 1.0, 1.5, std::nan("")}, {}}, Code::out_of_range));
  EXPECT_TRUE(refused({0, HingeLaw::friction, {1.0, 0.5, 1.0, 0.0, 0.1}, {}}, Code::out_of_range));
  EXPECT_TRUE(refused({0, HingeLaw::friction, {1.0, 1.0, 1.0, 0.0, 0.0}, {}}, Code::out_of_range));
  EXPECT_TRUE(refused({2, HingeLaw::friction, {1.0, 1.0, 1.0, 0.0, 0.1}, {}}, Code::unknown_name));
  EXPECT_TRUE(refused({0, HingeLaw::stop, {0.0, 1.0, 1.0, 1.5, 0.0}, {}}, Code::unsupported, "ball"));
}

}  // namespace
}  // namespace cardan::test
