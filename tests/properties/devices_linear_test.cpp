// Devices in linear models of the whole and of a part, and in the modes of the system.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <random>

#include "core/operators/linear_model.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/simulation.hpp"
#include "tests/operators/compare.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

using operators::system_modes;
using operators::SystemModes;
using operators::SystemModesOptions;
using operators::TreeOperators;

operators::LinearModel linear_of(Simulation& sim, const TreeOperators& tree, const operators::LinearPorts& ports) {
  const std::vector<double> tau = sim.applied_forces();
  return operators::linearize(
      tree, {.q = sim.state().q.data(), .v = sim.state().v.data(), .tau = tau.data(), .wrenches = sim.wrenches(), .devices = sim.devices()},
      ports);
}

/// By the same names.
double apart_by_name(const operators::LinearModel& part, const operators::LinearModel& whole) {
  const auto places = [](const operators::SpaceLabels& of, const operators::SpaceLabels& in) {
    std::vector<int> out;
    for (const std::string& name : of.names) {
      const auto at = std::ranges::find(in.names, name);
      EXPECT_NE(at, in.names.end()) << name;
      out.push_back(static_cast<int>(at - in.names.begin()));
    }
    return out;
  };
  const std::vector<int> x = places(part.states, whole.states), u = places(part.inputs, whole.inputs),
                         y = places(part.outputs, whole.outputs);
  const auto error = [](const MatrixXd& a, const MatrixXd& b) { return distance(a, b) / (1.0 + largest(b)); };
  return worse({error(part.A, whole.A(x, x)), error(part.B, whole.B(x, u)), error(part.C, whole.C(y, x)), error(part.D, whole.D(y, u)),
                error(part.drift, whole.drift(x)), error(part.y0, whole.y0(y))});
}

/// A subtree on bodies that stand still is the vehicle with their hinges locked; all bodies are the whole vehicle.
TEST(Devices, TakePartInLinearModelsOfAPart) {
  int compared = 0;
  for (const double flexible : {0.0, 0.4})
    for_all_trees({.bodies = 6, .flexible = flexible, .springs = true}, 1e-9, [&](const RandomTree& tree) {
      const SystemSpec spec = with_followers(tree.spec, tree.seed);
      Simulation sim(compiled(spec), {});
      const Model& m = sim.model();
      TreeOperators ops(sim.shared_model());
      ops.at(sim.state().q.data());
      const double condition = [&] {
        Workspace ws(m);
        return scaled_condition(mass_matrix(m, ws, sim.state().q.data()));
      }();
      std::vector<int> all;
      for (int k = 1; k < static_cast<int>(m.bodies.size()); ++k) all.push_back(k);
      const TreeOperators same = ops.subgraph(all);
      EXPECT_FALSE(same.whole());
      const operators::LinearPorts ports{{"wheel:torque"}, {"wheel:rate"}};
      double worst = apart_by_name(linear_of(sim, same, ports), linear_of(sim, ops, ports));
      if (flexible > 0.0 || m.bodies.size() < 3) return worst / condition;

      const int some = 1 + static_cast<int>(tree.seed % (m.bodies.size() - 1));
      const TreeOperators part = ops.subgraph(ops.subtree(some));
      if (part.size(operators::Space::hinge) == 0) return worst / condition;
      SystemSpec locked = spec;
      for (BodySpec& b : locked.bodies) {
        const UserBody& u = m.user[static_cast<std::size_t>(m.find_body(b.name))];
        if (part.index_of(u.sweep) >= 0) continue;
        b.hinge.locked = true;
        std::ranges::fill(b.hinge.v, 0.0);
      }
      std::erase_if(locked.devices, [&](const DeviceSpec& d) {  // friction of a hinge that is locked
        const auto at = d.mounts.find("at");
        return d.type == "lugre_friction" &&
               part.index_of(
                   m.user[static_cast<std::size_t>(m.find_body(at->second.target.substr(0, at->second.target.find('.'))))].sweep) < 0;
      });
      const operators::LinearModel of_part = linear_of(sim, part, {});
      Simulation still(compiled(locked), {});
      TreeOperators alone(still.shared_model());
      alone.at(still.state().q.data());
      operators::LinearPorts outputs;
      outputs.outputs = linear_of(still, alone, {}).states.names;
      worst = worse(worst, apart_by_name(of_part, linear_of(still, alone, outputs)));
      ++compared;
      return worst / condition;
    });
  EXPECT_GT(compared, 10);
}

/// What is told to a wheel and what it tells, by half: B and C of the linear model.
TEST(Devices, HaveFaultsOfPortsInLinearModels) {
  SystemSpec spec = system({on(rigid("bus", 20.0, {0, 0, 0}, diagonal({2, 3, 4})), "", "free")});
  spec.devices = {device("wheel", "momentum_wheel", {{"inertia", 0.05}, {"viscous", 0.01}}, {{"at", "bus"}})};
  const auto linear = [&spec](bool faulty) {
    Simulation sim(compiled(spec), {});
    sim.set_device_input(0, 0.4);
    if (faulty) {
      PortFault in{.device = 0, .input = true}, out{.device = 0, .place = 1};
      in.scale = 0.5, in.bias = 0.2, out.scale = -3.0;
      sim.fault(in), sim.fault(out);
    }
    TreeOperators ops(sim.shared_model());
    ops.at(sim.state().q.data());
    return linear_of(sim, ops, {{"wheel:torque"}, {"wheel:rate"}});
  };
  const operators::LinearModel sound = linear(false), faulty = linear(true);
  EXPECT_GT(largest(sound.B), 1e-2);
  EXPECT_LT(distance(faulty.B, 0.5 * sound.B), 1e-15);
  EXPECT_LT(distance(faulty.C, -3.0 * sound.C), 1e-14);
  EXPECT_LT(distance(faulty.A, sound.A), 1e-15);
  EXPECT_LT(distance(faulty.drift, sound.drift), 1e-15) << "0.5 * 0.4 + 0.2 is 0.4";
}

/// What varies the mass of a body has rates that blocks of a part do not.
TEST(Devices, ThatCarryMassRefuseLinearModelsOfAPart) {
  SystemSpec spec = system({on(rigid("bus", 20.0, {0, 0, 0}, diagonal({2, 3, 4})), "", "free"),
                            on(rigid("drum", 5.0, {0.1, 0, 0}, diagonal({1, 1, 1})), "bus", "revolute", {{0, 0, 1}})});
  spec.devices = {device("tank", "tank", {{"radius", 0.2}, {"density", 1000.0}, {"pressure", 20.0}, {"loaded", 2.0}}, {{"at", "drum"}})};
  Simulation sim(compiled(spec), {});
  TreeOperators ops(sim.shared_model());
  ops.at(sim.state().q.data());
  try {
    linear_of(sim, ops.subgraph(ops.subtree(2)), {});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::unsupported);
    EXPECT_NE(std::string(e.what()).find("tank carries mass of drum"), std::string::npos) << e.what();
  }
}

/// Devices at the marks and inputs of a simulation at rest.
SystemModes modes_with_devices(Simulation& sim, const SystemModesOptions& options = {}) {
  TreeOperators ops(sim.shared_model());
  ops.at(sim.state().q.data());
  SystemModesOptions with = options;
  with.devices = sim.devices();
  return system_modes(ops, with);
}

TEST(SystemModes, OfTwoMassesOnADevice) {
  const double m = 2.0, M = 5.0, k = 30.0, c = 0.7, mu = m * M / (m + M);
  BodySpec a = on(particle("a", m, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  BodySpec b = on(particle("b", M, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}, {1.2, 0, 0});
  SystemSpec spec = system({a, b});
  spec.devices = {device("link", "spring_damper", {{"stiffness", k}, {"rest", 1.2}, {"damping", c}}, {{"from", "a"}, {"to", "b"}})};
  Simulation sim(compiled(spec), {});
  const SystemModes modes = modes_with_devices(sim);
  ASSERT_EQ(modes.n_rigid, 1);
  ASSERT_EQ(modes.frequency.size(), 2);
  EXPECT_EQ(modes.frequency[0], 0.0);
  EXPECT_NEAR(modes.frequency[1], std::sqrt(k / mu) / (2 * std::numbers::pi), 1e-14);
  EXPECT_NEAR(modes.damping[1], c / (2 * std::sqrt(k * mu)), 1e-14);
  EXPECT_NEAR(modes.shapes(0, 0) - modes.shapes(1, 0), 0.0, 1e-14);          // both move alike
  EXPECT_NEAR(m * modes.shapes(0, 1) + M * modes.shapes(1, 1), 0.0, 1e-13);  // momentum
  EXPECT_NEAR(modes.kinetic(0, 1), M / (m + M), 1e-14);
  TreeOperators bare(sim.shared_model());
  bare.at(sim.state().q.data());
  EXPECT_EQ(system_modes(bare).n_rigid, 2);
}

// A bead across a string under tension T on both sides, l long: omega^2 = 2 T / (l m); along it 2 k / m, with its carrier.
TEST(SystemModes, OfABeadOnATautString) {
  const double mass = 0.4, carrier = 0.3, k = 50.0, rest = 0.9, l = 1.3, T = k * (l - rest);
  SystemSpec spec = system({on(particle("post_1", 1.0, {0, 0, 0}), "", "locked", {}, {-l, 0, 0}),
                            on(particle("post_2", 1.0, {0, 0, 0}), "", "locked", {}, {l, 0, 0}),
                            on(particle("carrier", carrier, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}),
                            on(particle("bead", mass, {0, 0, 0}), "carrier", "prismatic", {{0, 1, 0}})});
  for (const char* side : {"1", "2"})
    spec.devices.push_back(device(std::string("string_") + side, "spring_damper", {{"stiffness", k}, {"rest", rest}},
                                  {{"from", std::string("post_") + side}, {"to", "bead"}}));
  Simulation sim(compiled(spec), {});
  const SystemModes modes = modes_with_devices(sim);
  ASSERT_EQ(modes.n_rigid, 0);
  ASSERT_EQ(modes.frequency.size(), 2);
  EXPECT_NEAR(modes.frequency[0], std::sqrt(2 * T / (l * mass)) / (2 * std::numbers::pi), 1e-13);
  EXPECT_NEAR(modes.frequency[1], std::sqrt(2 * k / (mass + carrier)) / (2 * std::numbers::pi), 1e-13);

  // Pressed together it flies off sideways, however far it is from that along the string.
  for (DeviceSpec& d : spec.devices) d.params["rest"] = number(1.6);
  Simulation pressed(compiled(spec), {});
  try {
    modes_with_devices(pressed);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::unsupported);
    EXPECT_NE(std::string(e.what()).find("an equilibrium that is not stable"), std::string::npos) << e.what();
  }
}

// What a spring between places of one body would strain is nothing, whatever rounding makes of it; beside a mode that is there.
TEST(SystemModes, OfASpringThatNothingStrains) {
  BodySpec body = on(rigid("body", 2.0, {0.3, 0.1, 0}, diagonal({1, 2, 3})), "", "free");
  NodeSpec a, b;
  a.name = "a", a.position = {0.7, -0.3, 0.2}, b.name = "b", b.position = {-0.5, 0.4, 0.9};
  body.nodes = {a, b}, body.hinge.q = {0.8, 0.36, -0.48, 0, 3, 7, -2};
  BodySpec disc = on(rigid("disc", 1.0, {0, 0, 0}, diagonal({0.1, 0.1, 0.2})), "body", "revolute", {{0, 0, 1}}, {0.7, -0.3, 0.2});
  SystemSpec spec = system({body, disc});
  spec.devices = {device("inside", "spring_damper", {{"stiffness", 500}, {"rest", 1.0}}, {{"from", "body.a"}, {"to", "body.b"}}),
                  device("pivot", "spring_damper", {{"stiffness", 500}, {"rest", 1.0}}, {{"from", "disc"}, {"to", "body.b"}})};
  Simulation sim(compiled(spec), {});
  const SystemModes modes = modes_with_devices(sim);
  EXPECT_EQ(modes.n_rigid, 7);
  EXPECT_EQ(modes.frequency.size(), 7);
}

// Springs between any nodes at their rest length, on any tree at rest: the modes are the poles of the linear model.
TEST(SystemModes, WithDevicesAreThePolesOfTheLinearModel) {
  for_all_trees({.bodies = 6, .flexible = 0.0}, 1e-9, [](const RandomTree& tree) {
    SystemSpec spec = tree.spec;
    spec.gravity = {};
    for (BodySpec& b : spec.bodies) std::ranges::fill(b.hinge.v, 0.0);
    const auto nodes = compiled(spec)->nodes;
    std::mt19937 random(tree.seed);
    for (int i = 0; i < 3; ++i) {
      const std::string from = nodes[random() % nodes.size()].name, to = nodes[random() % nodes.size()].name;
      if (from != to)
        spec.devices.push_back(device(fmt::format("spring_{}", i), "spring_damper", {{"stiffness", 3.0 + 5 * i}, {"rest", 1.0}},
                                      {{"from", from}, {"to", to}}));
    }
    Simulation loose(compiled(spec), {});
    for (std::size_t i = 0; i < spec.devices.size(); ++i)
      spec.devices[i].params["rest"] = number(loose.device_output(loose.model().devices.all[i].out));
    Simulation sim(compiled(spec), {});
    const int nv = sim.model().nv;
    if (nv == 0) return 0.0;
    const SystemModes modes = modes_with_devices(sim, {.elastic = nv, .rigid = nv});
    TreeOperators ops(sim.shared_model());
    ops.at(sim.state().q.data());
    const auto poles = operators::poles(linear_of(sim, ops, {}).A);
    if (modes.frequency.size() != nv || poles.size() != static_cast<std::size_t>(2 * nv)) return HUGE_VAL;
    const auto squared = [](double f) { return f * f; };  // the eigenvalue: rounding is of the largest
    double worst = 0.0;
    for (int j = 0; j < nv; ++j)
      for (const int of_pair : {0, 1})
        worst = worse(worst, std::abs(squared(poles[static_cast<std::size_t>(2 * j + of_pair)].frequency) - squared(modes.frequency[j])));
    return worst / std::max(squared(modes.frequency[nv - 1]), 1e-6);
  });
}

}  // namespace
}  // namespace cardan::test
