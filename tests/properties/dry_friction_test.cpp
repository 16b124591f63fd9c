// Friction that sticks, against closed forms: stick and breakaway are located.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/abi/device_family.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/sim/reference_check.hpp"
#include "core/sim/simulation.hpp"
#include "core/soa/tangent.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

/// Released at 1 m, each half swing ends 2 F / k nearer to the middle; where the spring no longer breaks it away it stays, for good.
TEST(DryFriction, ASwingEndsWhereTheSpringNoLongerBreaksItAway) {
  const double m = 2.0, k = 10.0, F = 0.8, breakaway = 1.2, half = std::numbers::pi * std::sqrt(m / k);
  BodySpec mass = on(particle("mass", m, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  mass.hinge.q = {1.0};
  SpringDamper spring;
  spring.stiffness = k;
  mass.hinge.springs = {spring};
  SystemSpec spec = system({mass});
  spec.devices = {device("drag", "dry_friction", {{"coulomb", F}, {"breakaway", breakaway}}, {{"at", "mass"}})};
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    Simulation sim(compiled(spec), accurate(method));
    const double near = method == "dopri5" ? 1e-10 : 1e-7;    // of steps at 1e-12, of many orders
    const double rests = method == "ark_imex" ? 1e-15 : 0.0;  // round-off of a rate that is taken apart
    double until = 0.0;
    for (int n = 1; n <= 6; ++n) {  // in the middle of each half swing, about -+F / k
      until = (n - 0.5) * half;
      sim.run(until);
      EXPECT_NEAR(sim.state().q[0], (n % 2 ? 1.0 : -1.0) * F / k, near) << method << ", half swing " << n;
      EXPECT_EQ(sim.state().marks[0], 0.0);
    }
    sim.run(6.0 * half + 0.01);
    const double stays = sim.state().q[0];
    EXPECT_NEAR(stays, 1.0 - 6 * 2.0 * F / k, near) << method;
    EXPECT_EQ(sim.state().marks[0], 1.0) << method;
    sim.run(8.0 * half);
    EXPECT_NEAR(sim.state().q[0], stays, rests);
    EXPECT_NEAR(sim.state().v[0], 0.0, rests) << method;
    EXPECT_EQ(sim.vdot()[0], 0.0);
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
    // a force that is too small, then one that is not
    sim.set_force(0, breakaway - k * -stays - 1e-9), sim.run(9.0 * half);
    EXPECT_NEAR(sim.state().v[0], 0.0, rests) << method;
    sim.set_force(0, breakaway + k * stays + 1e-9), sim.run(9.0 * half + 0.05);
    EXPECT_GT(sim.state().v[0], 0.0);
  }
}

/// The same in one run: of what is linear between two reversals a step may be several swings long, each of which ends by one.
TEST(DryFriction, SwingsWithinOneStepEndAllTheSame) {
  const double m = 1.0, k = 400.0;
  for (const double F : {7.0, 21.0, 25.0, 53.0})
    for (const std::string method : {"dopri5", "cvode_adams", "ark_explicit", "exponential", "multirate"}) {
      BodySpec mass = on(particle("mass", m, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
      mass.hinge.q = {0.613};
      SpringDamper spring;
      spring.stiffness = k;
      mass.hinge.springs = {spring};
      SystemSpec spec = system({mass});
      spec.devices = {device("drag", "dry_friction", {{"coulomb", F}}, {{"at", "mass"}})};
      SimulationOptions o;
      o.integrator.method = method, o.integrator.relative_tolerance = 1e-8;
      Simulation sim(compiled(spec), o);
      sim.run(10.0);
      double rests = 0.613;  // the other side of where force and spring are equal
      for (double side = 1.0; std::abs(rests) > F / k; side = -side) rests = 2.0 * side * F / k - rests;
      EXPECT_NEAR(sim.state().q[0], rests, 1e-6) << method << " " << F;
      EXPECT_EQ(sim.state().marks[0], 1.0) << method << " " << F;
    }
}

/// Thrown up it comes to rest where rounding says that it does: what it still moves by there is no error of the steps.
TEST(DryFriction, WhatComesToRestIsBalanced) {
  for (int k = 0; k < 12; ++k)
    for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
      BodySpec mass = on(particle("mass", 0.5 + 0.2 * k, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
      mass.hinge.v = {1.0 + 0.37 * k};
      SystemSpec spec = system({mass});
      spec.gravity = uniform_gravity({0, 0, -9.81});
      const double weight = 9.81 * mass.mass;
      spec.devices = {
          device("drag", "dry_friction", {{"coulomb", (0.2 + 0.06 * k) * weight}, {"breakaway", 1.1 * weight}}, {{"at", "mass"}})};
      SimulationOptions o;
      o.integrator.method = method, o.integrator.relative_tolerance = 1e-8;
      Simulation sim(compiled(spec), o);
      for (const double t : {0.05, 0.1, 1.0, 2.0}) {
        sim.run(t);
        EXPECT_TRUE(sim.ledger().pass) << method << " " << k << " at " << t;
      }
    }
}

/// A mass that a spring drags, whose other end moves at u, sticks until k u t = F_s, slides for (2 pi - 2 atan(w (F_s - F) / (k u))) / w
/// and sticks for 2 (F_s - F) / (k u), and so on.
TEST(DryFriction, SticksAndSlipsAtTheTimesOfTheClosedForm) {
  const double m = 1.0, k = 2.0, u = 0.1, F = 1.0, breakaway = 1.5, w = std::sqrt(k / m), A = (breakaway - F) / k;
  BodySpec mass = on(particle("mass", m, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  BodySpec carriage = on(particle("carriage", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}, {10, 0, 0});
  carriage.hinge.v = {u}, carriage.hinge.prescribed = {0};
  SystemSpec spec = system({mass, carriage});
  spec.devices = {device("spring", "spring_damper", {{"stiffness", k}, {"rest", 10.0}}, {{"from", "mass"}, {"to", "carriage"}}),
                  device("drag", "dry_friction", {{"coulomb", F}, {"breakaway", breakaway}}, {{"at", "mass"}})};
  const double first = breakaway / (k * u), slides = (2.0 * std::numbers::pi - 2.0 * std::atan(A * w / u)) / w, sticks = 2.0 * A / u;
  const auto truth = [&](double t) {
    double since = t - first, x = 0.0;
    if (since < 0.0) return 0.0;
    const double step = u * slides + 2.0 * A, period = slides + sticks;
    for (; since > period; since -= period) x += step;
    return since > slides ? x + step : x + u * since - u / w * std::sin(w * since) + A * (1.0 - std::cos(w * since));
  };
  Simulation sim(compiled(spec), accurate());
  for (double t = 1.0; t < 40.0; t += 1.0) {
    sim.run(t);
    EXPECT_NEAR(sim.state().q[0], truth(t), 1e-8) << t;
  }
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
}

/// A mass on another one on the ground is pushed all at once by more than each of two frictions holds. As under a push that grows, what
/// holds the least of its share gives way, and the other one then has less to hold; whatever they are called.
TEST(DryFriction, WhatIsLoadedMostGivesWayFirst) {
  struct Friction {
    double coulomb, breakaway;
  };
  const double push = 13.0;
  const auto moves = [&](Friction ground, Friction between, bool turned) {
    SystemSpec spec = system({on(particle("below", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}),
                              on(particle("above", 2.0, {0, 0, 0}), "below", "prismatic", {{1, 0, 0}})});
    const auto friction = [](const std::string& name, Friction f, const std::string& at) {
      return device(name, "dry_friction", {{"coulomb", f.coulomb}, {"breakaway", f.breakaway}}, {{"at", at}});
    };
    spec.devices = {friction(turned ? "b" : "a", ground, "below"), friction(turned ? "a" : "b", between, "above")};
    Simulation sim(compiled(spec), accurate());
    sim.set_force(0, push), sim.set_force(1, push);  // from outside, on the upper one
    sim.run(2.0);
    return Eigen::Vector2d(sim.state().q[0], sim.state().q[1]);
  };
  for (const bool turned : {false, true}) {
    const Eigen::Vector2d together = moves({4.0, 10.0}, {5.0, 12.0}, turned), apart = moves({4.0, 12.0}, {5.0, 10.0}, turned);
    EXPECT_NEAR(together[0], (push - 4.0) / 3.0 * 2.0, 1e-9) << turned;  // the upper one holds 13 - 2 * 3 of 12
    EXPECT_EQ(together[1], 0.0) << turned;
    EXPECT_EQ(apart[0], 0.0) << turned;  // the lower one holds 5 of 12
    EXPECT_NEAR(apart[1], (push - 5.0) / 2.0 * 2.0, 1e-9) << turned;
  }
}

/// A command pulls two wings that are alike past what holds them: both give way, and their hub does not turn, in whatever order they stand.
TEST(DryFriction, WhatIsLoadedAlikeGivesWayTogether) {
  const auto wing = [](const char* name, double side) {
    return on(rigid(name, 10.0, {0, side, 0}, diagonal({3.0, 0.1, 3.0})), "hub", "revolute", {{side, 0, 0}}, {0, 0.5 * side, 0});
  };
  SystemSpec spec =
      system({on(rigid("hub", 100.0, {0, 0, 0}, diagonal({20, 20, 20})), "", "free"), wing("left", 1.0), wing("right", -1.0)});
  for (const char* at : {"left", "right"})
    spec.devices.push_back(device(std::string("drag_") + at, "dry_friction", {{"coulomb", 1.0}, {"breakaway", 2.0}}, {{"at", at}}));
  CompileOptions options;
  options.node_wrenches = true;
  Simulation sim(compiled(spec, options), accurate());
  const int push = sim.add_wrench(0, false);
  sim.run(0.1);
  EXPECT_EQ(sim.state().marks[0] * sim.state().marks[2], 1.0);
  sim.set_wrench(push, {{0, 0, 0}, {0, 0, 27.0}});  // 2.25 N m at each of the two hinges
  sim.run(1.0);
  EXPECT_LT(sim.state().v[6], -0.01);
  EXPECT_NEAR(sim.state().v[6], sim.state().v[7], 1e-12);
  EXPECT_NEAR(sim.state().v.head<3>().norm(), 0.0, 1e-12);
}

/// The same of a load that rises: a hub that swings on a spring shakes two wings loose. Which of them comes first is a matter of rounding
/// (here 3e-11 of their loads), and what the hub does as one lets go would hold the other back.
TEST(DryFriction, WhatARisingLoadTakesToTheLimitAlikeGivesWayTogether) {
  for (const double ahead : {0.0, 1e-10, -1e-10}) {
    const auto wing = [](const char* name, double side, double angle) {
      BodySpec b = on(rigid(name, 10.0, {side, 0, 0}, diagonal({0.1, 3.0, 3.0})), "hub", "revolute", {{0, -side, 0}}, {0.5 * side, 0, 0});
      b.hinge.q = {angle};
      return b;
    };
    BodySpec cart = on(particle("cart", 1.0, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
    cart.hinge.v = {0.4};
    SpringDamper spring;
    spring.stiffness = 100.0;
    cart.hinge.springs = {spring};
    const BodySpec hub = on(rigid("hub", 10.0, {0, 0, 0}, diagonal({20, 20, 20})), "cart", "revolute", {{0, 1, 0}});
    SystemSpec spec = system({cart, hub, wing("left", -1.0, 0.3), wing("right", 1.0, 0.3 + ahead)});
    for (const char* at : {"left", "right"})
      spec.devices.push_back(device(std::string("drag_") + at, "dry_friction", {{"coulomb", 0.1}, {"breakaway", 0.6}}, {{"at", at}}));
    Simulation sim(compiled(spec), accurate());
    sim.run(3.0);
    EXPECT_GT(std::abs(sim.state().q[2] - 0.3), 0.01);
    EXPECT_NEAR(sim.state().q[3], sim.state().q[2], 1e-9);
    EXPECT_NEAR(sim.state().q[1], 0.0, 1e-9);
  }
}

/// Two wings that come to rest together stay, under springs that more than slide them back and less than break them away: which of them
/// comes first is rounding, and the other one, held back by a hub that the first one held had stopped, was thrown back. Whether one of them
/// counts its angle the other way round is nothing to that.
TEST(DryFriction, WhatComesToRestAlikeStaysTogether) {
  const auto wing = [](const char* name, double side, double rate, double way) {
    BodySpec b = on(rigid(name, 4.0, {0.5 * side, 0, 0}, diagonal({0.1, 0.3, 0.3})), "hub", "revolute", {{0, 0, way}}, {0.4 * side, 0, 0});
    b.hinge.v = {way * rate};
    SpringDamper spring;
    spring.stiffness = 0.4, spring.rest = -1.3 * way;
    b.hinge.springs = {spring};
    return b;
  };
  for (const std::string method : {"dopri5", "dop853", "cvode_bdf"})
    for (const double way : {1.0, -1.0})
      for (const double ahead : {0.0, 1e-14, 1e-12, -1e-11, 1e-11, 3e-6}) {
        SystemSpec spec = system({on(rigid("hub", 4.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free"), wing("left", -1.0, 0.7, 1.0),
                                  wing("right", 1.0, 0.7 + ahead, way)});
        for (const char* at : {"left", "right"})
          spec.devices.push_back(device(std::string("drag_") + at, "dry_friction", {{"coulomb", 0.3}, {"breakaway", 0.65}}, {{"at", at}}));
        SimulationOptions options = accurate(method);
        const bool coarse = ahead > 1e-11;  // a hundred tolerances, what errors of many steps move them apart by
        if (coarse) options.integrator.relative_tolerance = 1e-7;
        Simulation sim(compiled(spec), options);
        sim.run(3.0);
        EXPECT_GT(sim.state().q[7], 0.05) << method << " " << ahead;
        EXPECT_NEAR(way * sim.state().q[8], sim.state().q[7], coarse ? 1e-4 : 1e-9) << method << " " << ahead << " " << way;
        EXPECT_EQ(sim.state().marks[0] * sim.state().marks[2], 1.0) << method << " " << ahead << " " << way;
      }
}

/// At 1 m/s^2 one comes to rest after 10 us; the other one, as slow as that there, begins to move at 1 m/s^2 under less than would break it
/// away, and goes on.
TEST(DryFriction, WhatBeginsToMoveIsNotHeldWithWhatStopsAlike) {
  SystemSpec spec = system({on(particle("stops", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}),
                            on(particle("goes", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
  for (BodySpec& body : spec.bodies) {
    body.hinge.v = {1e-5};
    spec.devices.push_back(device(body.name + "_rubs", "dry_friction", {{"coulomb", 1.0}, {"breakaway", 3.0}}, {{"at", body.name}}));
  }
  SimulationOptions options;
  options.integrator.relative_tolerance = 1e-6;
  Simulation sim(compiled(spec), options);
  sim.set_force(1, 2.0);
  sim.run(1.0);
  EXPECT_NEAR(sim.state().q[0], 0.5e-10, 1e-12);
  EXPECT_EQ(sim.state().v[0], 0.0);
  EXPECT_NEAR(sim.state().q[1], 0.5 + 1e-5, 1e-6);
}

/// Two sliders side by side on a carriage are let go by what pushes them, then the carriage by what pushes it, which is faster than they:
/// it takes both along, which needs 2.5 N at each. One held by itself would need more than its breakaway of 3 N.
TEST(DryFriction, WhatIsPushedAlongAlikeIsHeldAgainTogether) {
  const double push = 27.0, force = 4.0, coulomb = 1.0;
  const auto slider = [](const char* name, double side) {
    return on(particle(name, 1.0, {0, 0, 0}), "carriage", "prismatic", {{1, 0, 0}}, {0, 0.5 * side, 0});
  };
  SystemSpec spec = system({on(particle("sledge", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}),
                            on(rigid("carriage", 1.0, {0, 0, 0}, diagonal({10, 10, 10})), "sledge", "revolute", {{0, 0, 1}}),
                            slider("left", 1.0), slider("right", -1.0)});
  spec.devices = {device("ground", "dry_friction", {{"coulomb", coulomb}, {"breakaway", 20.6}}, {{"at", "sledge"}})};
  for (const char* at : {"left", "right"})
    spec.devices.push_back(device(std::string("drag_") + at, "dry_friction", {{"coulomb", coulomb}, {"breakaway", 3.0}}, {{"at", at}}));
  Simulation sim(compiled(spec), accurate());
  sim.run(0.1);
  sim.set_force(0, push), sim.set_force(2, force), sim.set_force(3, force);
  sim.run(1.1);
  EXPECT_NEAR(sim.state().q[0], 0.5 * (push - coulomb) / 4.0, 1e-9);
  EXPECT_EQ(sim.state().q[2], 0.0);
  EXPECT_EQ(sim.state().q[3], 0.0);
  EXPECT_NEAR(sim.state().q[1], 0.0, 1e-12);
}

/// A brake of 12 N whose sliding friction is 10 N, under a weight of 20 N of which the first tick takes 9 N: it holds, as it would from
/// before.
TEST(DryFriction, HoldsWithWhatTheFirstTickCommands) {
  SystemSpec spec = system({on(particle("mass", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
  spec.gravity = uniform_gravity({20, 0, 0});
  spec.devices = {device("brake", "dry_friction", {{"coulomb", 10.0}, {"breakaway", 12.0}}, {{"at", "mass"}})};
  for (const double taken : {9.0, 7.0}) {
    Simulation sim(compiled(spec), accurate());
    sim.every({1, 1}, [&] { sim.set_force(0, -taken); });
    sim.run(1.0);
    EXPECT_NEAR(sim.state().q[0], taken == 9.0 ? 0.0 : 0.5 * (20.0 - 7.0 - 10.0), taken == 9.0 ? 0.0 : 1e-12) << taken;
  }
}

/// Where it holds, the vehicle moves as if the hinge were locked, also on a carrier that moves, and the twin agrees; a run goes on from a
/// checkpoint bit for bit.
TEST(DryFriction, AHeldHingeIsALockedOne) {
  SystemSpec spec = system(base_with_sprung_arm()), locked = spec;
  BodySpec& arm = locked.bodies[1];
  arm.hinge.locked = true, arm.hinge.springs.clear();
  spec.devices = {device("brake", "dry_friction", {{"coulomb", 20.0}}, {{"at", "arm"}})};
  for (const std::string method : {"dopri5", "dop853", "rk4", "cvode_bdf"}) {
    SimulationOptions options = accurate(method, method == "cvode_bdf" ? 1e-10 : 1e-12);
    if (method == "rk4") options.integrator.fixed_step = 0.002;
    Simulation sim(compiled(spec), options), rigid(compiled(locked), options), part(compiled(spec), options);
    sim.run(1.0);
    EXPECT_EQ(sim.state().marks[0], 1.0);
    const Checkpoint at = sim.checkpoint();
    part.resume(at);
    sim.run(3.0), part.run(3.0), rigid.run(3.0);
    EXPECT_TRUE(sim.state().q == part.state().q && sim.state().v == part.state().v) << method;
    EXPECT_LT((sim.state().v.head<6>() - rigid.state().v).norm(), 1e-8) << method;
    EXPECT_EQ(sim.state().q[7], 0.4) << method;
    EXPECT_TRUE(sim.ledger().pass) << method;
    Output difference = reference_output(sim);
    double x = 1.0;
    difference.fill(&x);
    EXPECT_LT(x, 1e-11) << method;
  }
}

/// What is advanced in closed form is a vehicle with the arm held, at the place where it was frozen, as in the run that goes on.
TEST(DryFriction, LinearPartsOfAResumedRunKnowWhatIsHeld) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.devices = {device("brake", "dry_friction", {{"coulomb", 20.0}}, {{"at", "arm"}})};
  for (const std::string method : {"exponential", "multirate"}) {
    Simulation sim(compiled(spec), accurate(method, 1e-8)), part(compiled(spec), accurate(method, 1e-8));
    sim.run(1.0);
    part.resume(sim.checkpoint());
    sim.run(2.0), part.run(2.0);
    EXPECT_TRUE(sim.state().q == part.state().q && sim.state().v == part.state().v) << method;
  }
}

/// With a motor that pushes harder and harder it breaks away where the motor passes what holds; J v knows what is held.
TEST(DryFriction, KrylovSolversKnowWhatIsHeld) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.devices = {device("brake", "dry_friction", {{"coulomb", 0.5}, {"breakaway", 0.8}, {"viscous", 0.1}}, {{"at", "arm"}})};
  SimulationOptions krylov = accurate("cvode_bdf", 1e-10);
  krylov.integrator.linear_solver = "krylov";
  Simulation a(compiled(spec), accurate()), b(compiled(spec), krylov);
  for (Simulation* sim : {&a, &b})
    sim->every({1, 2}, [sim] { sim->set_force(6, sim->time() < 2.0 ? 0.0 : sim->time() < 4.0 ? 3.0 : 0.0); });
  a.run(6.0), b.run(6.0);
  EXPECT_LT((a.state().q - b.state().q).norm(), 1e-6);
  EXPECT_GT(std::abs(a.state().q[7] - 0.4), 0.01) << "it moved";
  EXPECT_EQ(a.state().marks, b.state().marks);
}

/// A mass of 2 kg on a rail with friction of 3 N that breaks away at 4 N.
SystemSpec on_a_rail() {
  SystemSpec spec = system({on(particle("mass", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
  spec.devices = {device("drag", "dry_friction", {{"coulomb", 3.0}, {"breakaway", 4.0}}, {{"at", "mass"}})};
  return spec;
}

TEST(DryFriction, BreaksAwayAtTheInstantOfACheckpoint) {
  Simulation sim(compiled(on_a_rail()), accurate()), resumed(compiled(on_a_rail()), accurate());
  sim.run(1.0);
  sim.set_force(0, 7.0);
  const Checkpoint at = sim.checkpoint();
  sim.run(2.0);
  EXPECT_NEAR(sim.state().q[0], 0.5 * (7.0 - 3.0) / 2.0, 1e-10);
  resumed.resume(at);
  resumed.run(2.0);
  EXPECT_TRUE(resumed.state().q == sim.state().q && resumed.state().v == sim.state().v);
}

TEST(DryFriction, SlidesOnWithARateThatIsSetInTheRun) {
  Simulation sim(compiled(on_a_rail()), accurate());
  sim.run(1.0);
  EXPECT_EQ(sim.state().marks[0], 1.0);
  sim.v(0) = -0.6;  // for 0.4 s at 1.5 m/s^2
  sim.run(1.2);
  EXPECT_NEAR(sim.state().q[0], -0.6 * 0.2 + 0.75 * 0.04, 1e-10);
  sim.run(3.0);
  EXPECT_NEAR(sim.state().q[0], -0.12, 1e-10);
  EXPECT_EQ(sim.state().marks[0], 1.0);
  State still = sim.state();
  still.v[0] = 0.3;
  sim.set_state(still);
  sim.run(3.1);
  EXPECT_NEAR(sim.state().v[0], 0.15, 1e-10);
}

struct NoClutchParameters {};
/// Holds from 0.5 s on, whatever moves there.
struct Clutch {
  static constexpr const char *type = "clutch", *summary = "holds at once";
  static constexpr unsigned facts = 0;
  using Packed = NoClutchParameters;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_HOLD, "a component"}};
  static constexpr cardan_state_desc marks[] = {{"holds", "1", 0.0, 1.0, "1: it does"}};
  static constexpr std::uint32_t n_roots = 1;
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  static double holds(const Packed&, const DeviceIn<double>&) noexcept { return 1e9; }
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.t - 0.5; }
  static void event(const Packed&, const DeviceIn<double>&, std::uint32_t root, int, double*, double* d) noexcept {
    if (root == 0) d[0] = 1.0;
  }
};

/// What a device stops that moves leaves the balances open: rounding is taken for known where a rate was found to be zero, and a motion
/// that vanishes is not.
TEST(DryFriction, AMotionThatADeviceStopsIsMissedInTheBalances) {
  static const Registry own = [] {
    Registry r = registry();
    r.devices.add(device_table<Clutch>());
    return r;
  }();
  SystemSpec spec = on_a_rail();
  spec.bodies[0].hinge.v = {0.6};
  spec.devices = {device("clutch", "clutch", {}, {{"at", "mass"}})};
  Simulation sim(compile(spec, own), accurate());
  sim.run(1.0);
  EXPECT_EQ(sim.state().v[0], 0.0);
  EXPECT_NEAR(sim.state().q[0], 0.3, 1e-12);
  EXPECT_FALSE(sim.ledger().pass);
  EXPECT_NEAR(sim.ledger().energy, -0.36, 1e-12);
}

/// An event of the same instant that sends it back is not undone by its coming to rest.
TEST(DryFriction, SlidesOnWhereAnEventSendsItBackAsItStops) {
  SystemSpec spec = on_a_rail();
  spec.bodies[0].hinge.v = {0.6};
  Simulation sim(compiled(spec), accurate());
  bool sent = false;
  sim.add_event(
      {"rest", [&](double, const double*, const double* v) { return sent ? 1.0 : v[0]; }, -1, [&] { sent = true, sim.v(0) = -0.6; }});
  sim.run(0.6);
  EXPECT_NEAR(sim.state().v[0], -0.3, 1e-10);
  EXPECT_NEAR(sim.state().q[0], 0.12 - 0.6 * 0.2 + 0.75 * 0.04, 1e-10);
}

/// A hammer on a block strikes it in the instant in which friction stops it, and beside it another block comes to rest: the first slides
/// on with what the blow gives it, the second stays. On which side of that instant the blow falls is a matter of rounding.
TEST(DryFriction, SlidesOnWhereABlowFallsInTheInstantOfItsRest) {
  const double e = 0.5, u = -0.3;  // of the hammer [m/s]; rest is at 0.4 s and 0.12 m
  for (const std::string method : {"dopri5", "dop853", "cvode_adams"})
    for (const double earlier : {0.0, 1e-17, 1e-16, 3e-16, 1e-15, 1e-14, 1e-12, -1e-16, -3e-16, -1e-15, -1e-14, -1e-12}) {
      SystemSpec spec = on_a_rail();
      spec.bodies[0].hinge.v = {0.6};
      BodySpec hammer = on(particle("hammer", 1.0, {0, 0, 0}), "mass", "prismatic", {{1, 0, 0}});
      hammer.hinge.q = {0.19 + earlier}, hammer.hinge.v = {u - 0.6};
      const HingeLoadSpec stop{0, HingeLaw::stop, {-0.05, 1e300, 1e4, 1.0, 0.0}, {}, {e, 0.01}};
      hammer.hinge.loads = {stop};
      spec.bodies.push_back(hammer);
      spec.bodies.push_back(on(particle("beside", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}));
      spec.bodies.back().hinge.v = {0.6};
      spec.devices.push_back(device("drag_beside", "dry_friction", {{"coulomb", 3.0}, {"breakaway", 4.0}}, {{"at", "beside"}}));
      Simulation sim(compiled(spec), accurate(method));
      const double near = method == "cvode_adams" ? 1e-8 : 1e-10, thrown = u / 3.0 * (1.0 + e);
      sim.run(0.45);
      EXPECT_NEAR(sim.state().v[0], thrown + 1.5 * 0.05, near) << method << ", " << earlier;
      EXPECT_NEAR(sim.state().q[0], 0.12 + thrown * 0.05 + 0.75 * 0.05 * 0.05, near) << method << ", " << earlier;
      sim.run(1.0);
      EXPECT_EQ(sim.state().marks[0], 1.0);
      EXPECT_NEAR(sim.state().q[0], 0.12 - thrown * thrown / 3.0, near) << method << ", " << earlier;
      EXPECT_NEAR(sim.state().q[2], 0.12, near) << method << ", " << earlier;
      EXPECT_EQ(sim.state().v[2], 0.0) << method << ", " << earlier;
      EXPECT_TRUE(sim.ledger().pass) << method << ", " << earlier;
    }
}

/// What a device holds is no motion that was given: it breaks away also where it stood still from the start, in a model that is adopted
/// too.
TEST(DryFriction, WhatStandsStillAtFirstBreaksAwayToo) {
  SystemSpec spec = on_a_rail();
  spec.devices[0].initial["sticks"] = number(1.0);
  const auto model = compiled(spec);
  EXPECT_FALSE(model->has_given_motion(0));
  Simulation sim(model, accurate());
  sim.run(1.0);
  sim.adopt(compiled(spec));
  sim.run(2.0);
  sim.set_force(0, 7.0);
  sim.run(3.0);
  EXPECT_NEAR(sim.state().q[0], 1.0, 1e-10);
}

/// At the very edge, where rounding decides whether a state begins before or beyond the root.
TEST(DryFriction, BreaksAwayFromALoadThatPassesItsEdgeByNothing) {
  for (const double edge : {1.0 - 1e-15, 1.0, 1.0 + 5e-13, 1.0 + 2e-12}) {
    SystemSpec spec = on_a_rail();
    SpringDamper pull;  // it grows as the carriage moves
    spec.bodies.push_back(on(particle("carriage", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}, {10, 0, 0}));
    spec.bodies[1].hinge.v = {1.0}, spec.bodies[1].hinge.prescribed = {0}, spec.bodies[1].hinge.q = {4.0 * edge};
    spec.devices.push_back(device("spring", "spring_damper", {{"stiffness", 1.0}, {"rest", 10.0}}, {{"from", "mass"}, {"to", "carriage"}}));
    Simulation sim(compiled(spec), accurate());
    sim.run(0.5);
    // 2 x'' = 4 + t - x - 3 from rest: x = 1 + t - cos w t - sin(w t) / w
    const double w = std::sqrt(0.5);
    EXPECT_NEAR(sim.state().q[0], 1.5 - std::cos(0.5 * w) - std::sin(0.5 * w) / w, 1e-9) << edge;
  }
}

TEST(DryFriction, HoldsAComponentAlone) {
  SystemSpec spec = on_a_rail();
  spec.devices.push_back(device("brake", "dry_friction", {{"coulomb", 1.0}}, {{"at", "mass"}}));
  try {
    compiled(spec);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("\"mass\", which brake holds"), std::string::npos) << e.what();
  }
}

/// The search for the instant of breakaway tries states with other masses: what is seen has that of its own.
TEST(DryFriction, ATrialOfWhatHoldsLeavesMassesAsTheyAre) {
  SystemSpec spec = system({on(rigid("bus", 40.0, {0, 0, 0}, diagonal({6, 7, 8})), "", "free"),
                            on(particle("mass", 2.0, {0, 0, 0}), "bus", "prismatic", {{0, 0, 1}})});
  DeviceSpec tank = device("tank", "tank", {{"radius", 0.3}}, {{"at", "bus"}});
  tank.initial["propellant"] = number(10.0), tank.inputs["flow"] = {"jet.flow", {}};
  DeviceSpec jet = device("jet", "thruster", {{"thrust", 100.0}, {"specific_impulse", 20.0}}, {{"at", "bus"}});
  jet.inputs["command"] = {1.0, {}}, jet.inputs["supply"] = {"tank.supply", {}};
  jet.params["direction"].value = std::vector<double>{0, 0, 1};
  spec.devices = {tank, jet, device("brake", "dry_friction", {{"coulomb", 100.0}}, {{"at", "mass"}})};
  for (const std::string method : {"rk4", "dopri5", "dop853", "cvode_bdf"}) {
    SimulationOptions options = accurate(method, 1e-10);
    if (method == "rk4") options.integrator.fixed_step = 0.01;
    Simulation sim(compiled(spec), options);
    sim.run(5.0);
    const double left = 10.0 - 100.0 / (20.0 * 9.80665) * 5.0;
    EXPECT_NEAR(sim.model().user[0].mass, 40.0 + left, 1e-8) << method;
    EXPECT_TRUE(sim.ledger().pass) << method;
    EXPECT_NEAR(sim.vdot()[5], 100.0 / (42.0 + left), 1e-9) << method;
  }
}

/// By the dense twin too: it knows what is held now.
TEST(DryFriction, HoldsInADenseRun) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.bodies[1].hinge.v = {0.7};
  spec.devices = {device("brake", "dry_friction", {{"coulomb", 0.4}, {"breakaway", 3.0}}, {{"at", "arm"}})};
  SimulationOptions options = accurate("dop853", 1e-11);
  Simulation sweeps(compiled(spec), options);
  options.dynamics = Dynamics::dense;
  Simulation dense(compiled(spec), options);
  for (Simulation* sim : {&sweeps, &dense}) {
    sim->run(5.0);
    EXPECT_EQ(sim->state().v[6], 0.0);  // it has come to rest, and sticks
    EXPECT_TRUE(sim->ledger().pass);
  }
  EXPECT_LT((dense.state().q - sweeps.state().q).norm(), 1e-9);
  EXPECT_LT((dense.state().v - sweeps.state().v).norm(), 1e-9);
}

/// Where hinges may be held, or are given, devices act on what moves with them: dv' along q and v against differences of the right-hand
/// side.
TEST(DryFriction, TakesPartInSensitivities) {
  for (const bool given : {false, true}) {
    SystemSpec spec = system(base_with_sprung_arm());
    spec.bodies[1].hinge.v = {0.7};
    spec.devices = {
        with_vector(device("jet", "thruster", {{"thrust", 2.0}, {"specific_impulse", 20.0}}, {{"at", "arm"}}), "direction", {0, 0, 1})};
    spec.devices[0].inputs["command"] = {1.0, {}};
    if (given)
      spec.bodies[1].hinge.prescribed = {0};
    else
      spec.devices.push_back(device("brake", "dry_friction", {{"coulomb", 1.0}, {"viscous", 0.3}}, {{"at", "arm"}}));
    Simulation sim(compiled(spec), accurate());
    const State here = sim.state();
    const int nq = sim.model().nq, nv = sim.model().nv;
    sim.vdot();  // what holds is settled
    const std::vector<double> tau = sim.applied_forces();
    const std::vector<NodeWrench> wrenches(sim.wrenches().begin(), sim.wrenches().end());
    const DeviceForces devices(*sim.devices());
    operators::Sensitivities about(sim.shared_model());
    about.solve({.q = here.q.data(), .v = here.v.data(), .tau = tau.data(), .wrenches = wrenches}, &devices);
    const OdeProblem ode = sim.ode();
    VectorXd x(ode.n), u(nv), w(nv), got(nv), truth(ode.n), work(ode.n), d = VectorXd::Zero(ode.n);
    x << here.q, here.v, here.z;
    for (int i = 0; i < nv; ++i) u[i] = std::sin(2.7 * i + 0.3), w[i] = std::cos(1.9 * i);
    if (given) u[nv - 1] = w[nv - 1] = 0.0;  // these are told by the profile
    sim.model().qdot(here.q.data(), u.data(), d.data());
    d.segment(nq, nv) = w;
    soa::derivative(
        [&](double h, double* out) {
          const VectorXd at = x + h * d;
          if (!ode.rhs(0.0, at.data(), out)) throw std::runtime_error("breakdown");
        },
        0.002, ode.n, truth.data(), work.data());
    about.forward({.q = u.data(), .v = w.data()}, got.data());
    EXPECT_LT((got - truth.segment(nq, nv)).norm(), 1e-9 * (1.0 + got.norm())) << given;
  }
}

}  // namespace
}  // namespace cardan::test
