// Devices: published values, closed forms, and what must hold on any tree.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/abi/device_family.hpp"
#include "core/base/noise.hpp"
#include "core/operators/linear_model.hpp"
#include "core/sim/newton_operators.hpp"
#include "core/sim/reference_check.hpp"
#include "core/sim/simulation.hpp"
#include "core/soa/tangent.hpp"
#include "tests/operators/compare.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {
namespace {

/// Hinges whose velocities are rates of their coordinates.
const std::vector<std::string> kTurning = {"revolute", "universal", "gimbal"};

/// Two masses that fly free, joined by a spring of their distance: they swing at sqrt(k / mu) about the rest length, mu = m M / (m + M).
TEST(SpringDamper, TwoFreeMassesSwingAtTheirFrequency) {
  const double m = 2.0, M = 5.0, k = 30.0, rest = 1.2, stretch = 0.3, omega = std::sqrt(k * (m + M) / (m * M));
  BodySpec a = on(rigid("a", m, {0, 0, 0}, diagonal({0.1, 0.2, 0.25})), "", "free");
  BodySpec b = on(rigid("b", M, {0, 0, 0}, diagonal({0.3, 0.4, 0.5})), "", "free");
  b.hinge.q = {1, 0, 0, 0, rest + stretch, 0, 0};
  SystemSpec spec = system({a, b});
  spec.devices = {device("link", "spring_damper", {{"stiffness", k}, {"rest", rest}}, {{"from", "a"}, {"to", "b"}})};
  Simulation sim(compiled(spec), accurate());
  sim.run(1.7);
  const double distance = sim.state().q[11] - sim.state().q[4];
  EXPECT_NEAR(distance, rest + stretch * std::cos(omega * 1.7), 1e-9);  // a hundred times the tolerance
  EXPECT_NEAR(sim.device_output(0), distance, 1e-14);
  EXPECT_NEAR(sim.device_output(1), k * (distance - rest), 1e-12);
  EXPECT_TRUE(sim.ledger().pass);
}

/// A mass dragged by a spring whose other end moves at 0.1 m/s sticks and slips. Numbers of two step sizes of an independent program:
/// 1 kg, 2 N/m, sigma_0 1e5, sigma_1 sqrt(1e5), sigma_2 0.4, 1 and 1.5 N, 0.001 m/s: the speed rises through 0.05 m/s at 7.54040 s and
/// every 6.36272 s from then on; its largest is 0.369816 m/s.
TEST(LugreFriction, SticksAndSlipsAsPublished) {
  BodySpec mass = on(particle("mass", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  BodySpec carriage = on(particle("carriage", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}, {10, 0, 0});
  carriage.hinge.v = {0.1}, carriage.hinge.prescribed = {0};
  SystemSpec spec = system({mass, carriage});
  spec.devices = {device("spring", "spring_damper", {{"stiffness", 2.0}, {"rest", 10.0}}, {{"from", "mass"}, {"to", "carriage"}}),
                  device("friction", "lugre_friction",
                         {{"coulomb", 1.0},
                          {"breakaway", 1.5},
                          {"stribeck_rate", 0.001},
                          {"stiffness", 1e5},
                          {"damping", std::sqrt(1e5)},
                          {"viscous", 0.4}},
                         {{"at", "mass"}})};
  SimulationOptions options = accurate("cvode_bdf");
  options.integrator.relative_tolerance = 1e-9;
  Simulation sim(compiled(spec), options);
  std::vector<double> slips;
  double fastest = 0.0;
  sim.add_event({"slips", [](double, const double*, const double* v) { return v[0] - 0.05; }, +1, [&] { slips.push_back(sim.time()); }});
  sim.run(22.0, [&](double) { fastest = std::max(fastest, sim.state().v[0]); });
  ASSERT_EQ(slips.size(), 3U);
  EXPECT_NEAR(slips[0], 7.54040, 2e-5);  // half of the last digit given, four times for the tolerance of the run
  EXPECT_NEAR(slips[1] - slips[0], 6.36272, 2e-5);
  EXPECT_NEAR(slips[2] - slips[1], 6.36272, 2e-5);
  EXPECT_NEAR(fastest, 0.369816, 1e-4);  // at step ends
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
}

/// The same wheel as a body on a hinge, whose carrier then lacks its mass and transverse inertia.
TEST(MomentumWheel, IsARotorOnABearing) {
  const double J = 0.05, transverse = 0.03, mass = 2.0, viscous = 0.002, torque = 0.01;
  const Eigen::Vector3d place(0.2, -0.1, 0.3), axis = Eigen::Vector3d(1, 2, -2).normalized();
  BodySpec bus = on(rigid("bus", 20.0, {0.05, 0, 0}, diagonal({3, 4, 5})), "", "free");
  bus.hinge.v = {0.3, -0.2, 0.4, 0, 0, 0};
  const double spin = 40.0;
  // As a body: axis z of its own frame along `axis`.
  BodySpec rotor = on(rigid("rotor", mass, {0, 0, 0}, diagonal({transverse, transverse, J})), "bus", "revolute", {{0, 0, 1}}, place);
  rotor.hinge.onode_R.col(2) = axis;
  rotor.hinge.onode_R.col(0) = axis.unitOrthogonal();
  rotor.hinge.onode_R.col(1) = axis.cross(rotor.hinge.onode_R.col(0));
  rotor.hinge.v = {spin};
  SpringDamper bearing;
  bearing.damping = viscous;
  rotor.hinge.springs = {bearing};
  Simulation as_body(compiled(system({bus, rotor})), accurate());
  as_body.set_force(6, torque);
  // As a device: the carrier has its mass, and its inertia but for J along the axis.
  const Eigen::Matrix3d left = transverse * (Eigen::Matrix3d::Identity() - axis * axis.transpose());
  const double total = 22.0;
  const Eigen::Vector3d com = (20.0 * Eigen::Vector3d(0.05, 0, 0) + mass * place) / total;
  const auto about = [](double m, const Eigen::Vector3d& r) {
    return Eigen::Matrix3d(m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose()));
  };
  BodySpec carrier =
      on(rigid("bus", total, com, diagonal({3, 4, 5}) + left + about(20.0, Eigen::Vector3d(0.05, 0, 0) - com) + about(mass, place - com)),
         "", "free");
  carrier.hinge.v = bus.hinge.v;
  NodeSpec node;
  node.name = "wheel", node.position = place;
  carrier.nodes = {node};
  SystemSpec spec = system({carrier});
  DeviceSpec wheel = device("wheel", "momentum_wheel", {{"inertia", J}, {"viscous", viscous}}, {{"at", "bus.wheel"}});
  wheel.params["axis"].value = std::vector<double>(axis.data(), axis.data() + 3);
  wheel.inputs["torque"] = {torque, {}};
  wheel.initial["momentum"] = number(J * (spin + axis.dot(Eigen::Vector3d(0.3, -0.2, 0.4))));
  spec.devices = {wheel};
  Simulation as_device(compiled(spec), accurate());
  as_body.run(5.0), as_device.run(5.0);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(as_device.state().v[i], as_body.state().v[i], 1e-9) << i;
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(as_device.state().q[i], as_body.state().q[i], 1e-9) << i;
  EXPECT_NEAR(as_device.device_output(1), as_body.state().v[6], 1e-8);
  const Momentum whole = as_device.momentum(), bodies = as_body.momentum();
  EXPECT_LT((whole.angular - bodies.angular).norm(), 1e-8 * bodies.angular.norm()) << "with what the wheel stores";
  EXPECT_GT((as_device.observe().momentum().angular - bodies.angular).norm(), 0.1) << "the carrier alone";
  EXPECT_TRUE(as_device.ledger().pass) << as_device.ledger().energy_relative << " of " << as_device.ledger().energy_limit;
  as_device.set_device_input(0, 0.5), as_device.run(6.0);
  EXPECT_TRUE(as_device.ledger().pass);
}

/// Driven by T it comes to its greatest rate as 1 - exp(-t / tau) / 100, tau = J W_max / (100 T), from 99 % of it on; it is braked by all
/// of T.
TEST(MomentumWheel, IsDrivenUpToItsGreatestRate) {
  const double J = 0.05, T = 0.2, most = 400.0, body = 3.0, reduced = 1.0 / (1.0 / J + 1.0 / body), tau = reduced * most / (100.0 * T);
  for (const double side : {1.0, -1.0}) {
    SystemSpec spec = system({on(rigid("bus", 20.0, {0, 0, 0}, diagonal({body, body, body})), "", "free")});
    DeviceSpec wheel = device("wheel", "momentum_wheel", {{"inertia", J}, {"max_torque", T}, {"max_rate", most}}, {{"at", "bus"}});
    wheel.inputs["torque"] = {side, {}};
    spec.devices = {wheel};
    Simulation sim(compiled(spec), accurate());
    const double fast = 0.99 * most * reduced / T;  // when it is there
    sim.run(0.5 * fast);
    EXPECT_NEAR(sim.device_output(1), 0.5 * 0.99 * most * side, 1e-8);
    sim.run(fast + 2.0 * tau);
    EXPECT_NEAR(sim.device_output(1), most * (1.0 - 0.01 * std::exp(-2.0)) * side, 1e-6);
    const double before = sim.device_output(1);
    sim.set_device_input(0, -side), sim.run(fast + 3.0 * tau);
    EXPECT_NEAR(sim.device_output(1), before - side * T / reduced * tau, 1e-6);
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  }
}

/// One that is faster than its motor drives it is left alone by it, and braked.
TEST(MomentumWheel, BeyondItsGreatestRateIsBrakedAlone) {
  const double J = 0.05, T = 0.2, most = 400.0;
  for (const double side : {1.0, -1.0}) {
    SystemSpec spec = system({on(rigid("bus", 20.0, {0, 0, 0}, diagonal({3, 3, 3})), "", "revolute", {{0, 0, 1}})});
    DeviceSpec wheel = device("wheel", "momentum_wheel", {{"inertia", J}, {"max_torque", T}, {"max_rate", most}}, {{"at", "bus"}});
    wheel.initial["momentum"] = number(1.05 * J * most * side), wheel.inputs["torque"] = {side * T, {}};
    spec.devices = {wheel};
    Simulation sim(compiled(spec), accurate());
    sim.run(1.0);
    EXPECT_EQ(sim.state().z[0], 1.05 * J * most * side);
    EXPECT_EQ(sim.device_output(0), sim.state().z[0]);
    sim.set_device_input(0, -side * T), sim.run(2.0);
    EXPECT_NEAR(sim.state().z[0], (1.05 * J * most - T) * side, 1e-12);
  }
}

/// v' of the sweeps with devices is that of the dense twin with the same loads.
TEST(Devices, AgreeWithTheDenseTwin) {
  for_all_trees(kAny, 1e-10, [](const RandomTree& tree) {
    Simulation sim(compiled(with_devices(tree.spec, tree.seed)), {});
    Output difference = reference_output(sim);
    double x = 0.0;
    difference.fill(&x);
    return x;
  });
}

/// Forces and moments of devices that join nodes of a tree add nothing to its momentum.
TEST(Devices, InternalOnesLeaveMomentumAlone) {
  for_all_trees(
      kAny, 1e-13,
      [](const RandomTree& tree) {
        Simulation sim(compiled(with_devices(tree.spec, tree.seed)), {});
        const Observer& o = sim.observe();
        const Force<double> stored = sim.devices()->storing_loads();  // goes to what wheels store
        Eigen::Vector3d force = -to_eigen(stored.f), moment = -to_eigen(stored.n);
        double size = 1e-30;
        for (const NodeWrench& w : sim.wrenches()) {
          const NodeState n = o.node(w.node);
          const Eigen::Vector3d f = n.R_WN * to_eigen(w.f.f), m = n.R_WN * to_eigen(w.f.n) + n.position.cross(f);
          force += f, moment += m;
          size += f.norm() * (1.0 + n.position.norm()) + m.norm();
        }
        return (force.norm() + moment.norm()) / size;
      },
      100);
}

/// Springs and a wheel on nodes; a device of every type that joins two bodies, on a component of a hinge each.
SystemSpec with_internal_devices(const RandomTree& tree) {
  SystemSpec spec = tree.spec;
  std::mt19937 random(tree.seed);
  const auto x = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  struct Component {
    std::string name;
    bool turns, coordinate;
  };
  std::vector<std::string> nodes;
  std::vector<Component> components;
  const auto bare = compiled(spec);
  for (const UserNode& n : bare->nodes) nodes.push_back(n.name);
  for (const UserBody& u : bare->user)
    for (int i = 0; i < u.nv && !spec.find(u.name)->hinge.inboard_body.empty(); ++i)
      components.push_back({u.name + "." + u.v_names[idx(i)], u.v_units[idx(i)] == "rad/s", u.nq == u.nv});
  DeviceSpec spring = device("spring", "spring_damper", {{"stiffness", x(1, 20)}, {"rest", x(0, 1)}, {"damping", x(0, 2)}},
                             {{"from", nodes.front()}, {"to", nodes.back()}});
  DeviceSpec wheel = device("wheel", "momentum_wheel", {{"inertia", 0.05}}, {{"at", nodes[random() % nodes.size()]}});
  wheel.inputs["torque"] = {x(-0.1, 0.1), {}};
  wheel.initial["momentum"] = number(x(-1, 1));
  spec.devices = {spring, wheel};
  std::ranges::shuffle(components, random);
  const std::vector<DeviceSpec> of_hinges = {
      device("bearing", "lugre_friction", {{"coulomb", 0.5}, {"stiffness", x(5, 20)}, {"damping", x(0, 1)}, {"viscous", 0.1}}, {}),
      device("blade", "tape_spring", {{"peak_moment", x(1, 4)}, {"peak_angle", 0.3}, {"steady_moment", 0.3}, {"damping", x(0, 0.1)}}, {}),
      device("catch", "latch", {{"place", x(-1, 1)}, {"max_rate", 1e3}, {"stiffness", x(1, 20)}, {"damping", x(0, 1)}}, {}),
      device("motor", "dc_motor", {{"constant", 0.3}, {"resistance", 1.5}, {"inductance", 0.1}, {"gear", 3}}, {}),
      device("brake", "dry_friction", {{"coulomb", x(0.1, 1)}, {"breakaway", 1.5}, {"viscous", x(0, 0.3)}}, {})};
  for (std::size_t i = 0; i < of_hinges.size(); ++i) {
    const std::string& type = of_hinges[i].type;
    const bool turns = type == "dc_motor" || type == "tape_spring", coordinate = type == "latch" || type == "tape_spring";
    for (std::size_t k = 0; k < components.size(); ++k) {
      const Component& c = components[(i + k) % components.size()];
      if ((turns && !c.turns) || (coordinate && !c.coordinate)) continue;
      spec.devices.push_back(of_hinges[i]);
      spec.devices.back().mounts["at"] = {c.name, {}};
      break;
    }
  }
  for (DeviceSpec& d : spec.devices) {
    if (d.name == "catch") d.initial["closed"] = number(1.0);
    if (d.name == "motor") d.initial["current"] = number(x(-2, 2)), d.inputs["voltage"] = {x(-5, 5), {}};
    if (d.name == "bearing") d.initial["bending"] = number(x(-0.02, 0.02));
  }
  return spec;
}

/// No force from outside: the rate of momentum by Newton's and Euler's equations of its bodies, from v', is what wheels take.
TEST(Devices, InternalOnesGiveAFreeTreeNoRateOfMomentum) {
  for_all_trees(
      {.bodies = 6, .roots = 1, .flexible = 0.0, .floating = true, .hinges = kTurning, .gravity = GravitySpec::Kind::none}, 1e-13,
      [](const RandomTree& tree) {
        const SystemSpec spec = with_internal_devices(tree);
        Simulation sim(compiled(spec), {});
        const Observer& o = sim.observe();
        const Force<double> stored = sim.devices()->storing_loads();
        Eigen::Vector3d force = -to_eigen(stored.f), moment = -to_eigen(stored.n);
        double size = 1e-30;
        for (const BodySpec& b : spec.bodies) {
          const NodeState n = o.node(sim.model().find_node(b.name));
          const Eigen::Vector3d w = n.velocity.head<3>(), alpha = n.acceleration.head<3>(), a = n.acceleration.tail<3>();
          const Eigen::Vector3d f = n.R_WN * (b.mass * (a + alpha.cross(b.com) + w.cross(w.cross(b.com))));
          const Eigen::Vector3d m = n.R_WN * (b.inertia_com * alpha + w.cross(b.inertia_com * w)), at = n.position + n.R_WN * b.com;
          force += f, moment += m + at.cross(f);
          size += f.norm() * (1.0 + at.norm()) + m.norm();
        }
        return (force.norm() + moment.norm()) / size;
      },
      100);
}

/// Nor do they give it momentum in a run. Its steps are too short for errors of the method: what is left is round-off.
TEST(Devices, InternalOnesKeepTheMomentumOfAFreeTree) {
  for_all_trees(
      {.bodies = 6, .roots = 1, .flexible = 0.3, .floating = true, .hinges = kTurning, .gravity = GravitySpec::Kind::none}, 1e-13,
      [](const RandomTree& tree) {
        SimulationOptions options = accurate("dop853", 1e-14);
        options.ledger = false;
        Simulation sim(compiled(with_internal_devices(tree)), options);
        const Momentum before = sim.momentum();
        sim.run(0.01);
        const Momentum after = sim.momentum();
        return worse((after.linear - before.linear).norm() / before.linear_magnitude,
                     (after.angular - before.angular).norm() / before.angular_magnitude);
      },
      100);
}

TEST(Devices, TakePartInTheJacobian) {
  for_all_trees(kAny, 1e-8, [](const RandomTree& tree) { return jacobian_error(with_devices(tree.spec, tree.seed)); });
}

/// Device types as C tables that give no derivative of their own.
const Registry& without_tangents() {
  static const std::vector<cardan_device_family> bare = [] {
    std::vector<cardan_device_family> all;
    for (const char* type : {"spring_damper", "lugre_friction", "momentum_wheel"}) {
      all.push_back(*registry().device(type));
      all.back().tangent = nullptr;
    }
    return all;
  }();
  static const Registry others = [] {
    Registry r = registry();
    r.devices = {};
    for (const auto& family : bare) r.devices.add(family);
    return r;
  }();
  return others;
}

TEST(Devices, WithoutATangentAreDifferentiated) {
  for_all_trees(kAny, 1e-8, [](const RandomTree& tree) {
    const SystemSpec spec = with_devices(tree.spec, tree.seed);
    Simulation exact(compiled(spec), krylov()), by_differences(compile(spec, without_tangents()), krylov());
    const OdeProblem a = exact.ode(), b = by_differences.ode();
    VectorXd x(a.n), d(a.n), out_a(a.n), out_b(a.n);
    x << exact.state().q, exact.state().v, exact.state().z;
    for (int i = 0; i < a.n; ++i) d[i] = 1e-3 * std::sin(2.7 * i + 0.3);
    if (!a.jacobian_times(0.0, x.data(), d.data(), out_a.data()) || !b.jacobian_times(0.0, x.data(), d.data(), out_b.data()))
      return HUGE_VAL;
    return apart(out_b, out_a);
  });
}

/// A spring between two that fly by themselves pulls alike wherever they are. In orbit places are known to 1e-9 m; differences move the
/// nodes by 1e-2 m, and where these pass at 7 km/s turn them by 1e-3 rad, which moves what is told of their velocities by 1e-2 m/s.
TEST(Devices, WithoutATangentAreDifferentiatedFarFromTheOrigin) {
  BodySpec bus = on(rigid("bus", 500, {0, 0, 0}, diagonal({120, 150, 130})), "", "free"),
           other = on(rigid("other", 50, {0.3, 0.2, 0}, diagonal({1, 1, 1})), "", "free");
  NodeSpec hook;
  hook.name = "hook", hook.position = {0, 1, 0}, bus.nodes = {hook};
  const auto slopes = [&](double away, double speed, const Registry& types) {
    bus.hinge.q = {1, 0, 0, 0, away, 0.7 * away, 0}, bus.hinge.v = {0, 0, 0, speed, 0, 0};
    other.hinge.q = {1, 0, 0, 0, away + 0.5, 0.7 * away, 0}, other.hinge.v = {0, 0, 0, speed, 0, 0};
    SystemSpec spec = system({bus, other});
    spec.devices = {
        device("stay", "spring_damper", {{"stiffness", 50}, {"damping", 5}, {"rest", 0.2}}, {{"from", "bus.hook"}, {"to", "other"}})};
    Simulation sim(compile(spec, types), {});
    const std::vector<double> tau = sim.applied_forces();
    const operators::LinearModel linear = operators::linearize(
        sim.model(),
        {.q = sim.state().q.data(), .v = sim.state().v.data(), .tau = tau.data(), .wrenches = sim.wrenches(), .devices = sim.devices()},
        {});
    const MatrixXd of_rates = linear.A.bottomRows<12>();
    return VectorXd(of_rates.reshaped());
  };
  const VectorXd here = slopes(0.0, 0.0, registry());
  EXPECT_GT(largest(here), 1.0);  // 1/s^2
  EXPECT_LE(largest(slopes(0.0, 0.0, without_tangents()) - here), 1e-11);
  EXPECT_LE(largest(slopes(7e6, 0.0, without_tangents()) - here), 2e-6);
  EXPECT_LE(largest(slopes(7e6, 7e3, without_tangents()) - here), 1e-5);
}

/// Columns of states of devices, and those of bodies with devices in motion, against differences of the right-hand side; an input and an
/// output of a device.
TEST(Devices, TakePartInLinearModels) {
  TreeOptions options;
  options.hinges = {"revolute", "prismatic", "cylindrical", "universal"};  // dtheta is dq
  // The rates of friction have a corner at zero, so differences take small steps: 1e-13 of v' over 2e-4, and sums of many bodies.
  for_all_trees(options, 1e-7, [](const RandomTree& tree) {
    const SystemSpec spec = with_followers(tree.spec, tree.seed);
    SimulationOptions plain;
    plain.ledger = false;
    Simulation sim(compiled(spec), plain);
    const OdeProblem ode = sim.ode();
    const Model& m = sim.model();
    const std::vector<double> tau = sim.applied_forces();
    const Device& wheel = m.devices.all[static_cast<std::size_t>(m.devices.find("wheel"))];
    const operators::LinearModel linear = operators::linearize(
        m, {.q = sim.state().q.data(), .v = sim.state().v.data(), .tau = tau.data(), .wrenches = sim.wrenches(), .devices = sim.devices()},
        {{"wheel:torque"}, {"wheel:rate"}});
    const int n = ode.n, nv = m.nv;
    VectorXd x(n), truth(n), work(n);
    x << sim.state().q, sim.state().v, sim.state().z;
    double worst = 0.0;
    for (int j = 0; j < n; ++j) {
      const double unit = j < 2 * nv ? 1.0 : 0.02;
      bool good = true;
      soa::derivative(
          [&](double h, double* out) {
            VectorXd at = x;
            at[j] += h * unit;
            good = good && ode.rhs(0.0, at.data(), out);
          },
          2e-4, n, truth.data(), work.data());
      worst = worse(worst, good ? distance(VectorXd(unit * linear.A.col(j)), truth) / (1.0 + largest(truth)) : HUGE_VAL);
    }
    sim.set_state(State(sim.state()));  // it was evaluated elsewhere
    const VectorXd before = sim.vdot();
    worst = worse(worst, std::abs(linear.y0[0] - sim.device_output(wheel.out + 1)) +
                             std::abs(linear.drift[n - 1] - sim.devices()->zdot()[n - 2 * nv - 1]));
    sim.set_device_input(wheel.in, sim.device_input(wheel.in) + 1.0);
    const VectorXd response = sim.vdot() - before;
    return worse(worst, distance(response, VectorXd(linear.B.col(0).segment(nv, nv))) / (1.0 + largest(response)));  // linear in the torque
  });
}

/// A spring across a ball hinge, whose nodes are where the hinge is: no line, no force of any direction that rounding has, no NaN in Jv.
TEST(Devices, ThatSpanNothingDoNothing) {
  BodySpec arm = on(rigid("arm", 2.0, {0.3, 0.1, -0.2}, diagonal({0.1, 0.2, 0.15})), "", "ball", {}, {0.31, 1.07, -0.53});
  BodySpec hand = on(rigid("hand", 1.0, {0.1, 0.2, 0.1}, diagonal({0.1, 0.1, 0.05})), "arm", "ball", {}, {0.23, 0.41, 0.17});
  arm.nodes = {{"wrist", {0.23, 0.41, 0.17}, Eigen::Matrix3d::Identity(), {}}};
  arm.hinge.q = {0.5, 0.1, -0.7, 0.5}, arm.hinge.v = {0.3, -0.2, 0.5}, hand.hinge.v = {-0.7, 0.4, 0.2};
  SystemSpec spec = system({arm, hand}, uniform_gravity({0.5, -0.3, -9.81}));
  const VectorXd bare = Simulation(compiled(spec), {}).vdot();
  for (const std::string type : {"spring_damper", "cable"}) {
    DeviceSpec spring = device("spring", type, {{"stiffness", 20.0}, {"damping", 1.0}}, {{"from", "arm.wrist"}, {"to", "hand"}});
    spring.params[type == "cable" ? "length" : "rest"] = number(type == "cable" ? 0.0 : 0.7);
    spec.devices = {spring};
    Simulation sim(compiled(spec), {});
    EXPECT_LT(apart(sim.vdot(), bare), 1e-14) << type;
    EXPECT_EQ(sim.device_output(0), 0.0) << type;
    EXPECT_LT(jacobian_error(spec), 1e-9) << type;
  }
}

/// Devices of a plugin made of the same sources give the same bits.
TEST(Devices, OfAPluginAreServedAsThoseBuiltIn) {
  static const Registry all = [] {
    Registry r = registry();
    load_plugin(CARDAN_BINARY_DIR "/plugins/twins.so", r);
    return r;
  }();
  for_all_trees(
      kAny, 0.0,
      [](const RandomTree& tree) {
        SystemSpec spec = with_devices(tree.spec, tree.seed);
        Simulation built_in(compile(spec, all), {});
        const VectorXd v = built_in.vdot();
        for (DeviceSpec& d : spec.devices) d.type = "twin/" + d.type;
        Simulation foreign(compile(spec, all), {});
        return distance(v, foreign.vdot());
      },
      20);
}

/// The order in which devices are described is that of states and results alone.
TEST(Devices, GiveTheSameBitsInAnyOrder) {
  for_all_trees(
      kAny, 0.0,
      [](const RandomTree& tree) {
        SystemSpec spec = with_devices(tree.spec, tree.seed);
        const auto first = compiled(spec);
        Simulation a(first, {});
        const VectorXd v = a.vdot();
        std::reverse(spec.devices.begin(), spec.devices.end());
        Simulation b(compiled(spec), {});
        return distance(v, b.vdot());
      },
      20);
}

// ---- sampled devices ----

/// Published answers: all zeros, all ones.
TEST(Noise, IsPhilox) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (std::array<std::uint32_t, 4>{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t f = 0xffffffff;
  EXPECT_EQ(philox({f, f, f, f}, {f, f}), (std::array<std::uint32_t, 4>{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
}

/// Mean 0, variance 1, fourth moment 3 of 2e5 numbers, and neighbours (in the tick, from tick to tick) without correlation: within five
/// standard deviations of each estimate.
TEST(Noise, IsNormalAndWhite) {
  constexpr int kTicks = 50'000, kEach = 4;
  const auto key = noise_key(7, "gyro");
  double sum = 0, square = 0, fourth = 0, within = 0, along = 0, before = 0;
  for (int k = 0; k < kTicks; ++k) {
    double x[kEach];
    normal_noise(key, static_cast<std::uint64_t>(k), kEach, x);
    for (const double one : x) sum += one, square += one * one, fourth += one * one * one * one;
    within += x[0] * x[1], along += x[0] * before, before = x[0];
  }
  const double n = kTicks * kEach;
  EXPECT_NEAR(sum / n, 0.0, 5.0 / std::sqrt(n));
  EXPECT_NEAR(square / n, 1.0, 5.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(fourth / n, 3.0, 5.0 * std::sqrt(96.0 / n));
  EXPECT_NEAR(within / kTicks, 0.0, 5.0 / std::sqrt(kTicks));
  EXPECT_NEAR(along / kTicks, 0.0, 5.0 / std::sqrt(kTicks));
}

/// A body that spins freely in orbit, the unit off its mass centre: the accelerometers read w x (w x r) alone, wherever gravity pulls.
TEST(Imu, ReadsRateAndSpecificForceInOrbit) {
  const Eigen::Vector3d w(0.0, 0.0, 0.3), r(0.4, -0.2, 0.1);
  BodySpec bus = on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "free");
  bus.hinge.q = {1, 0, 0, 0, 7e6, 0, 0};
  bus.hinge.v = {w[0], w[1], w[2], 0.0, 7546.0, 0.0};
  NodeSpec node;
  node.name = "imu", node.position = r;
  bus.nodes = {node};
  SystemSpec spec = system({bus}, central_gravity(3.986004415e14, false));
  spec.devices = {device("imu", "imu", {}, {{"at", "bus.imu"}})};
  spec.devices[0].rate = 10.0;
  Simulation sim(compiled(spec), accurate());
  sim.run(1.05);
  Simulation then(compiled(spec), accurate());
  then.run(1.0);  // the last sample
  // The node falls with the mass centre and not as it would by itself: the tide is 1e-7 m/s^2 for each 0.1 m.
  const Eigen::Vector3d centre = then.state().q.segment<3>(4), arm = quaternion(then.state().q.data()) * r, at = centre + arm;
  const auto pull = [](const Eigen::Vector3d& x) { return Eigen::Vector3d(-3.986004415e14 * x / std::pow(x.norm(), 3)); };
  const Eigen::Vector3d f = w.cross(w.cross(r)) + quaternion(then.state().q.data()).conjugate() * (pull(centre) - pull(at));
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sim.device_output(i), w[i], 1e-9);
    EXPECT_NEAR(sim.device_output(3 + i), f[i], 1e-8);  // 8 m/s^2 of gravity cancel
  }
  EXPECT_EQ(sim.state().marks[12], 11.0);   // at 0, 0.1 ... 1 s
  EXPECT_EQ(sim.statistics().restarts, 1);  // nothing that moves reads them
}

/// Each axis has its own errors: (1 + scale + skew) exp(-misalignment~), skew half of what pairs of axes lack to right angles. One number
/// stands for all axes.
TEST(Imu, ReadsWhatItsAxesSee) {
  using Eigen::Matrix3d, Eigen::Vector3d;
  const Vector3d w(0.2, -0.5, 0.3), m(0.02, -0.01, 0.3), lack(0.01, -0.02, 0.03), scale(1e-3, -2e-3, 3e-3), bias(0.01, 0.02, -0.03),
      r(0.4, -0.2, 0.1);
  BodySpec bus = on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 20})), "", "free");
  bus.hinge.v = {w[0], w[1], w[2], 0, 0, 0};
  NodeSpec node;
  node.name = "imu", node.position = r;
  bus.nodes = {node};
  SystemSpec spec = system({bus});
  spec.devices = {device("imu", "imu", {}, {{"at", "bus.imu"}})};
  spec.devices[0].rate = 1.0;
  const auto read = [&](const std::vector<std::pair<std::string, Vector3d>>& vectors) {
    spec.devices[0].params.clear();
    for (const auto& [key, x] : vectors) spec.devices[0].params[key].value = std::vector<double>{x[0], x[1], x[2]};
    Simulation sim(compiled(spec), accurate());
    sim.run(0.5);
    return Eigen::Vector<double, 6>::NullaryExpr([&](Eigen::Index i) { return sim.device_output(static_cast<int>(i)); }).eval();
  };
  const Vector3d f = w.cross(w.cross(r));
  const Matrix3d turn = Eigen::AngleAxisd(m.norm(), m.normalized()).toRotationMatrix().transpose();
  Matrix3d errors = scale.asDiagonal();
  errors(1, 2) = errors(2, 1) = 0.5 * lack[0], errors(0, 2) = errors(2, 0) = 0.5 * lack[1], errors(0, 1) = errors(1, 0) = 0.5 * lack[2];
  const Matrix3d seen = (Matrix3d::Identity() + errors) * turn;
  for (const std::string who : {"gyro", "accelerometer"}) {
    const auto got = read({{who + "_misalignment", m}, {who + "_nonorthogonality", lack}, {who + "_scale", scale}, {who + "_bias", bias}});
    const bool gyro = who == "gyro";
    EXPECT_LE((got.head<3>() - (gyro ? Vector3d(seen * w + bias) : w)).norm(), 1e-12);
    EXPECT_LE((got.tail<3>() - (gyro ? f : Vector3d(seen * f + bias))).norm(), 1e-12);
  }
  // Axes that lack an angle to a right one are that much nearer to each other.
  const auto row = [&](int i) { return Vector3d((Matrix3d::Identity() + errors).row(i).transpose()).normalized(); };
  EXPECT_NEAR(std::acos(row(1).dot(row(2))), 0.5 * M_PI - lack[0], 1e-3 * 0.03 + 0.03 * 0.03);

  spec.devices[0].params = {{"gyro_bias", number(0.25)}};
  Simulation all(compiled(spec), accurate());
  all.run(0.5);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(all.device_output(i), w[i] + 0.25, 1e-12);
  spec.devices[0].params["gyro_bias"].value = std::vector<double>{1.0, 2.0};
  std::string why;
  try {
    compiled(spec);
  } catch (const InputError& e) {
    why = e.what();
  }
  EXPECT_NE(why.find("a vector of 3 numbers, or one for all\n  got:      2 numbers"), std::string::npos) << why;
}

/// What nobody acts on takes no part in a right-hand side: no op for poses, the same evaluations.
TEST(Imu, CostsNoStep) {
  SystemSpec spec = system({on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "free")});
  spec.devices = {device("imu", "imu", {{"angle_random_walk", 1e-3}}, {{"at", "bus"}})};
  spec.devices[0].rate = 100.0;
  const auto model = compiled(spec);
  EXPECT_FALSE(model->has(OpCode::world));
  spec.devices.push_back(device("wheel", "momentum_wheel", {{"inertia", 0.1}}, {{"at", "bus"}}));
  EXPECT_TRUE(compiled(spec)->has(OpCode::world));
}

/// What hangs on hinges alone needs no pose of a node; without devices there is no op for them.
TEST(Devices, HaveTheOpsThatTheyNeed) {
  SystemSpec spec = system({on(rigid("arm", 3.0, {0.1, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}})});
  EXPECT_FALSE(compiled(spec)->has(OpCode::devices));
  EXPECT_FALSE(compiled(spec)->has(OpCode::world));
  spec.devices = {device("bearing", "lugre_friction", {{"coulomb", 0.2}, {"stiffness", 20}}, {{"at", "arm"}}),
                  device("brake", "dry_friction", {{"coulomb", 0.1}}, {{"at", "arm"}}),
                  device("motor", "dc_motor", {{"constant", 0.1}, {"resistance", 1}, {"inductance", 0.1}}, {{"at", "arm"}}),
                  device("blade", "tape_spring", {{"peak_moment", 4}, {"peak_angle", 0.1}, {"steady_moment", 1}}, {{"at", "arm"}}),
                  device("catch", "latch", {{"place", 1}, {"max_rate", 1}, {"stiffness", 10}}, {{"at", "arm"}})};
  EXPECT_TRUE(compiled(spec)->has(OpCode::devices));
  EXPECT_FALSE(compiled(spec)->has(OpCode::world));
  EXPECT_FALSE(compiled(spec, {.node_wrenches = false})->has(OpCode::node_wrenches));
  NodeSpec hook;
  hook.name = "hook", hook.position = {0.3, 0, 0};
  spec.bodies[0].nodes = {hook};
  spec.devices.push_back(device("stay", "spring_damper", {{"stiffness", 1}, {"rest", 0.1}}, {{"from", "arm"}, {"to", "arm.hook"}}));
  EXPECT_TRUE(compiled(spec)->has(OpCode::world));
}

/// Of the same density whatever the rate: samples scatter by N / sqrt(T), their mean over a second by N.
TEST(Imu, HasNoiseOfItsSpectralDensity) {
  const double N = 2e-3, wander = 0.05;
  for (const double rate : {10.0, 200.0}) {
    SystemSpec spec = system({on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "locked")});
    spec.devices = {device("imu", "imu", {{"angle_random_walk", N}, {"accelerometer_wander", wander}, {"accelerometer_wander_time", 2.0}},
                           {{"at", "bus"}})};
    spec.devices[0].rate = rate;
    const int seconds = 2000;
    double square = 0.0, of_means = 0.0, mean = 0.0, spread = 0.0, lagged = 0.0;
    std::vector<double> biases;
    int n = 0;
    const std::array<std::uint32_t, 2> key = noise_key(3, "imu");
    const cardan_device_family& imu = *registry().device("imu");
    // The unit by itself, at rest: what a simulation hands it.
    const auto model = compiled(spec);
    std::vector<double> marks = model->devices.marks0, noise(imu.n_noise), z;
    cardan_mount_motion still{};
    for (int k = 0; k < seconds * static_cast<int>(rate); ++k) {
      normal_noise(key, static_cast<std::uint64_t>(k), imu.n_noise, noise.data());
      const cardan_device_args at{sizeof at, 0.0, model->devices.all[0].packed.data(), nullptr, &still, nullptr, marks.data()};
      ASSERT_EQ(imu.tick(&at, 1.0 / rate, noise.data(), z.data(), marks.data()), 0);
      square += marks[0] * marks[0], mean += marks[0] / rate, ++n;
      biases.push_back(marks[9]);
      if (n % static_cast<int>(rate) == 0) of_means += mean * mean, mean = 0.0;
    }
    EXPECT_NEAR(std::sqrt(square / n), N * std::sqrt(rate), 5.0 * N * std::sqrt(rate) / std::sqrt(2.0 * n));
    EXPECT_NEAR(std::sqrt(of_means / seconds), N, 5.0 * N / std::sqrt(2.0 * seconds));
    const auto lag = static_cast<std::size_t>(2.0 * rate);  // over the wander time it keeps 1/e
    for (std::size_t i = 0; i + lag < biases.size(); ++i) spread += biases[i] * biases[i], lagged += biases[i] * biases[i + lag];
    // some 2000 s / 2 s independent stretches
    EXPECT_NEAR(std::sqrt(spread / static_cast<double>(biases.size() - lag)), wander, 5.0 * wander / std::sqrt(1000.0));
    EXPECT_NEAR(lagged / spread, std::exp(-1.0), 5.0 / std::sqrt(1000.0));
  }
}

/// From its first sample on a bias that wanders has the spread that it keeps, and all that is drawn is drawn by itself.
TEST(Imu, BeginsAnywhereInTheSpreadOfItsBias) {
  const double N = 2e-3, wander = 0.04, period = 0.01, variance = N * N / period + wander * wander;
  SystemSpec spec = system({on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "locked")});
  spec.devices = {device("imu", "imu",
                         {{"angle_random_walk", N},
                          {"gyro_wander", wander},
                          {"gyro_wander_time", 1e3},
                          {"velocity_random_walk", N},
                          {"accelerometer_wander", wander},
                          {"accelerometer_wander_time", 1e3}},
                         {{"at", "bus"}})};
  spec.devices[0].period = period;
  const auto model = compiled(spec);
  const cardan_device_family& imu = *registry().device("imu");
  const int units = 4000;
  Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
  for (unsigned seed = 0; seed < units; ++seed) {
    std::vector<double> marks = model->devices.marks0, noise(imu.n_noise), z;
    normal_noise(noise_key(seed, "imu"), 0, imu.n_noise, noise.data());
    cardan_mount_motion still{};
    const cardan_device_args at{sizeof at, 0.0, model->devices.all[0].packed.data(), nullptr, &still, nullptr, marks.data()};
    ASSERT_EQ(imu.tick(&at, period, noise.data(), z.data(), marks.data()), 0);
    const Eigen::Map<const Eigen::Vector<double, 6>> read(marks.data());
    sum += read * read.transpose();
  }
  for (int i = 0; i < 6; ++i)  // five standard deviations
    for (int j = 0; j < 6; ++j)
      EXPECT_NEAR(sum(i, j) / units, i == j ? variance : 0.0, 5.0 * variance * std::sqrt((i == j ? 2.0 : 1.0) / units));
}

/// Whichever of its six axes is at its end, it reads the end there and says so.
TEST(Imu, SaysThatAnAxisIsAtItsEnd) {
  for (int axis = 0; axis < 6; ++axis)
    for (const double x : {0.9, 1.1, -1.1}) {
      const bool turns = axis < 3;
      BodySpec bus = on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 20})), "", "free");
      Vector3d push = Vector3d::Zero();
      if (turns)
        bus.hinge.v = {0, 0, 0, 0, 0, 0}, bus.hinge.v[static_cast<std::size_t>(axis)] = x;
      else
        push[axis - 3] = x;
      SystemSpec spec = system({bus});
      spec.devices = {device("imu", "imu", {{"gyro_range", 1.0}, {"accelerometer_range", 1.0}}, {{"at", "bus"}})};
      spec.devices[0].rate = 10.0;
      Simulation sim(compiled(spec), accurate());
      sim.set_wrench(sim.add_wrench(sim.model().find_node("bus"), false),
                     {{0, 0, 0}, {100.0 * push.x(), 100.0 * push.y(), 100.0 * push.z()}});
      sim.run(0.05);
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(sim.device_output(i), i == axis ? std::clamp(x, -1.0, 1.0) : 0.0, 1e-12) << axis;
      EXPECT_EQ(sim.device_output(6), std::abs(x) < 1.0 ? 1.0 : 0.0) << axis << ", " << x;
    }
}

/// The same noise whatever else is described, at whatever places; another seed gives another.
TEST(Imu, HasNoiseOfItsOwn) {
  const auto reading = [](bool more, std::uint64_t seed) {
    SystemSpec spec = system({on(rigid("bus", 100.0, {0, 0, 0}, diagonal({20, 20, 30})), "", "free")});
    if (more) spec.devices.push_back(device("a_gyro", "imu", {{"angle_random_walk", 1e-3}}, {{"at", "bus"}}));
    spec.devices.push_back(device("gyro", "imu", {{"angle_random_walk", 1e-3}}, {{"at", "bus"}}));
    for (DeviceSpec& d : spec.devices) d.period = d.name == "gyro" ? 0.1 : 0.03;
    SimulationOptions options;
    options.seed = seed;
    Simulation sim(compiled(spec), options);
    sim.run(0.95);
    const Devices& devices = sim.model().devices;
    return sim.device_output(devices.all[static_cast<std::size_t>(devices.find("gyro"))].out);
  };
  EXPECT_EQ(reading(false, 1), reading(true, 1));
  EXPECT_NE(reading(false, 1), reading(false, 2));
  EXPECT_NE(reading(false, 1), 0.0);
}

// ---- devices of this test ----

struct None {};

/// y = 2 x: an output that needs its input in the same evaluation.
struct Gain {
  static constexpr const char *type = "gain", *summary = "y = 2 x";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_port_desc ports[] = {{"x", CARDAN_PORT_IN, "1", 0.0, 0, "input"}, {"y", CARDAN_PORT_OUT, "1", 0.0, 1, "output"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(2.0) * in.in[0];
  }
};

/// s' = x - s, y = s.
struct Lag {
  static constexpr const char *type = "lag", *summary = "s' = x - s";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_port_desc ports[] = {{"x", CARDAN_PORT_IN, "1", 0.0, 0, "input"}, {"y", CARDAN_PORT_OUT, "1", 0.0, 0, "output"}};
  static constexpr cardan_state_desc states[] = {{"s", "1", 0.0, 1.0, "state"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.zdot[0] = in.in[0] - in.z[0];
    out.out[0] = in.z[0];
  }
};

/// A force of 1 N from the place x = 1 of the hinge on: a corner that is a root, kept in a mark.
struct Push {
  static constexpr const char *type = "push", *summary = "pushes from x = 1 on";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD, "a slide"}};
  static constexpr cardan_state_desc marks[] = {{"on", "1", 0.0, 1.0, "pushes"}};
  static constexpr std::uint32_t n_roots = 1;
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.load[0].tau = T(in.d[0]);
  }
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.at[0].q - 1.0; }
  static void event(const Packed&, const DeviceIn<double>&, unsigned root, int direction, double*, double* d) noexcept {
    if (root == 0) d[0] = direction > 0 ? 1.0 : 0.0;
  }
};

/// The rate of a node about z: nothing that moves depends on it.
struct RateSensor {
  static constexpr const char *type = "rate_sensor", *summary = "rate about z";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY, "a node"}};
  static constexpr cardan_port_desc ports[] = {{"rate", CARDAN_PORT_OUT, "rad/s", 0.0, 0, "about z"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = in.at[0].omega.z;
  }
};

/// Notes the height of its node as it passes 1 m, and that it was started: a root that needs poses.
struct Gate {
  static constexpr const char *type = "gate", *summary = "notes when a node passes x = 1 m";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE, "a node"}};
  static constexpr cardan_state_desc marks[] = {{"started", "1", 0.0, 1.0, "times"}, {"height", "m", 0.0, 1.0, "z where it passed"}};
  static constexpr std::uint32_t n_roots = 1;
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.at[0].position.x - 1.0; }
  static void event(const Packed&, const DeviceIn<double>& in, unsigned root, int, double*, double* d) noexcept {
    if (root == n_roots)
      d[0] += 1.0;
    else
      d[1] = in.at[0].position.z;
  }
};

/// A force that is held between samples: what it is commanded at its ticks.
struct HeldForce {
  static constexpr const char *type = "held_force", *summary = "holds its command";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD, "a slide"}};
  static constexpr cardan_port_desc ports[] = {{"x", CARDAN_PORT_IN, "1", 0.0, 0, "command"}};
  static constexpr cardan_state_desc marks[] = {{"held", "1", 0.0, 1.0, "force"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.load[0].tau = T(in.d[0]);
  }
  static void tick(const Packed&, const DeviceIn<double>& in, double, const double*, double*, double* d) noexcept { d[0] = in.in[0]; }
};

/// Its output is no number from t = 1 s on.
struct Broken {
  static constexpr const char *type = "broken", *summary = "NaN from 1 s on";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_port_desc ports[] = {{"y", CARDAN_PORT_OUT, "1", 0.0, 0, "output"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.t < 1.0 ? 1.0 : std::nan(""));
  }
};

std::shared_ptr<const Model> with_own(const SystemSpec& spec) {
  Registry all = registry();
  for (const auto* family : {&device_table<Gain>(), &device_table<Lag>(), &device_table<Push>(), &device_table<RateSensor>(),
                             &device_table<Gate>(), &device_table<HeldForce>(), &device_table<Broken>()})
    all.devices.add(*family);
  return compile(spec, all);
}

SystemSpec slide(double speed) {
  BodySpec mass = on(particle("mass", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}});
  mass.hinge.v = {speed};
  return system({mass});
}

DeviceSpec block(const std::string& name, const std::string& type, const std::string& from) {
  DeviceSpec d = device(name, type, {}, {});
  d.inputs["x"] = {from, {}};
  return d;
}

/// b takes what a gives in the same evaluation, whatever their names: s' = 4 (s + 1) - s.
TEST(Devices, GiveToEachOtherInTheSameEvaluation) {
  for (const bool turned : {false, true}) {
    SystemSpec spec = slide(0.0);
    const std::string a = turned ? "z" : "a", b = turned ? "y" : "b", c = turned ? "x" : "c";
    spec.devices = {block(b, "gain", a + ".y"), block(a, "gain", c + ".y"), block(c, "lag", b + ".y")};
    spec.devices[2].initial["s"] = number(1.0);
    Simulation sim(with_own(spec), accurate());
    sim.run(0.5);
    EXPECT_NEAR(sim.state().z[0], std::exp(3.0 * 0.5), 1e-9);
  }
}

TEST(Devices, ThatNeedEachOtherAreRefused) {
  SystemSpec spec = slide(0.0);
  spec.devices = {block("a", "gain", "b.y"), block("b", "gain", "c.y"), block("c", "gain", "a.y")};
  try {
    with_own(spec);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.diagnostics().front().code, Code::device_cycle);
    EXPECT_NE(std::string(e.what()).find("a.x <- b.y, b.x <- c.y, c.x <- a.y"), std::string::npos) << e.what();
  }
}

/// 1 m at 2 m/s, then with 0.5 m/s^2: x(2 s) = 1 + 2 * 1.5 + 0.25 * 1.5^2. A corner inside of a step would cost rk4 its order.
TEST(Devices, RootsAreLocatedAndTheMethodStartsAnew) {
  for (const std::string method : {"rk4", "dopri5", "dop853", "cvode_bdf", "cvode_adams"}) {
    SystemSpec spec = slide(2.0);
    spec.devices = {device("push", "push", {}, {{"at", "mass"}})};
    SimulationOptions options = accurate(method);
    if (method == "rk4") options.integrator.fixed_step = 0.3;
    Simulation sim(with_own(spec), options);
    sim.run(2.0);
    EXPECT_NEAR(sim.state().q[0], 1.0 + 2.0 * 1.5 + 0.25 * 1.5 * 1.5, 1e-9) << method;
    EXPECT_EQ(sim.state().marks[0], 1.0) << method;
  }
}

/// A sensor that nothing depends on is read between steps, in linear models too: the rate of an arm on an arm is the sum of two.
TEST(Devices, ThatNothingDependsOnAreReadBetweenSteps) {
  BodySpec one = on(rigid("one", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "revolute", {{0, 0, 1}});
  BodySpec two = on(rigid("two", 1.0, {0.5, 0, 0}, diagonal({1, 1, 1})), "one", "revolute", {{0, 0, 1}}, {1, 0, 0});
  one.hinge.v = {0.3}, two.hinge.v = {0.5};
  SystemSpec spec = system({one, two});
  spec.devices = {device("gyro", "rate_sensor", {}, {{"at", "two"}})};
  const auto model = with_own(spec);
  EXPECT_FALSE(model->has(OpCode::world));
  Simulation sim(model, {});
  EXPECT_NEAR(sim.device_output(0), 0.8, 1e-15);
  const operators::LinearModel linear = operators::linearize(
      *model, {.q = sim.state().q.data(), .v = sim.state().v.data(), .wrenches = sim.wrenches(), .devices = sim.devices()},
      {{}, {"gyro:rate"}});
  EXPECT_NEAR(linear.y0[0], 0.8, 1e-15);
  EXPECT_LT((linear.C - Eigen::RowVector4d(0, 0, 1, 1)).norm(), 1e-14);
}

/// A command to what nothing that moves depends on is read at once and costs no step.
TEST(Devices, ThatDoNotActAreCommandedWithoutARestart) {
  SystemSpec spec = slide(1.0);
  spec.devices = {device("gain", "gain", {}, {})};
  Simulation sim(with_own(spec), accurate());
  sim.every({1, 10}, [&] { sim.set_device_input(0, sim.time() + 1.0); });
  sim.run(1.0);
  EXPECT_EQ(sim.device_output(0), 4.0);
  EXPECT_EQ(sim.statistics().restarts, 1);
}

/// A free body that flies along x and z passes the gate at 0.5 s, 0.25 m high.
TEST(Devices, RootsMayNeedThePosesOfNodes) {
  BodySpec body = on(rigid("body", 2.0, {0, 0, 0}, diagonal({1, 2, 3})), "", "free");
  body.hinge.v = {0.4, 0.1, -0.3, 2.0, 0.0, 0.5};
  SystemSpec spec = system({body});
  spec.devices = {device("gate", "gate", {}, {{"at", "body"}})};
  Simulation sim(with_own(spec), accurate());
  sim.run(1.0);
  EXPECT_EQ(sim.state().marks[0], 1.0);
  EXPECT_NEAR(sim.state().marks[1], 0.25, 1e-10);
}

/// What a controller commands at an instant is what a device with that tick samples there: 3 N for 0.1 s, then 6 N, ... on 2 kg.
TEST(Devices, ThatSampleTheirInputsTickAfterControllers) {
  SystemSpec spec = slide(0.0);
  spec.devices = {device("jack", "held_force", {}, {{"at", "mass"}})};
  spec.devices[0].rate = 10.0;
  Simulation sim(with_own(spec), accurate());
  int k = 0;
  sim.every({1, 10}, [&] { sim.set_device_input(0, 3.0 * ++k); });
  sim.run(0.35);
  EXPECT_NEAR(sim.state().v[0], (0.1 * (3.0 + 6.0 + 9.0) + 0.05 * 12.0) / 2.0, 1e-12);
}

/// dz'/dz holds the inputs: what a state is given by another device, whatever direction was looked along before, has no part in it.
TEST(Devices, PreconditionEachByItself) {
  SystemSpec spec = slide(0.0);
  spec.devices = {block("a", "lag", "b.y"), block("b", "lag", "a.y")};
  Simulation sim(with_own(spec), krylov());
  const OdeProblem ode = sim.ode();
  const VectorXd x = VectorXd::Zero(ode.n), d = VectorXd::Ones(ode.n);
  VectorXd out(ode.n), z(ode.n);
  ASSERT_TRUE(ode.rhs(0.0, x.data(), out.data()) && ode.jacobian_times(0.0, x.data(), d.data(), out.data()));
  ASSERT_TRUE(ode.prepare(0.0, x.data(), 0.25, true) && ode.precondition(d.data(), z.data()));
  EXPECT_NEAR(z[ode.n - 2], 1.0 / 1.25, 1e-14);
  EXPECT_NEAR(z[ode.n - 1], 1.0 / 1.25, 1e-14);
}

TEST(Devices, WithoutAUsableValueAreNamed) {
  SystemSpec spec = slide(2.0);
  spec.devices = {block("another", "lag", ""), device("bad", "broken", {}, {})};
  spec.devices[0].inputs.clear();
  Simulation sim(with_own(spec), {});
  sim.every({1, 10}, [&] { sim.observe(); });  // as an output does
  try {
    sim.run(2.0);
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::device_failed);
    EXPECT_NE(e.failure().what.find("device bad (broken): output y = nan"), std::string::npos) << e.failure().what;
    EXPECT_GE(e.failure().t, 0.99);
  }
}

/// The same bits as if the run had never stopped, with states, marks and commands of devices.
TEST(Devices, AreInCheckpoints) {
  for (const std::string method : {"rk4", "dopri5", "dop853", "cvode_bdf", "cvode_adams"}) {
    TreeOptions options_of_tree;
    options_of_tree.flexible = 0.0;  // no mode is bent beyond what it is made for
    RandomTree tree = random_tree(7, options_of_tree);
    SystemSpec spec = with_devices(tree.spec, 7);
    spec.bodies.push_back(on(particle("slider", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}}));
    spec.bodies.back().hinge.v = {2.0};
    spec.devices.push_back(device("push", "push", {}, {{"at", "slider"}}));
    spec.devices.push_back(device("imu", "imu", {{"angle_random_walk", 1e-3}, {"gyro_wander", 1e-3}}, {{"at", "slider"}}));
    spec.devices.back().period = 0.07;
    SimulationOptions options;
    options.integrator.method = method;
    options.integrator.relative_tolerance = 1e-7;
    if (method == "rk4") options.integrator.fixed_step = 0.005;
    const auto model = with_own(spec);
    Simulation whole(model, options), part(model, options);
    const int torque = model->devices.all[static_cast<std::size_t>(model->devices.find("wheel"))].in;
    whole.set_device_input(torque, 0.03);
    whole.run(0.7);
    const Checkpoint at = whole.checkpoint();
    part.resume(at);
    whole.run(1.3), part.run(1.3);
    EXPECT_TRUE(whole.state().q == part.state().q && whole.state().v == part.state().v && whole.state().z == part.state().z) << method;
    EXPECT_TRUE(whole.state().marks == part.state().marks && whole.state().marks[13] == 1.0) << method;
    EXPECT_EQ(part.device_input(torque), 0.03);
  }
}

}  // namespace
}  // namespace cardan::test
