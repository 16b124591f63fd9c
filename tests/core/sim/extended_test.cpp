// Runs by the dense twin: in double (`Dynamics::dense`), and in 113 bits (the method `extended`).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/reference/dense_dynamics.hpp"
#include "core/sim/simulation.hpp"
#include "core/sim/vehicle_extended.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/four_bar.hpp"
#include "tests/support/mass_on_a_string.hpp"
#include "tests/support/modal_samples.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::VectorXd;

SimulationOptions with(const std::string& method, double relative, Dynamics dynamics = Dynamics::standard) {
  SimulationOptions o;
  o.integrator.method = method, o.integrator.relative_tolerance = relative;
  o.dynamics = dynamics;
  return o;
}

double apart(const VectorXd& a, const VectorXd& b) {
  double worst = 0.0;
  for (Eigen::Index i = 0; i < a.size(); ++i) worst = worse(worst, std::abs(a[i] - b[i]));
  return worst;
}
double apart(const State& a, const State& b) { return worse(apart(a.q, b.q), apart(a.v, b.v)); }

/// On the base a sprung arm, and a boom with modes.
SystemSpec flexible() {
  BodySpec boom = on(BodySpec(), "base", "revolute", {{0, 1, 0}}, {0, 0.4, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 2;
  boom.modal = std::make_shared<const ModalData>(lumped());
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies[0].hinge.v[3] = 0.05, bodies[0].hinge.v[1] = 0.7;
  bodies.push_back(boom);
  return system(std::move(bodies));
}

State at_end(const SystemSpec& spec, const SimulationOptions& options, double t_end) {
  Simulation sim(compiled(spec), options);
  sim.run(t_end);
  return sim.state();
}

TEST(DenseRun, AccelerationsAreThoseOfTheTwinToTheBit) {
  Simulation sim(compiled(flexible()), with("dopri5", 1e-9, Dynamics::dense));
  sim.set_force(0, 0.3);
  const OdeProblem ode = sim.ode();
  const Eigen::Index nq = sim.state().q.size(), nv = sim.state().v.size();
  VectorXd x(ode.n), rates(ode.n), tau = VectorXd::Zero(nv);
  tau[0] = 0.3;
  x << sim.state().q, sim.state().v;
  ASSERT_TRUE(ode.rhs(0.0, x.data(), rates.data()));
  const reference::DenseTwin<double> twin(flexible());
  const auto there = twin.at(sim.state().q, sim.state().v);
  EXPECT_EQ(rates.tail(nv), there.forward(tau));
  EXPECT_EQ(rates.head(nq), there.qdot);
}

// Rounding of both, over some hundred steps; loops, modes, springs.
TEST(DenseRun, GoesWhereTheSweepsGo) {
  EXPECT_LE(apart(at_end(four_bar(), with("dop853", 1e-12, Dynamics::dense), 0.5), at_end(four_bar(), with("dop853", 1e-12), 0.5)), 1e-10);
  EXPECT_LE(apart(at_end(flexible(), with("dop853", 1e-12, Dynamics::dense), 1.0), at_end(flexible(), with("dop853", 1e-12), 1.0)), 1e-10);
  for (unsigned seed = first_seed(); seed < first_seed() + 6; ++seed) {
    TreeOptions tree{.bodies = 4, .springs = true};
    tree.gravity = seed % 2 == 0 ? GravitySpec::Kind::uniform : GravitySpec::Kind::none;
    const SystemSpec spec = random_tree(seed, tree).spec;
    EXPECT_LE(apart(at_end(spec, with("dop853", 1e-12, Dynamics::dense), 0.1), at_end(spec, with("dop853", 1e-12), 0.1)), 1e-9) << seed;
  }
}

TEST(DenseRun, MethodsThatAskForNoAccelerationsAreRefused) {
  SimulationOptions options = with("variational", 1e-9, Dynamics::dense);
  options.integrator.fixed_step = 0.01;
  Simulation sim(compiled(flexible()), options);
  EXPECT_THROW(sim.run(0.1), InputError);
}

/// A symmetric top that nothing acts on, after t: the turn about its axis and the one about its momentum, in long double.
State exact_top(double t) {
  const long double A = 3, C = 5, wx = 0.8, wz = 1.1, nu = (C - A) / A * wz, size = std::hypot(A * wx, C * wz);
  const long double a = 0.5L * size / A * t, b = -0.5L * nu * t, h[2] = {A * wx / size, C * wz / size};
  const long double p[4] = {std::cos(a), std::sin(a) * h[0], 0, std::sin(a) * h[1]};
  State s;
  s.q = VectorXd::Zero(7), s.v = VectorXd::Zero(6);
  const long double q[4] = {p[0] * std::cos(b) - p[3] * std::sin(b), p[1] * std::cos(b) + p[2] * std::sin(b),
                            p[2] * std::cos(b) - p[1] * std::sin(b), p[3] * std::cos(b) + p[0] * std::sin(b)};
  for (int i = 0; i < 4; ++i) s.q[i] = static_cast<double>(q[i]);
  s.v[0] = static_cast<double>(wx * std::cos(nu * static_cast<long double>(t)));
  s.v[1] = static_cast<double>(wx * std::sin(nu * static_cast<long double>(t)));
  s.v[2] = wz;
  return s;
}
SystemSpec top() {
  BodySpec body = on(rigid("top", 2.0, {0, 0, 0}, diagonal({3, 3, 5})), "", "free");
  body.hinge.v = {0.8, 0, 1.1, 0, 0, 0};
  return system({body});
}

// What is left is what turns of 20 rad make of the last bit of a number: of the closed form in long double and of the end.
TEST(Extended, ATopIsThereToTheLastBits) {
  EXPECT_LE(apart(at_end(top(), with("extended", 1e-24), 8.0), exact_top(8.0)), 3e-16);
  EXPECT_GE(apart(at_end(top(), with("dop853", 1e-13), 8.0), exact_top(8.0)), 3e-15) << "no method in double gets there";
}

TEST(Extended, ErrorsGoWithTheTolerance) {
  const State exact = at_end(flexible(), with("extended", 1e-22), 0.4);
  EXPECT_LE(apart(at_end(flexible(), with("extended", 1e-17), 0.4), exact), 1e-15);
  const double coarse = apart(at_end(flexible(), with("extended", 1e-8), 0.4), exact);
  EXPECT_GE(coarse, 1e-14);
  EXPECT_LE(coarse, 1e-6);
  EXPECT_LE(apart(at_end(flexible(), with("dop853", 1e-13), 0.4), exact), 1e-11);
}

TEST(Extended, LoopsAreClosedInAllDigits) {
  Simulation sim(compiled(four_bar()), with("extended", 1e-22));
  sim.run(0.5);
  EXPECT_LE(apart(sim.state(), at_end(four_bar(), with("dop853", 1e-13), 0.5)), 1e-11);
  const LedgerState ledger = sim.ledger();
  EXPECT_LE(std::max({ledger.linear_relative, ledger.angular_relative, ledger.energy_relative}), 1e-11)
      << "rates in double, times the weights of an extrapolation";
  for (const double c : sim.loop_forces().residual) EXPECT_LE(std::abs(c), 2e-16);
  for (const double c : sim.loop_forces().rate) EXPECT_LE(std::abs(c), 1e-15);
}

// Both by 1e-7: after the first step rows and rates are zero to the last bit of a double, though nothing is projected in a step.
TEST(Extended, AStartThatIsOpenIsClosed) {
  const auto model = compiled(four_bar());
  const std::vector<double> tau(3, 0.0), small(6, 1e-22);
  VehicleExtended vehicle(model, small, 1e-22, [&] { return ExtendedLoads{.tau = tau}; });
  State state = model->initial_state();
  state.q[2] += 1e-7, state.v[1] -= 1e-7;
  VectorXd x(6);
  x << state.q, state.v;
  vehicle.enter(0.0, x.data());
  ASSERT_GT(vehicle.step(0.0, 1e-3).order, 0);
  vehicle.found(x.data());
  Simulation sim(model, with("dopri5", 1e-9));
  state.q = x.head(3), state.v = x.tail(3);
  sim.set_state(state);
  for (const double c : sim.loop_forces().residual) EXPECT_LE(std::abs(c), 2e-16);
  for (const double c : sim.loop_forces().rate) EXPECT_LE(std::abs(c), 2e-15);
  EXPECT_LE(apart(model->initial_state(), state), 0.1) << "near to where it was";
}

// A command that is set to what it was starts nothing; one that moves by nothing that matters does, and the digits stay.
TEST(Extended, DigitsBeyondADoubleStayOverTicks) {
  const auto ticked = [](bool commands) {
    Simulation sim(compiled(top()), with("extended", 1e-24));
    if (commands) sim.every({1, 20}, [&sim] { sim.set_force(5, sim.force(5) == 0.0 ? 1e-40 : 0.0); });
    sim.run(2.0);
    EXPECT_EQ(sim.statistics().restarts > 30, commands);
    return sim.state();
  };
  EXPECT_LE(apart(ticked(true), ticked(false)), 1.2e-16);
}

// A state of which one number is changed: the others keep their digits.
TEST(Extended, WhatATickDoesNotTouchKeepsItsDigits) {
  const auto ticked = [](bool touched) {
    SystemSpec spec = top();
    spec.bodies.push_back(on(rigid("other", 2.0, {0, 0, 0}, diagonal({3, 3, 5})), "", "revolute", {{0, 0, 1}}));
    Simulation sim(compiled(spec), with("extended", 1e-24));
    if (touched) sim.every({1, 50}, [&sim] { sim.v(6) += 0.01; });
    sim.run(2.0);
    return sim.state();
  };
  const State with = ticked(true), without = ticked(false);
  EXPECT_LE(apart(with.q.head(7), without.q.head(7)), 1.2e-16);
  EXPECT_LE(apart(with.v.head(6), without.v.head(6)), 1.2e-16);
  EXPECT_NEAR(with.v[6], 1.01, 1e-14);
}

TEST(Extended, AnEventIsWhereItIs) {
  Simulation sim(compiled(top()), with("extended", 1e-20));
  double seen = 0.0;
  sim.add_event({"wx turns over", [](double, const double*, const double* v) { return v[0]; }, 0,
                 [&] {
                   if (seen == 0.0) seen = sim.time();
                 }});
  sim.run(8.0);
  EXPECT_NEAR(seen, 0.5 * 3.14159265358979324 / (2.0 / 3.0 * 1.1), 1e-12);
  EXPECT_LE(apart(sim.state(), exact_top(8.0)), 3e-16) << "what is looked at inside of a step leaves no trace";
}

/// A platform that is turned as its profile says, on it about the same axis a wheel, whose rate in space stays; an eccentric arm beside it.
SystemSpec platform(bool arm) {
  BodySpec base = on(rigid("platform", 4.0, {0, 0, 0}, diagonal({1, 1, 2})), "", "revolute", {{0, 0, 1}});
  base.hinge.prescribed = {0};
  BodySpec wheel = on(rigid("wheel", 1.0, {0, 0, 0}, diagonal({0.1, 0.1, 0.2})), "platform", "revolute", {{0, 0, 1}});
  wheel.hinge.v = {3.0};
  std::vector<BodySpec> bodies = {base, wheel};
  if (arm)
    bodies.push_back(on(rigid("arm", 1.0, {0.3, 0, 0}, diagonal({0.01, 0.1, 0.1})), "platform", "revolute", {{0, 1, 0}}, {0.5, 0, 0}));
  return system(std::move(bodies));
}

// 3 rad/s less the profile's rate, and the integral of that, over corners and ticks: the twin's rounding aside, the last bit of each.
TEST(Extended, GivenMotionsAreFollowedInAllDigits) {
  const auto at = [](MotionProfile profile, double t_end) {
    Simulation sim(compiled(platform(false)), with("extended", 1e-24));
    sim.prescribe(0, std::move(profile));
    sim.every({1, 3}, [&sim] { sim.set_force(1, sim.force(1) == 0.0 ? 1e-40 : 0.0); });
    sim.run(t_end);
    return sim.state();
  };
  const State tabled = at(MotionProfile::rate_table({{0.0, 0.0}, {0.25, 0.75}, {1.0, 0.75}, {1.5, -0.5}}), 2.0);
  const double turned = 0.5 * 0.25 * 0.75 + 0.75 * 0.75 + 0.5 * 0.5 * 0.25 - 0.5 * 0.5;  // exact in double
  EXPECT_EQ(tabled.q[0], turned);
  EXPECT_EQ(tabled.v[0], -0.5);
  EXPECT_EQ(tabled.q[1], 6.0 - turned);
  EXPECT_EQ(tabled.v[1], 3.5);
  const double w = 2.0 * 3.14159265358979323846 * 0.8, phase = 0.3;
  const State swung = at(MotionProfile::sine(0.2, 0.8, phase), 1.7);
  const long double a = 0.2 * w, angle = static_cast<long double>(w) * 1.7L + phase;
  const long double q = a / w * (std::sin(angle) - std::sin(static_cast<long double>(phase))), v = a * std::cos(angle);
  EXPECT_NEAR(swung.q[0], static_cast<double>(q), 1e-16);
  EXPECT_NEAR(swung.v[0], static_cast<double>(v), 2e-16);
  const long double from = 3.0L + a * std::cos(static_cast<long double>(phase));
  EXPECT_NEAR(swung.v[1], static_cast<double>(from - v), 4e-16);
  EXPECT_NEAR(swung.q[1], static_cast<double>(from * 1.7L - q), 9e-16) << "the last bit of 5 rad";
}

// The wheel passes 2 rad at 2/3 s, where 0.1 N m begin to drive its 0.2 kg m^2. The time is known to 4 eps of it, and times 0.5 rad/s^2 or
// the way to go so are rate and angle.
TEST(Extended, WhatAnEventChangesIsKnownAsWellAsItsTime) {
  Simulation sim(compiled(platform(false)), with("extended", 1e-20));
  sim.add_event({"2 rad", [](double, const double* q, const double*) { return q[1] - 2.0; }, 1, [&sim] { sim.set_force(1, 0.1); }});
  sim.run(2.0);
  const double late = 4.0 * 2.2e-16 * 2.0 / 3.0;
  EXPECT_NEAR(sim.state().v[1], 11.0 / 3.0, 0.5 * late + 4.5e-16);
  EXPECT_NEAR(sim.state().q[1], 6.0 + 4.0 / 9.0, 0.5 * late * 4.0 / 3.0 + 9e-16);
}

TEST(Extended, WhatHangsOnGivenMotionsAgreesWithDouble) {
  const auto at = [](const SimulationOptions& options) {
    Simulation sim(compiled(platform(true)), options);
    sim.prescribe(0, MotionProfile::rate_table({{0.13, 0.0}, {0.57, 2.1}, {0.8, -1.4}}));
    sim.every({1, 5}, [&sim] { sim.set_force(2, 0.5 * sim.time()); });
    sim.run(1.0);
    return sim.state();
  };
  const State exact = at(with("extended", 1e-22));
  EXPECT_LE(apart(at(with("extended", 1e-17)), exact), 1e-15);
  EXPECT_LE(apart(at(with("dop853", 1e-13)), exact), 1e-12);
}

// Length and its rate are those of the profile, m r^2 theta' stays: to the last bits, over ticks that restart, after which all is closed
// anew in double.
TEST(Extended, ADrivenLengthIsFollowedInAllDigits) {
  Simulation sim(compiled(mass_on_a_string({0.0, 1.5, 0.0})), with("extended", 1e-22));
  sim.prescribe_loop("string", MotionProfile::sine(0.4, 0.25, -0.5 * 3.14159265358979323846));
  sim.every({1, 4}, [&sim] { sim.set_force(2, sim.force(2) == 0.0 ? 1e-40 : 0.0); });
  sim.run(3.0);
  const double w = 2.0 * 3.14159265358979323846 * 0.25, phase = -0.5 * 3.14159265358979323846;
  const long double angle = static_cast<long double>(w) * 3.0L + phase, a = 0.4 * w;
  const Eigen::Matrix<long double, 3, 1> x = sim.state().q.cast<long double>(), v = sim.state().v.cast<long double>();
  EXPECT_NEAR(static_cast<double>(x.norm() - (1.0L + a / w * (std::sin(angle) - std::sin(static_cast<long double>(phase))))), 0.0, 3e-16);
  EXPECT_NEAR(static_cast<double>(x.dot(v) / x.norm() - a * std::cos(angle)), 0.0, 3e-16);
  EXPECT_NEAR(static_cast<double>(x.cross(v).z()), 1.5, 6e-16);
}

/// The rates of impulses and work are doubles, whose rounding the columns of a step magnify: that is no loss.
TEST(Extended, ItsBalancesKnowWhatTheirOwnIntegralsMayBeOffBy) {
  BodySpec mass = on(rigid("mass", 2.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "prismatic", {Eigen::Vector3d::UnitX()});
  SpringDamper s;
  s.stiffness = 20.0;
  mass.hinge.springs.push_back(s), mass.hinge.q = {1.0};
  for (const double relative : {1e-16, 1e-20, 1e-28}) {
    SimulationOptions o;
    o.integrator.method = "extended";
    o.integrator.relative_tolerance = relative;
    Simulation sim(compiled(system({mass})), o);
    sim.run(10.0);
    const LedgerState l = sim.ledger();
    EXPECT_TRUE(l.pass) << relative << ": " << l.linear_relative << " above " << l.linear_limit;
    EXPECT_LT(l.linear_limit, 1e-9) << relative;
  }
}

TEST(Extended, GoesOnFromACheckpointWithTheSameBits) {
  std::optional<Checkpoint> kept;
  const auto scene = [&](const SystemSpec& spec, bool first) {
    Simulation sim(compiled(spec), with("extended", 1e-20));
    if (sim.model().loops.empty()) sim.prescribe(0, MotionProfile::sine(0.2, 0.8, 0.3));
    if (!sim.model().loops.empty()) sim.prescribe_loop("string", MotionProfile::sine(0.4, 0.25, 0.0));
    sim.every({1, 4}, [&sim] { sim.set_force(1, 0.1 * sim.time()); });
    sim.every({1, 2},
              [&] {
                if (const Checkpoint c = sim.checkpoint(); first && sim.time() == 0.5) kept = c;
              },
              {1, 2});
    if (!first) sim.resume(*kept);
    sim.run(1.0);
    return sim.state();
  };
  SystemSpec driven = flexible();
  driven.bodies.push_back(on(rigid("mast", 1.0, {0, 0.2, 0}, diagonal({0.1, 0.02, 0.1})), "", "revolute", {{1, 0, 0}}));
  std::rotate(driven.bodies.begin(), driven.bodies.end() - 1, driven.bodies.end());
  driven.bodies[0].hinge.prescribed = {0};
  for (const SystemSpec& spec : {driven, mass_on_a_string({0.0, 1.5, 0.0})}) {
    const State whole = scene(spec, true), resumed = scene(spec, false);
    EXPECT_EQ(whole.q, resumed.q);
    EXPECT_EQ(whole.v, resumed.v);
  }
}

TEST(Extended, WhatIsKnownInDoubleAloneIsNamed) {
  EXPECT_EQ(VehicleExtended::refusal(*compiled(flexible())), "");
  SystemSpec rubbing = flexible();
  rubbing.devices = {device("bearing", "dry_friction", {{"coulomb", 0.1}}, {{"at", "arm"}})};
  const auto equipped = compiled(rubbing);
  EXPECT_EQ(VehicleExtended::refusal(*equipped), "device bearing (dry_friction), which computes in double");
  Simulation sim(equipped, with("extended", 1e-20));
  EXPECT_THROW(sim.run(0.1), InputError);
}

}  // namespace
}  // namespace cardan::test
