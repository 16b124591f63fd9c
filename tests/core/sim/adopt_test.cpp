// A run goes on with a model that was compiled anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/diagnostic.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/mass_on_a_string.hpp"
#include "tests/support/modal_samples.hpp"

namespace cardan::test {
namespace {

using Eigen::VectorXd;

/// On the base a sprung arm, a wheel on a profile, a flexible boom, friction, a stored momentum, and a gyro that ticks.
SystemSpec vehicle() {
  BodySpec wheel = on(rigid("wheel", 1.5, {0, 0.1, 0}, diagonal({0.2, 0.1, 0.2})), "base", "revolute", {{1, 0, 0}}, {-0.5, 0, 0});
  wheel.hinge.prescribed = {0};
  BodySpec boom = on(BodySpec(), "base", "revolute", {{0, 1, 0}}, {0, 0.4, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 0;
  boom.modal = std::make_shared<const ModalData>(lumped());
  std::vector<BodySpec> bodies = base_with_sprung_arm();
  bodies[0].hinge.v[3] = 0.05;
  bodies.insert(bodies.end(), {wheel, boom});
  SystemSpec spec = system(std::move(bodies));
  spec.devices.push_back(device("friction", "lugre_friction", {{"coulomb", 0.02}, {"stiffness", 5.0}}, {{"at", "boom"}}));
  DeviceSpec momentum = device("momentum", "momentum_wheel", {{"inertia", 0.1}}, {{"at", "base"}});
  momentum.params["axis"].value = std::vector<double>{0.0, 0.6, 0.8};
  spec.devices.push_back(momentum);
  DeviceSpec gyro = device("gyro", "imu", {}, {{"at", "base"}});
  gyro.period = 0.125;
  spec.devices.push_back(gyro);
  return spec;
}

/// The same where what gyros tell is under way for 1.25 s, and a command holds for 0.9 s: beyond the instant of a change.
SystemSpec that_remembers() {
  SystemSpec spec = vehicle();
  DeviceSpec jet = device("jet", "thruster", {{"thrust", 0.3}, {"specific_impulse", 200.0}}, {{"at", "arm"}});
  jet.params["direction"].value = std::vector<double>{0.0, 0.6, 0.8};
  jet.inputs["command"] = {.value = "gyro.valid", .at = {}, .delay = 10};
  spec.devices.push_back(jet);
  spec.devices[1].inputs["torque"] = {.value = 0.0, .at = {}, .safe = -0.02, .timeout = 0.9};
  return spec;
}

/// The same with all lists the other way round where they can be, and something new before what was there.
SystemSpec turned_over() {
  SystemSpec spec = that_remembers();
  std::reverse(spec.bodies.begin() + 1, spec.bodies.end());
  std::reverse(spec.devices.begin(), spec.devices.end());
  return spec;
}

struct ChangingScene {
  explicit ChangingScene(const SystemSpec& spec, const std::string& method = "rk4")
      : sim(compiled(spec, {.node_wrenches = true, .world_wrenches = true}), options(method)), outputs(standard_outputs(sim)) {
    const Model& m = sim.model();
    const int arm = m.find_body("arm"), wheel = m.find_body("wheel"), momentum = m.devices.find("momentum");
    sim.prescribe(sim.user(wheel).v, MotionProfile::rate_table({{0.13, 0.0}, {0.57, 1.1}, {1.01, -0.4}}));
    slot = sim.add_wrench(m.find_node("arm"), true);
    sim.set_wrench(slot, {{0, 0, 0.1}, {0.2, 0, 0}});
    sim.set_device_input(m.devices.all[static_cast<std::size_t>(momentum)].in, 0.01);
    sim.every({1, 8}, [this, arm] { sim.set_force(sim.user(arm).v, 0.5 * std::cos(3.0 * sim.time())); });
  }
  static SimulationOptions options(const std::string& method) {
    SimulationOptions o;
    o.integrator.method = method;
    o.integrator.relative_tolerance = 1e-10;
    if (method == "rk4") o.integrator.fixed_step = 0.005;
    o.seed = 7;
    return o;
  }
  void adopt_at(Rational t, const SystemSpec& spec) {
    sim.every(
        {1000, 1},
        [this, spec] {
          if (!adopted) sim.adopt(compiled(spec, {.node_wrenches = true, .world_wrenches = true}));
          adopted = true;
        },
        t);
  }
  /// Names and numbers of all outputs.
  std::vector<std::pair<std::string, double>> all() {
    std::vector<std::pair<std::string, double>> out;
    for (const Output& o : outputs) {
      std::vector<double> x(o.channel.components.size());
      o.fill(x.data());
      for (std::size_t i = 0; i < x.size(); ++i) out.emplace_back(o.channel.path + "." + o.channel.components[i], x[i]);
    }
    return out;
  }
  Simulation sim;
  std::vector<Output> outputs;
  int slot = 0;
  bool adopted = false;
};

TEST(Adopt, TheSameVehicleInAnotherOrderMovesOnAsItDid) {
  ChangingScene plain(that_remembers()), changed(that_remembers());
  changed.adopt_at({1, 2}, turned_over());
  plain.sim.run(1.5), changed.sim.run(1.5);
  ASSERT_TRUE(changed.adopted);
  EXPECT_EQ(changed.sim.model().user[1].name, "boom");
  EXPECT_EQ(changed.sim.user(1).name, "arm");
  const auto a = plain.all(), b = changed.all();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].first.starts_with("ledger/")) continue;
    EXPECT_NEAR(a[i].second, b[i].second, 1e-11 * (1.0 + std::abs(a[i].second))) << a[i].first;  // order of sums: round-off
  }
  EXPECT_TRUE(changed.sim.worst_ledger().pass);
}

TEST(Adopt, TheSameModelChangesNoBitOfAMethodWithoutMemory) {
  ChangingScene plain(that_remembers()), changed(that_remembers());
  changed.adopt_at({1, 2}, that_remembers());
  plain.sim.run(1.5), changed.sim.run(1.5);
  ASSERT_TRUE(changed.adopted);
  EXPECT_TRUE(plain.sim.state().q == changed.sim.state().q && plain.sim.state().v == changed.sim.state().v);
  EXPECT_TRUE(plain.sim.state().z == changed.sim.state().z && plain.sim.state().marks == changed.sim.state().marks);
}

TEST(Adopt, AnotherMassIsToldToTheLedgerAndTheMotionIsThatOfTheNewModel) {
  for (const std::string method : {"rk4", "dopri5", "cvode_bdf"}) {
    ChangingScene changed(vehicle(), method);
    SystemSpec heavier = vehicle();
    heavier.bodies[1].mass = 3.5;
    BodySpec guest = on(rigid("a_guest", 0.7, {0.1, 0.2, 0.3}, diagonal({0.01, 0.02, 0.02})), "arm", "revolute", {{0, 1, 0}}, {0.3, 0, 0});
    guest.hinge.v = {0.4};
    heavier.bodies.push_back(guest);
    heavier.devices.push_back(device("a_spring", "lugre_friction", {{"coulomb", 0.3}, {"stiffness", 2.0}}, {{"at", "a_guest"}}));
    changed.adopt_at({1, 2}, heavier);
    changed.sim.run(0.5);
    changed.sim.run(1.25);
    EXPECT_TRUE(changed.sim.ledger().pass && changed.sim.worst_ledger().pass) << method;

    // A simulation of the new vehicle from there on.
    ChangingScene before(vehicle(), method), fresh(heavier, method);
    before.sim.run(0.5);
    const Model& to = fresh.sim.model();
    State s = carried(before.sim.state(), model_map(before.sim.model(), to), to);
    fresh.sim.set_state(s);
    fresh.sim.set_force(fresh.sim.user(1).v, before.sim.force(before.sim.user(1).v));
    fresh.sim.run(1.25);
    for (const char* name : {"base", "arm", "boom", "wheel", "a_guest"}) {
      const UserBody &x = changed.sim.model().user[static_cast<std::size_t>(changed.sim.model().find_body(name))],
                     &y = to.user[static_cast<std::size_t>(to.find_body(name))];
      for (int i = 0; i < x.nv; ++i)
        EXPECT_NEAR(changed.sim.state().v[x.v + i], fresh.sim.state().v[y.v + i], method == "rk4" ? 1e-12 : 1e-7) << method << " " << name;
    }
  }
}

TEST(Adopt, CoordinatesOfModesAreCarriedWhereTheyMeanTheSame) {
  SystemSpec spec = vehicle(), stiffer = vehicle();
  ModalData data = *spec.bodies[3].modal;
  data.K(0, 0) *= 2.0;
  stiffer.bodies[3].modal = std::make_shared<const ModalData>(data);
  const auto a = compiled(spec), b = compiled(stiffer);
  const ModelMap map = model_map(*a, *b);
  const UserBody& boom = a->user[3];
  EXPECT_EQ(map.q[static_cast<std::size_t>(boom.eta)], -1);
  EXPECT_EQ(map.q[static_cast<std::size_t>(boom.eta) + 1], b->user[3].eta + 1);
}

/// How long it is in the file tells where it begins alone: what it has become stays, and goes on by its profile.
TEST(Adopt, ALengthThatIsGivenGoesOnFromWhereItIs) {
  Simulation sim(compiled(mass_on_a_string({0.0, 1.5, 0.0})), ChangingScene::options("dopri5"));
  sim.prescribe_loop("string", MotionProfile::rate_table({{0.0, 0.0}, {1.0, 0.2}}));
  SystemSpec longer = mass_on_a_string({0.0, 1.5, 0.0});
  longer.bodies[0].hinge.q = {1.3, 0.0, 0.0}, longer.loops[0].length = 1.3;
  sim.every({1, 1}, [&] {
    if (sim.time() == 1.0) sim.adopt(compiled(longer));
  });
  sim.run(2.0);
  EXPECT_NEAR(sim.state().q.norm(), 1.0 + 0.1 + 0.2, 1e-12);
}

/// What is missing before another vehicle is there is missing after it, however much that has.
TEST(Balances, WhatIsMissingStaysMissing) {
  const auto momentum = [](double x) {
    return Momentum{.linear = {x, 0, 0}, .angular = {0, x, 0}, .linear_magnitude = 8, .angular_magnitude = 8};
  };
  const auto energy = [](double x) { return Energy{.kinetic = x, .magnitude = 8}; };
  const Balances::Integrals none = Balances::Integrals::Zero();
  Balances balances;
  balances.begin(momentum(4.0), energy(4.0));
  balances.look(momentum(4.5), energy(4.5), none, none, {}, 1e-9);
  balances.go_on(momentum(7.0), energy(7.0));
  const LedgerState l = balances.look(momentum(7.0), energy(7.0), none, none, {}, 1e-9);
  EXPECT_EQ(l.linear[0], 0.5);
  EXPECT_EQ(l.angular[1], 0.5);
  EXPECT_EQ(l.energy, 0.5);
  EXPECT_FALSE(l.pass);
}

TEST(Balances, WhatIntegralsMayBeOffByAddsUp) {
  const Momentum p{.linear = {4, 0, 0}, .angular = {0, 4, 0}, .linear_magnitude = 8, .angular_magnitude = 8};
  const Energy e{.kinetic = 4, .magnitude = 8};
  const Balances::Integrals none = Balances::Integrals::Zero(), off = Balances::Integrals::Constant(1e-3);
  Balances balances;
  balances.begin(p, e);
  const LedgerState first = balances.look(p, e, none, off, {}, 0.0);
  balances.go_on(p, e);
  const LedgerState both = balances.look(p, e, none, off, {}, 0.0);
  EXPECT_NEAR(both.linear_limit, 2 * first.linear_limit, 1e-6 * first.linear_limit);
  EXPECT_NEAR(both.angular_limit, 2 * first.angular_limit, 1e-6 * first.angular_limit);
  EXPECT_NEAR(both.energy_limit, 2 * first.energy_limit, 1e-6 * first.energy_limit);
}

/// A balance that failed once has failed, and what is missing is over the largest that there ever was.
TEST(Balances, KnowTheWorstOfAllLooks) {
  const auto momentum = [](double x, double size) {
    return Momentum{.linear = {x, 0, 0}, .angular = {0, x, 0}, .linear_magnitude = size, .angular_magnitude = size};
  };
  const auto energy = [](double x, double size) { return Energy{.kinetic = x, .magnitude = size}; };
  const Balances::Integrals none = Balances::Integrals::Zero();
  Balances balances;
  balances.begin(momentum(4.0, 8), energy(4.0, 8));
  EXPECT_FALSE(balances.look(momentum(4.5, 8), energy(4.5, 8), none, none, {}, 1e-9).pass);
  EXPECT_TRUE(balances.look(momentum(4.0, 80), energy(4.0, 80), none, none, {}, 1e-9).pass);
  EXPECT_FALSE(balances.worst().pass);
  EXPECT_EQ(balances.worst().linear_relative, 0.5 / 8);
  const LedgerState later = balances.look(momentum(4.5, 8), energy(4.5, 8), none, none, {}, 1e-9);
  EXPECT_EQ(later.linear_relative, 0.5 / 80);
  EXPECT_EQ(later.energy_relative, 0.5 / 80);
}

/// Ten times what the errors of the steps are of each sum, of the energy twice that as of a square; and rounding, of far places too.
TEST(Balances, AllowWhatStepsAndRoundingExplain) {
  const Momentum p{.linear_magnitude = 8, .angular_magnitude = 2, .angular_parts = 1e9};
  const Energy e{.magnitude = 4};
  const Balances::Integrals none = Balances::Integrals::Zero();
  Balances balances;
  balances.begin(p, e);
  IntegratorStatistics counts;
  counts.error_sum = 3.0, counts.steps = 900;
  const double relative = 1e-7, round_off = 4.0 * std::numeric_limits<double>::epsilon() * 1000.0;
  const LedgerState l = balances.look(p, e, none, none, counts, relative);
  EXPECT_NEAR(l.linear_limit, 10.0 * 3.0 * relative + round_off, 1e-18);
  EXPECT_NEAR(l.angular_limit, 10.0 * 3.0 * relative + round_off * 1e9 / 2.0, 1e-16);
  EXPECT_NEAR(l.energy_limit, 10.0 * 3.0 * 2.0 * relative + round_off, 1e-18);
}

TEST(Adopt, ARunThatHadAnotherVehicleIsNotResumedWithOne) {
  ChangingScene changed(vehicle()), fresh(vehicle());
  changed.adopt_at({1, 2}, vehicle());
  changed.sim.run(1.0);
  EXPECT_THROW(fresh.sim.resume(changed.sim.checkpoint()), CheckpointFault);
}

TEST(Adopt, WhatTheRunMayReferToMustBeThere) {
  const auto refused = [](const auto& change) {
    ChangingScene scene(that_remembers());
    SystemSpec other = that_remembers();
    change(other);
    const auto model = compiled(other, {.node_wrenches = true, .world_wrenches = true});
    try {
      scene.sim.adopt(model);
    } catch (const InputError& e) {
      const Diagnostic& d = e.diagnostics().at(0);
      return std::string(number_of(d.code)) + " " + d.at.key_path;
    }
    return std::string("taken");
  };
  EXPECT_EQ(refused([](SystemSpec&) {}), "taken");
  EXPECT_EQ(refused([](SystemSpec& s) { s.bodies.erase(s.bodies.begin() + 2); }), "C0403 bodies.wheel");
  EXPECT_EQ(refused([](SystemSpec& s) { s.bodies[1].hinge.type = "prismatic"; }), "C0403 bodies.arm.hinge");
  EXPECT_EQ(refused([](SystemSpec& s) { std::erase_if(s.devices, [](const DeviceSpec& d) { return d.name == "momentum"; }); }),
            "C0403 devices.momentum");
  EXPECT_EQ(refused([](SystemSpec& s) {
              for (DeviceSpec& d : s.devices)
                if (d.name == "gyro") d.period = 0.25;
            }),
            "C0403 devices.gyro.rate");
  EXPECT_EQ(refused([](SystemSpec& s) {
              DeviceSpec more = device("second", "imu", {}, {{"at", "base"}});
              more.period = 0.25;
              s.devices.push_back(more);
            }),
            "C0403 devices.second");
  EXPECT_EQ(refused([](SystemSpec& s) {
              for (DeviceSpec& d : s.devices)
                if (d.name == "jet") d.inputs["command"].delay = 9;
            }),
            "C0403 devices.jet.inputs");
}

}  // namespace
}  // namespace cardan::test
