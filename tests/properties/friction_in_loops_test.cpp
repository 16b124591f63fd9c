// Friction that sticks on hinges of closed loops, in each form that closes them, against mechanisms of one degree of freedom in closed
// form.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/abi/device_family.hpp"
#include "core/dynamics/loops.hpp"
#include "core/sim/rejoin.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/closed_mechanisms.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

constexpr LoopForm kForms[] = {LoopForm::embedding, LoopForm::multipliers};

DeviceSpec dry(const std::string& at, double coulomb, double breakaway) {
  return device("on_" + at, "dry_friction", {{"coulomb", coulomb}, {"breakaway", breakaway}}, {{"at", at}});
}

/// Two cranks of 1 m and a coupler that only moves along: 1.68 kg m^2, on a spring at the first crank; no gravity.
constexpr double kInertia = 2.0 * (0.09 + 0.25) + 1.0, kSpring = 40.0, kMiddle = 1.2, kStart = 0.5;
SystemSpec swing(LoopForm form) {
  SystemSpec spec = touching_four_bars(1, kMiddle + kStart, 0.0);
  spec.gravity = {};
  spec.loop_form = form;
  SpringDamper spring;
  spring.stiffness = kSpring, spring.rest = kMiddle;
  spec.bodies[0].hinge.springs = {spring};
  return spec;
}
double angle(const Simulation& sim) { return sim.state().q[sim.model().user[idx(sim.model().find_body("crank0"))].q]; }
int rate_of(const Simulation& sim, const std::string& body) { return sim.model().user[idx(sim.model().find_body(body))].v; }

/// Each half swing ends 2 F / k nearer to the middle, whichever hinge has the friction, all of whose rates are alike; where the spring no
/// longer breaks it away it stays, and moves again under a motor elsewhere.
TEST(FrictionInLoops, ASwingEndsWhereTheSpringNoLongerBreaksItAway) {
  const double F = 1.6, breakaway = 2.4, half = std::numbers::pi * std::sqrt(kInertia / kSpring);
  for (const LoopForm form : kForms)
    for (const std::string at : {"crank0", "rod0", "crank1"})
      for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf"}) {
        SystemSpec spec = swing(form);
        spec.devices = {dry(at, F, breakaway)};
        Simulation sim(compiled(spec), accurate(method));
        const double near = method == "dopri5" ? 1e-10 : 1e-7;  // as of a mass on a rail
        const std::string of = fmt::format("{} {} {}", static_cast<int>(form), at, method);
        int n = 1;
        for (double x = kStart; kSpring * x > breakaway; x -= 2.0 * F / kSpring, ++n) {
          sim.run((n - 0.5) * half);
          EXPECT_NEAR(angle(sim) - kMiddle, (n % 2 ? 1.0 : -1.0) * F / kSpring, near) << of << ", half swing " << n;
          EXPECT_EQ(sim.state().marks[0], 0.0) << of;
        }
        const int swings = n - 1;
        sim.run(swings * half + 0.01);
        const double stays = (swings % 2 ? -1.0 : 1.0) * (kStart - swings * 2.0 * F / kSpring), there = angle(sim);
        EXPECT_NEAR(there - kMiddle, stays, near) << of;
        EXPECT_EQ(sim.state().marks[0], 1.0) << of;
        sim.run((swings + 2) * half);
        EXPECT_NEAR(angle(sim), there, 1e-14) << of;
        EXPECT_LE(sim.state().v.lpNorm<Eigen::Infinity>(), 1e-14) << of;
        EXPECT_EQ(sim.state().v[rate_of(sim, at)], 0.0) << of;
        EXPECT_TRUE(sim.ledger().pass) << of << ": " << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
        const double needed = breakaway + kSpring * (there - kMiddle);
        sim.set_force(rate_of(sim, "crank1"), needed - 1e-8), sim.run((swings + 3) * half);
        EXPECT_LE(sim.state().v.lpNorm<Eigen::Infinity>(), 1e-14) << of;
        sim.set_force(rate_of(sim, "crank1"), needed + 1e-8), sim.run((swings + 3) * half + 0.05);
        EXPECT_GT(sim.state().v[rate_of(sim, "crank0")], 0.0) << of;
        EXPECT_TRUE(sim.ledger().pass) << of;
      }
}

/// Hinges that hold together hold as much as all of them, whichever share each has: none is let go before all have to be.
TEST(FrictionInLoops, HingesThatHoldTogetherHoldTheSumOfWhatTheyCan) {
  for (const LoopForm form : kForms) {
    SystemSpec spec = swing(form);
    spec.devices = {dry("crank0", 0.3, 0.5), dry("rod0", 0.9, 1.4), dry("crank1", 0.4, 0.5)};
    const double F = 1.6, breakaway = 2.4, half = std::numbers::pi * std::sqrt(kInertia / kSpring);
    Simulation sim(compiled(spec), accurate());
    sim.run(2.5 * half);
    EXPECT_NEAR(angle(sim) - kMiddle, F / kSpring, 1e-10);
    double x = kStart;
    int swings = 0;
    for (; kSpring * x > breakaway; x -= 2.0 * F / kSpring) ++swings;
    sim.run((swings + 1) * half);
    const double there = angle(sim);
    EXPECT_NEAR(there - kMiddle, (swings % 2 ? -1.0 : 1.0) * x, 1e-10);
    EXPECT_EQ(sim.state().marks[0] + sim.state().marks[2] + sim.state().marks[4], 3.0) << "all stick";
    Simulation part(compiled(spec), accurate());
    part.resume(sim.checkpoint());
    const double needed = breakaway + kSpring * (there - kMiddle);
    for (Simulation* s : {&sim, &part}) s->set_force(rate_of(sim, "rod0"), -(needed - 1e-8)), s->run((swings + 2) * half);
    EXPECT_LE(sim.state().v.lpNorm<Eigen::Infinity>(), 1e-14);
    const double before = (swings + 2) * half, later = 0.05;
    for (Simulation* s : {&sim, &part}) s->set_force(rate_of(sim, "rod0"), -(needed + 1e-8)), s->run(before + later);
    EXPECT_TRUE(sim.state().q == part.state().q && sim.state().v == part.state().v);
    // From there as an oscillator whose rest is moved by what was needed, less what all push with now.
    const double w = std::sqrt(kSpring / kInertia), gone = (breakaway - F) / kSpring * (1.0 - std::cos(w * later));
    EXPECT_NEAR(angle(sim) - there, gone, 1e-8);
    EXPECT_EQ(sim.state().marks[0] + sim.state().marks[2] + sim.state().marks[4], 0.0);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// The hinge between coupler and rocker turns back twice in each turn of the crank, where no force could hold it. What it has taken is F
/// times all that it has turned: from the law of cosines, between |g - a| and g + a across.
TEST(FrictionInLoops, AMechanismThatTurnsOnPassesItsDeadCentres) {
  const double F = 0.4, a = 0.2, b = 0.6, c = 0.4, g = 0.5;
  const auto folded = [&](double across) { return std::acos((b * b + c * c - across * across) / (2.0 * b * c)); };
  const double least = folded(g - a), most = folded(g + a);
  for (const LoopForm form : kForms)
    for (const std::string closing : {"point", "revolute"}) {
      SystemSpec spec = four_bar(closing, 40.0);
      spec.gravity = {};
      spec.loop_form = form;
      spec.devices = {dry("rocker", F, 3.0 * F)};
      Simulation sim(compiled(spec), accurate());
      const double before = sim.energy().total(), first = std::numbers::pi - std::abs(sim.state().q[2]);
      for (const int turns : {1, 4}) {
        double turned = 0.0;  // of the hinge; the crank began upwards, on its way to where the rocker unfolds most
        sim.run(turns * 0.15);
        const double crank = sim.state().q[0], now = std::numbers::pi - std::abs(sim.state().q[2]);
        // Dead centres where the crank is in line with the ground: at pi it is as far as can be, at 2 pi as near.
        double at = first;
        for (double centre = std::numbers::pi; centre < crank; centre += std::numbers::pi) {
          const double there = std::cos(centre) < 0.0 ? most : least;
          turned += std::abs(there - at);
          at = there;
        }
        turned += std::abs(now - at);
        EXPECT_GT(crank, turns * 5.0);
        EXPECT_NEAR(before - sim.energy().total(), F * turned, 1e-10 * before) << static_cast<int>(form) << closing;
        EXPECT_EQ(sim.state().marks[0], 0.0);
      }
      EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
    }
}

struct NoTurnsParameters {};
/// Counts how often a hinge turns back.
struct Turns {
  static constexpr const char *type = "turns", *summary = "how often a hinge turns back";
  static constexpr unsigned facts = 0;
  using Packed = NoTurnsParameters;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_VELOCITY, "a component"}};
  static constexpr cardan_state_desc marks[] = {{"turns", "1", 0.0, 1.0, "so far"}};
  static constexpr std::uint32_t n_roots = 1;
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.at[0].v; }
  static void event(const Packed&, const DeviceIn<double>&, std::uint32_t root, int, double*, double* d) noexcept { d[0] += root == 0; }
};

/// What else happens where a hinge is about to be held at a dead centre happens before, while there still is a motion that can be told.
TEST(FrictionInLoops, ADeadCentreIsToldToOthersToo) {
  static const Registry own = [] {
    Registry r = registry();
    r.devices.add(device_table<Turns>());
    return r;
  }();
  for (const LoopForm form : kForms) {
    SystemSpec spec = four_bar("point", 40.0);
    spec.gravity = {};
    spec.loop_form = form;
    spec.devices = {dry("rocker", 0.4, 1.2), device("counts", "turns", {}, {{"at", "rocker"}})};
    Simulation sim(compile(spec, own), accurate());
    sim.run(0.6);
    EXPECT_GT(sim.state().q[0], 20.0);
    const auto mark = [&](const char* device) {
      const Devices& d = sim.model().devices;
      return sim.state().marks[d.all[idx(d.find(device))].mark];
    };
    EXPECT_EQ(mark("counts"), std::floor(sim.state().q[0] / std::numbers::pi)) << static_cast<int>(form);
    EXPECT_EQ(mark("on_rocker"), 0.0);
  }
}

/// A piston: a crank of 0.2 m, a rod of 0.5 m, closed at the piston's pin; in units of length of which a metre has so many.
SystemSpec engine(LoopForm form, double crank_angle, double m = 1.0) {
  const double m2 = m * m;
  BodySpec crank = on(rigid("crank", 1.0, {0.1 * m, 0, 0}, m2 * diagonal({0.002, 0.01, 0.01})), "", "revolute", {{0, 0, 1}});
  BodySpec rod =
      on(rigid("rod", 0.8, {0.25 * m, 0, 0}, m2 * diagonal({0.001, 0.02, 0.02})), "crank", "revolute", {{0, 0, 1}}, {0.2 * m, 0, 0});
  BodySpec piston = on(rigid("piston", 1.5, Eigen::Vector3d::Zero(), m2 * diagonal({0.01, 0.01, 0.01})), "", "prismatic", {{1, 0, 0}});
  const double tilt = std::asin(0.4 * std::sin(crank_angle));
  crank.hinge.q = {crank_angle}, rod.hinge.q = {-tilt - crank_angle};
  piston.hinge.q = {m * (0.2 * std::cos(crank_angle) + 0.5 * std::cos(tilt))};
  SystemSpec spec = system({crank, rod, piston});
  LoopSpec pin;
  pin.name = "pin", pin.type = "point", pin.from.body = "piston", pin.to.body = "rod", pin.to.position = {0.5 * m, 0, 0};
  spec.loops = {pin};
  spec.loop_form = form;
  spec.devices = {dry("piston", 3.0 * m, 50.0 * m)};
  return spec;
}

/// At rest at a dead centre nothing holds the crank, whatever the piston could; elsewhere the piston holds it. What the motor has done is
/// in the motion and in F times the way of the piston.
TEST(FrictionInLoops, AMotorStartsAnEngineAtItsDeadCentre) {
  for (const LoopForm form : kForms)
    for (const double start : {0.0, std::numbers::pi})
      for (const double torque : {0.5, -0.5}) {
        Simulation sim(compiled(engine(form, start)), accurate()), beside(compiled(engine(form, start + 0.3)), accurate());
        sim.run(0.1);
        EXPECT_EQ(sim.state().marks[0], 1.0) << "nothing pushes";
        const double before = sim.energy().total(), x = sim.state().q[2];
        sim.set_force(0, torque), beside.set_force(0, torque);
        sim.run(0.4), beside.run(0.4);
        EXPECT_EQ(sim.state().marks[0], 0.0);
        EXPECT_EQ(beside.state().marks[0], 1.0);
        EXPECT_EQ(beside.state().q[0], start + 0.3);
        const double turned = sim.state().q[0] - start;
        EXPECT_GT(turned * torque, 0.01);
        EXPECT_LT(std::abs(turned), 3.0) << "before the other dead centre";
        EXPECT_NEAR(sim.energy().total() - before, torque * turned - 3.0 * std::abs(sim.state().q[2] - x), 1e-10);
        EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
      }
}

/// What a dead centre is does not hang on the unit of length: the piston's rates are as much less or more than the crank's.
TEST(FrictionInLoops, ADeadCentreIsOneInEachUnitOfLength) {
  for (const LoopForm form : kForms)
    for (const double start : {0.0, std::numbers::pi}) {
      const auto turned = [&](double m) {
        Simulation sim(compiled(engine(form, start, m)), accurate());
        sim.set_force(0, 0.5 * m * m), sim.run(0.2);
        EXPECT_EQ(sim.state().marks[0], 0.0) << m;
        // Steps of which the inside is not what steps to there give are not searched part by part.
        const IntegratorStatistics s = sim.statistics();
        EXPECT_LT(s.root_evaluations, 10 * (s.steps + s.rejected.all())) << m;
        return sim.state().q[0] - start;
      };
      const double want = turned(1.0);
      for (const double m : {0x1p-50, 0x1p50}) EXPECT_NEAR(turned(m), want, 1e-8 * want) << static_cast<int>(form) << " " << m;
    }
}

/// What a jack holds friction need not hold, wherever the jack has taken it: the piston moves as the jack's length does, and the friction
/// is against that. In each unit of length.
TEST(FrictionInLoops, WhatAJackHoldsFollowsIt) {
  const double start = 0.7, further = 0.03, tilt = std::asin(0.4 * std::sin(start)), length = 0.2 * std::cos(start) + 0.5 * std::cos(tilt);
  for (const LoopForm form : kForms)
    for (const double m : {0x1p-20, 1.0, 0x1p50}) {
      SystemSpec spec = engine(form, start, m);
      LoopSpec jack;
      jack.name = "jack", jack.type = "distance", jack.length = m * length, jack.prescribed = true, jack.to.body = "piston";
      spec.loops.push_back(jack);
      Simulation sim(compiled(spec), accurate());
      const auto moves = [&](double from, double by) {
        sim.prescribe_loop("jack", MotionProfile::rate_table({{from, 0.0}, {from + 1.0, m * by}, {from + 2.0, 0.0}}));
        sim.run(from + 2.5);
      };
      moves(0.0, further);
      EXPECT_NEAR(sim.state().q[2] / m, length + further, 1e-12) << static_cast<int>(form) << " " << m;
      sim.set_state(sim.state());  // devices that hold begin anew
      sim.run(3.0);
      EXPECT_EQ(sim.state().marks[0], 0.0) << static_cast<int>(form) << " " << m;
      moves(3.0, -2.0 * further);
      EXPECT_NEAR(sim.state().q[2] / m, length - further, 1e-12) << static_cast<int>(form) << " " << m;
      EXPECT_TRUE(sim.ledger().pass) << static_cast<int>(form) << " " << m;
    }
}

/// A crank on a spring drives a screw, 10 um a radian: where the crank sticks the screw is still on its way to rate zero, which it never
/// passes then; it sticks all the same, and holds its part.
TEST(FrictionInLoops, WhatOthersKeepFromMovingSticksToo) {
  const double k = 20.0, F = 0.3 + 0.1, holds = 0.4 + 0.2, half = std::numbers::pi * std::sqrt((1.0 + 2e-10) / k);
  for (const LoopForm form : kForms) {
    BodySpec crank = on(rigid("crank", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}});
    SpringDamper spring;
    spring.stiffness = k;
    crank.hinge.springs = {spring}, crank.hinge.q = {0.5};
    BodySpec screw = on(particle("screw", 2.0, {0, 0, 0}), "", "prismatic", {{0, 0, 1}});
    screw.hinge.q = {0.5e-5};
    SystemSpec spec = system({crank, screw});
    LoopSpec thread;
    thread.name = "thread", thread.type = "coupling", thread.terms = {{"screw", 1.0, {}}, {"crank", -1e-5, {}}};
    spec.loops = {thread};
    spec.loop_form = form;
    spec.devices = {dry("crank", 0.3, 0.4), dry("screw", 1e4, 2e4)};
    Simulation sim(compiled(spec), accurate());
    sim.run(12.5 * half);  // each half swing ends 2 F / k nearer to the middle: the twelfth at 0.02
    EXPECT_NEAR(sim.state().q[0], 0.5 - 12 * 2.0 * F / k, 1e-9);
    EXPECT_EQ(sim.state().marks[0] + sim.state().marks[2], 2.0);
    const double balance = k * sim.state().q[0];
    for (const double sign : {1.0, -1.0}) {
      sim.set_force(0, balance + sign * (holds - 1e-8)), sim.run(sim.time() + 0.1);
      EXPECT_EQ(sim.state().v[0], 0.0) << sign;
    }
    sim.set_force(0, balance - (holds + 1e-8)), sim.run(sim.time() + 0.01);
    const double w = std::numbers::pi / half;
    EXPECT_NEAR(sim.state().v[0], -(holds - F) * std::sin(0.01 * w) / w, 1e-9);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// A four bar of any links, hanging down or not, whose hinges in the tree all have friction.
SystemSpec any_four_bar(std::mt19937& random, LoopForm form) {
  const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
  const Eigen::Vector3d b{between(-0.3, 0.4), between(0.2, 0.6), 0.0}, c{between(0.8, 1.3), between(0.5, 1.1), 0.0},
      d{between(0.9, 1.3), between(-0.2, 0.2), 0.0};  // pins, the crank's at the origin
  const auto link = [&](const std::string& name, const std::string& to, const Eigen::Vector3d& at, const Eigen::Vector3d& along) {
    const double m = between(1.0, 5.0);
    return on(rigid(name, m, along * between(0.3, 0.7), diagonal({0.05 * m, 0.06 * m, 0.08 * m})), to, "revolute", {{0, 0, 1}}, at);
  };
  SystemSpec spec = system({link("crank", "", {0, 0, 0}, b), link("coupler", "crank", b, c - b), link("rocker", "", d, c - d)},
                           uniform_gravity({between(-3.0, 3.0), -9.81, 0}));
  LoopSpec pin;
  pin.name = "pin", pin.type = "revolute", pin.params = along({{0, 0, 1}});
  pin.from.body = "coupler", pin.from.position = c - b, pin.to.body = "rocker", pin.to.position = c - d;
  spec.loops = {pin};
  spec.loop_form = form;
  for (const std::string at : {"crank", "coupler", "rocker"}) {
    const double F = between(0.2, 6.0);
    spec.devices.push_back(dry(at, F, F * between(1.0, 1.5)));
  }
  return spec;
}

/// Where all hinges of a mechanism come to rest at once and it goes on, the one beside a dead centre gives way first, and then the others
/// are held while rates are what rounding left of them: what slides is pushed against its rate all the same.
TEST(FrictionInLoops, WhatSlidesIsPushedAgainstItsRate) {
  std::mt19937 random(11);
  for (int n = 0; n < 80; ++n) {
    Simulation sim(compiled(any_four_bar(random, kForms[n % 2])), accurate("dop853"));
    for (double t = 0.0; t <= 3.0; t += 0.1) {
      sim.run(t);
      for (const DeviceHold& h : sim.model().devices.holds) {
        const double* marks = &sim.state().marks[sim.model().devices.all[idx(h.device)].mark];
        if (marks[0] == 0.0) {
          EXPECT_GE(marks[1] * sim.state().v[h.v], -1e-9) << n << ", rate " << h.v << " at " << t;
        }
      }
    }
    EXPECT_TRUE(sim.ledger().pass) << n;
  }
}

/// What ark_imex takes implicitly is of what moves: where friction begins to hold, and leaves nothing that could close the loop again, that
/// is another.
TEST(FrictionInLoops, WhatIsHeldStaysClosedByAMethodInTwoParts) {
  std::mt19937 random(5);
  for (int n = 0; n < 40; ++n) {
    SystemSpec spec = any_four_bar(random, kForms[n % 2]);
    spec.devices.pop_back();
    BodySpec swings = on(rigid("swings", 1.0, {0.3, 0, 0}, diagonal({0.1, 0.1, 0.1})), "coupler", "revolute", {{0, 0, 1}}, {0.3, 0, 0});
    swings.hinge.v = {2.0};
    spec.bodies.push_back(swings);
    const auto end = [&](const SimulationOptions& options) {
      Simulation sim(compiled(spec), options);
      for (int k = 0; k < 80; ++k) sim.set_force(0, 20.0 * std::sin(0.08 * k + n)), sim.run(0.025 * (k + 1));
      return sim.state().q;
    };
    const VectorXd want = end(accurate("dop853"));
    VectorXd got = VectorXd::Zero(want.size());
    EXPECT_NO_THROW(got = end(accurate("ark_imex", 1e-8))) << n;
    EXPECT_LE((got - want).lpNorm<Eigen::Infinity>(), 1e-3) << n;
  }
}

/// Of a crank whose motion is given the piston follows, from rest and through its dead centres: what its friction takes is what the crank
/// needs beside what the engine needs without.
TEST(FrictionInLoops, FrictionDoesNotHoldWhatAGivenMotionMoves) {
  for (const LoopForm form : kForms) {
    SystemSpec spec = engine(form, 0.7);
    spec.bodies[0].hinge.prescribed = {0};
    SystemSpec smooth = spec;
    smooth.devices.clear();
    Simulation sim(compiled(spec), accurate()), without(compiled(smooth), accurate());
    for (Simulation* s : {&sim, &without}) s->prescribe(0, MotionProfile::rate_table({{0.0, 0.0}, {0.5, 0.0}, {1.0, 9.0}, {3.0, 9.0}}));
    for (const double t : {0.7, 1.1, 1.4, 2.3}) {
      sim.run(t), without.run(t);
      EXPECT_NEAR(sim.state().q[2], without.state().q[2], 1e-10);
      VectorXd a(3), b(3);
      sim.observe().prescribed_forces(a.data()), without.observe().prescribed_forces(b.data());
      EXPECT_NEAR((a - b)[0] * sim.state().v[0], 3.0 * std::abs(sim.state().v[2]), 1e-8) << t;
    }
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  }
}

/// 1 kg at 3 m/s is gripped by 2 kg that friction holds on a rail: 1 m/s together, and 1.5 m more against 1 N.
TEST(FrictionInLoops, WhatIsHeldTakesPartInAGrip) {
  for (const LoopForm form : kForms) {
    BodySpec a = on(particle("a", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}), b = a;
    b.name = "b", b.mass = 2.0;
    a.hinge.v = {3.0}, b.hinge.q = {3.0};
    SystemSpec spec = system({a, b}), next;
    LoopSpec grip;
    grip.name = "grip", grip.type = "coupling", grip.terms = {{"a", 1.0, {}}, {"b", -1.0, {}}}, grip.open = true;
    spec.loops = {grip};
    spec.loop_form = form;
    spec.devices = {dry("b", 1.0, 1.0)};
    next = spec;
    next.loops[0].open = false;
    Simulation sim(compiled(spec), accurate());
    sim.every({1, 1}, [&] {
      if (sim.time() == 1.0) sim.adopt([&] { return rejoin(sim, next, registry(), {}); }, "grip");
    });
    sim.run(0.5);
    EXPECT_EQ(sim.state().marks[0], 1.0);
    sim.run(2.0);
    EXPECT_NEAR(sim.state().v[1], 1.0 - 1.0 / 3.0, 1e-10);
    sim.run(5.0);
    EXPECT_NEAR(sim.state().q[1], 3.0 + 1.5, 1e-10);
    EXPECT_EQ(sim.state().v[1], 0.0);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// Two planes that guide a link say one of their six conditions twice, whatever is held. What multipliers can push against each other there
/// is nothing but rounding on a slide that hangs on the link, and its friction of a millionth of a newton does not hold the weight of a
/// body.
TEST(FrictionInLoops, ConditionsThatAreSaidTwiceHoldNothing) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto vector = [&] { return Vector3d(number(random), number(random), number(random)); };
  const auto axes = [&] { return Eigen::Quaterniond(number(random), number(random), number(random), number(random)).normalized(); };
  for (int trial = 0; trial < 20; ++trial) {
    BodySpec base = on(rigid("base", 2.0, {0.1, 0.2, 0.0}, diagonal({0.5, 0.6, 0.7})), "", "free");
    BodySpec slide = on(rigid("slide", 1.0, {0.0, 0.1, 0.1}, diagonal({0.2, 0.3, 0.25})), "base", "prismatic", {vector()}, vector());
    BodySpec link =
        on(rigid("link", 1.5, {0.1, 0.0, -0.1}, diagonal({0.3, 0.3, 0.4})), "slide", "universal", {vector(), vector()}, vector());
    const Vector3d place = slide.hinge.onode_position + link.hinge.onode_position;  // all stand alike at the start
    SystemSpec spec = system({base, slide, link}, uniform_gravity({1, -2, 3}));
    for (const char* name : {"one", "other"}) {
      LoopSpec plane;
      plane.name = name, plane.type = "planar", plane.params = along({{1, 0, 0}, {0, 1, 0}});
      plane.from.position = vector(), plane.from.R = axes().toRotationMatrix();
      plane.to = {"link", "", plane.from.position - place, plane.from.R, {}};
      spec.loops.push_back(plane);
    }
    for (const LoopForm form : kForms) {
      spec.loop_form = form;
      spec.devices.clear();
      Simulation free(compiled(spec), accurate());
      EXPECT_LT(free.model().loops.rank, free.model().loops.rows);
      spec.devices = {dry("slide", 1e-6, 1e-6)};
      Simulation sim(compiled(spec), accurate());
      free.run(0.01), sim.run(0.01);
      EXPECT_LT((sim.state().v - free.state().v).lpNorm<Eigen::Infinity>(), 1e-6) << trial;  // what the friction does in this time
      EXPECT_GT(std::abs(free.state().v[rate_of(free, "slide")]), 1e-4) << trial;
    }
  }
}

/// A hinge that closes carries no load, and `dae` holds nothing: said by name.
TEST(FrictionInLoops, WhatIsNotHonouredIsRefusedByName) {
  SystemSpec closing = four_bar("revolute");
  closing.devices = {dry("pivot", 1.0, 1.0)};
  EXPECT_NE(refusal(closing).find("\"pivot\", which closes a loop"), std::string::npos) << refusal(closing);
  SystemSpec dae = four_bar("revolute");
  dae.loop_form = LoopForm::dae;
  dae.devices = {dry("rocker", 1.0, 1.0)};
  EXPECT_NE(refusal(dae).find("devices that hold a component of a hinge, as on_rocker (dry_friction)"), std::string::npos) << refusal(dae);
}

/// A link cut in two, welded: all hinges of the loop are in the tree. Under gravity the crank breaks away at the torque that balances it
/// and what each hinge holds, times how fast that turns for the crank.
TEST(FrictionInLoops, ALoopWithFrictionOnAllItsHingesIsCutThroughALink) {
  for (const LoopForm form : kForms) {
    SystemSpec smooth = four_bar("weld", 0.0);
    smooth.loop_form = form;
    const auto half = [](const std::string& name, double com) { return rigid(name, 0.6, {com, 0, 0}, diagonal({0.001, 0.015, 0.015})); };
    BodySpec rocker = on(half("rocker", 0.2), "coupler", "revolute", {{0, 0, 1}}, {0.6, 0, 0});
    BodySpec foot = on(half("foot", -0.2), "", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
    rocker.hinge.q = smooth.bodies[2].hinge.q;
    foot.hinge.q = {smooth.bodies[0].hinge.q[0] + smooth.bodies[1].hinge.q[0] + rocker.hinge.q[0]};
    smooth.bodies[2] = rocker, smooth.bodies.push_back(foot);
    LoopSpec& weld = smooth.loops[0];
    weld.from.body = "rocker", weld.from.position = {0.4, 0, 0}, weld.to.body = "foot", weld.to.position.setZero();
    const auto model = compiled(smooth);
    VectorXd q = model->initial_state().q, v = VectorXd::Unit(4, 0), tau = VectorXd::Zero(4);
    const VectorXd still = VectorXd::Zero(4);
    LoopProjection projection(*model);
    ASSERT_TRUE(projection.close(q.data(), v.data()));
    Workspace ws(*model);
    const auto crank = [&](double torque) {
      VectorXd vdot(4);
      tau[0] = torque;
      EXPECT_TRUE(forward_dynamics(*model, ws, {.q = q.data(), .v = still.data(), .tau = tau.data()}, vdot.data()));
      return vdot[0];
    };
    const double balance = crank(0.0) / (crank(0.0) - crank(1.0));
    SystemSpec spec = smooth;
    double holds = 0.0, slides = 0.0;
    for (int i = 0; i < 4; ++i) {
      const double most[] = {0.3, 0.2, 0.5, 0.1};
      spec.devices.push_back(dry(spec.bodies[idx(i)].name, 0.8 * most[i], most[i]));
      holds += most[i] * std::abs(v[i] / v[0]), slides += 0.8 * most[i] * std::abs(v[i] / v[0]);
    }
    for (const double sign : {1.0, -1.0}) {
      Simulation sim(compiled(spec), accurate());
      sim.set_force(0, balance - sign * (holds - 1e-9)), sim.run(0.1);
      sim.set_force(0, balance + sign * (holds - 1e-9)), sim.run(0.2);
      EXPECT_LE(sim.state().v.lpNorm<Eigen::Infinity>(), 1e-14) << "holds";
      sim.set_force(0, balance + sign * (holds + 1e-9)), sim.run(0.201);
      const double begins = crank(balance + sign * (holds - slides));
      EXPECT_NEAR(sim.state().v[0], 1e-3 * begins, 1e-3 * std::abs(1e-3 * begins));
      for (const int device : {0, 1, 2, 3}) EXPECT_EQ(sim.state().marks[2 * device], 0.0) << "all slide";
      EXPECT_TRUE(sim.ledger().pass);
    }
  }
}

/// What sticks on a chain beside the loop is a locked hinge of it; in the loop's own form.
TEST(FrictionInLoops, AHeldHingeBesideALoopIsALockedOne) {
  for (const LoopForm form : kForms) {
    SystemSpec spec = four_bar("revolute", 5.0);
    spec.loop_form = form;
    spec.bodies.push_back(
        on(rigid("arm", 0.7, {0.2, 0.1, 0}, diagonal({0.01, 0.02, 0.02})), "coupler", "revolute", {{0, 1, 0}}, {0.3, 0.1, 0}));
    spec.bodies.back().hinge.q = {0.4};
    SystemSpec locked = spec;
    locked.bodies.back().hinge.locked = true;
    spec.devices = {dry("arm", 100.0, 100.0)};
    Simulation sim(compiled(spec), accurate()), part(compiled(spec), accurate()), rigid(compiled(locked), accurate());
    sim.run(0.5);
    const Checkpoint at = sim.checkpoint();
    part.resume(at);
    sim.run(1.5), part.run(1.5), rigid.run(1.5);
    EXPECT_EQ(sim.state().marks[0], 1.0);
    EXPECT_EQ(sim.state().q[3], 0.4);
    EXPECT_TRUE(sim.state().q == part.state().q && sim.state().v == part.state().v);
    EXPECT_LT((sim.state().q.head<3>() - rigid.state().q).norm(), 1e-8);
    EXPECT_LT((sim.state().v.head<3>() - rigid.state().v).norm(), 1e-7);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// A wheel that a gear turns three times as fast: the crank feels three times its friction.
TEST(FrictionInLoops, AGearCarriesWhatHoldsItsWheel) {
  for (const LoopForm form : kForms) {
    BodySpec crank = on(rigid("crank", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}});
    BodySpec wheel = on(rigid("wheel", 1.0, {0, 0, 0}, diagonal({1, 1, 0.5})), "", "revolute", {{0, 0, 1}}, {1, 0, 0});
    SystemSpec spec = system({crank, wheel});
    LoopSpec gear;
    gear.name = "gear", gear.type = "coupling", gear.terms = {{"wheel", 1.0, {}}, {"crank", -3.0, {}}};
    spec.loops = {gear};
    spec.loop_form = form;
    spec.devices = {dry("wheel", 0.5, 0.7)};
    Simulation sim(compiled(spec), accurate());
    sim.set_force(0, 2.1 - 1e-9), sim.run(1.0);
    EXPECT_EQ(sim.state().v[0], 0.0);
    sim.set_force(0, -2.1 - 1e-9), sim.run(2.0);
    EXPECT_NEAR(sim.state().v[0], -(2.1 - 1.5) / (1.0 + 9.0 * 0.5), 1e-8);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// Wheels a, b and c with c = a - b / 10; b comes to rest, c with it, and turns back. At rest all three hold; c, which takes ten times what
/// b lacks, is let go first, and b after it. Then c would turn on by a, pushed by its own friction: it holds, and a goes with b / 10.
TEST(FrictionInLoops, WhatIsLetGoTheWrongWayHoldsAgain) {
  for (const LoopForm form : kForms)
    for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf"}) {
      const auto wheel = [](const std::string& name, double x, double rate) {
        BodySpec body = on(rigid(name, 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}}, {x, 0, 0});
        body.hinge.v = {rate};
        return body;
      };
      SystemSpec spec = system({wheel("a", 0, 0.0), wheel("b", 1, -1.0), wheel("c", 2, 0.1)});
      LoopSpec gear;
      gear.name = "gear", gear.type = "coupling", gear.terms = {{"c", 1.0, {}}, {"a", -1.0, {}}, {"b", 0.1, {}}};
      spec.loops = {gear};
      spec.loop_form = form;
      spec.devices = {dry("a", 4.0, 4.0), dry("b", 1.0, 1.0), dry("c", 3.0, 3.0)};
      Simulation sim(compiled(spec), accurate(method, 1e-11));
      sim.set_force(rate_of(sim, "a"), 3.0), sim.set_force(rate_of(sim, "b"), 11.0);
      sim.run(0.5);
      const double stops = 12.0 + 0.1 * 1.8 / 1.01, starts = 10.0 - 0.1 * 2.0 / 1.01, rate = starts * (0.5 - 1.0 / stops);
      EXPECT_NEAR(sim.state().v[rate_of(sim, "b")], rate, 1e-7) << method;
      EXPECT_NEAR(sim.state().v[rate_of(sim, "a")], 0.1 * rate, 1e-8) << method;
      EXPECT_NEAR(sim.state().v[rate_of(sim, "c")], 0.0, 1e-12) << method;
      EXPECT_TRUE(sim.ledger().pass);
    }
}

/// Bars that bend, one of whose cranks sticks now and then: both forms, energy kept.
TEST(FrictionInLoops, BarsThatBendStickAlikeInBothForms) {
  std::vector<VectorXd> ends;
  std::string before;
  for (const LoopForm form : kForms) {
    SystemSpec spec = bending_four_bars(1);
    spec.loop_form = form;
    spec.devices = {dry("crank1", 20.0, 30.0)};
    Simulation sim(compiled(spec), accurate("dop853", 1e-10));
    std::string sticks;
    sim.every({1, 100}, [&] {
      const std::string now = sim.state().marks[0] == 1.0 ? "-" : "/";
      if (!sticks.ends_with(now)) sticks += now;
      const double t = sim.time();
      sim.set_force(rate_of(sim, "crank0"), t < 0.05 ? 0.0 : t < 0.1 ? 90.0 : 15.0);
    });
    sim.run(0.2);
    EXPECT_TRUE(sticks.starts_with("-/-")) << sticks;
    EXPECT_TRUE(ends.empty() || sticks == before) << sticks << " and " << before;
    before = sticks;
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
    ends.push_back(sim.state().q);
  }
  EXPECT_LE((ends[0] - ends[1]).lpNorm<Eigen::Infinity>(), 1e-8);
}

}  // namespace
}  // namespace cardan::test
