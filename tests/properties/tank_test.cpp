// Mass that varies: tanks and thrusters against closed forms, and what must hold wherever they are.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/abi/device_family.hpp"
#include "core/base/diagnostic.hpp"
#include "core/dynamics/batch.hpp"
#include "core/dynamics/mass_flow.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_properties.hpp"
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

constexpr double kG0 = 9.80665;  // [m/s^2]

BodySpec with_node(BodySpec b, const std::string& name, const Vector3d& place) {
  NodeSpec node;
  node.name = name, node.position = place;
  b.nodes.push_back(node);
  return b;
}
DeviceSpec tank(const std::string& at, double propellant, double radius, const std::string& flow) {
  DeviceSpec d = device("tank", "tank", {{"radius", radius}}, {{"at", at}});
  d.initial["propellant"] = number(propellant);
  d.inputs["flow"] = {flow, {}};
  return d;
}
DeviceSpec thruster(const std::string& name, const std::string& at, double thrust, double impulse, const Vector3d& direction) {
  DeviceSpec d =
      with_vector(device(name, "thruster", {{"thrust", thrust}, {"specific_impulse", impulse}}, {{"at", at}}), "direction", direction);
  d.inputs["command"] = {1.0, {}};
  d.inputs["supply"] = {"tank.supply", {}};
  return d;
}
std::string residuals(Simulation& sim) {
  const LedgerState l = sim.ledger();
  return fmt::format("linear {:.1e} of {:.1e}, angular {:.1e} of {:.1e}, energy {:.1e} of {:.1e}", l.linear_relative, l.linear_limit,
                     l.angular_relative, l.angular_limit, l.energy_relative, l.energy_limit);
}

/// 500 kg to 400 kg at 220 s: 220 g_0 ln 1.25. The tank runs empty at m I g_0 / F, is found there, and nothing is pushed from then on.
TEST(Tank, TheRocketEquationHoldsUntilItIsEmpty) {
  for (const std::string method : {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"}) {
    SystemSpec spec = system({on(rigid("bus", 400.0, {0, 0, 0}, diagonal({60, 70, 80})), "", "free")});
    spec.devices = {tank("bus", 100.0, 0.4, "jet.flow"), thruster("jet", "bus", 1000.0, 220.0, {1, 0, 0})};
    Simulation sim(compiled(spec), accurate(method));
    EXPECT_EQ(sim.model().user[0].mass, 500.0);
    const double dry_at = 100.0 * 220.0 * kG0 / 1000.0;
    sim.run(dry_at + 20.0);
    EXPECT_NEAR(sim.state().v[3], 481.42395564900886, method == "cvode_bdf" ? 1e-6 : 1e-8) << method;  // of steps at 1e-12
    EXPECT_EQ(sim.state().z[sim.model().devices.all[1].z], 0.0);
    EXPECT_EQ(sim.state().marks[0], 1.0);
    EXPECT_EQ(sim.model().user[0].mass, 400.0);
    EXPECT_NEAR(sim.state().z[1], 100.0, 1e-8) << "what the thruster burnt";
    EXPECT_EQ(sim.device_output(0), 0.0) << "thrust";
    EXPECT_NEAR(sim.observe().momentum().mass, 400.0, 1e-12);
    EXPECT_TRUE(sim.ledger().pass) << residuals(sim);
  }
}

/// What is drawn from a radius of gyration k about a fixed axis and leaves at the distance l: I w' = mu (k^2 - l^2) w, so that
/// w / w_0 = (I / I_0)^((l^2 - k^2) / k^2) [Thomson 1966; Meirovitch 1970].
TEST(Tank, WhatLeavesDampsTheRotation) {
  const double J = 6.0, radius = std::sqrt(0.625);
  BodySpec wheel = on(rigid("wheel", 3.0, {0, 0, 0}, diagonal({J, J, J})), "", "revolute", {{0, 0, 1}});
  wheel = with_node(wheel, "nozzle", {std::sqrt(2.0) * 0.6, std::sqrt(2.0) * 0.8, 0.3});
  wheel.hinge.v = {2.0};
  SystemSpec spec = system({wheel});
  // k^2 = 0.5^2 + 2/5 0.625 = 0.5; 4 of 8 kg take I from 10 to 8
  spec.devices = {with_vector(tank("wheel", 8.0, radius, "jet.flow"), "position", {0.3, -0.4, 0.1}),
                  thruster("jet", "wheel.nozzle", 50.0, 220.0, {0.6, 0.8, 0})};
  for (const GravitySpec& g : {GravitySpec{}, uniform_gravity({0.3, -0.2, -9.0}), central_gravity(4e14, true, {7e6, 0, 0})}) {
    spec.gravity = g;
    SimulationOptions options = accurate();
    options.integrator.max_step =
        0.05;  // the steps of a smooth spin may be whole turns, over which impulses of the hinge are not integrated
    Simulation sim(compiled(spec), options);
    const double before = sim.state().v[0];
    sim.run(4.0 * 220.0 * kG0 / 50.0);
    EXPECT_NEAR(sim.model().user[0].M.J.zz, 8.0, 1e-9);
    if (g.kind == GravitySpec::Kind::none) {
      EXPECT_NEAR(sim.state().v[0] / before, 0.512, 1e-10);
    }
    EXPECT_TRUE(sim.ledger().pass) << static_cast<int>(g.kind) << ": " << residuals(sim);
  }
}

struct None {};
/// Lets out what it is told at the second of its nodes, without a thrust.
struct Vent {
  static constexpr const char *type = "vent", *summary = "lets out";
  static constexpr unsigned facts = 0;
  using Packed = None;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "the node of its valve"},
                                                 {"end", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD | CARDAN_USE_OUTLET, "where it leaves"}};
  static constexpr cardan_port_desc ports[] = {{"rate", CARDAN_PORT_IN, "kg/s", 0.0, 0, "wanted"},
                                               {"supply", CARDAN_PORT_IN, "1", 1.0, 0, "of a tank"},
                                               {"flow", CARDAN_PORT_OUT, "kg/s", 0.0, 3, "let out"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = in.in[0] * in.in[1];
  }
};

/// By the equations of an open system about the origin of a body [Eke, Wang 1995]: the moment -(J' + mu J_e) w - w x H of what flows within
/// the tank, m c x c', and on a straight way from its mass centre to the nozzle, and the force -2 w x (h' + mu e).
TEST(Tank, TheForcesOfWhatFlowsAreThoseOfAnOpenSystem) {
  const Vector3d e(-0.5, 0.7, 1.1), w(0.3, -0.5, 0.7);
  BodySpec bus = with_node(on(rigid("bus", 40.0, {0.1, 0, 0}, diagonal({6, 7, 8})), "", "free"), "nozzle", e);
  bus.hinge.v = {w[0], w[1], w[2], 3.0, -1.0, 2.0};
  bus.hinge.q = {0.5, 0.5, -0.5, 0.5, 1, 2, 3};
  SystemSpec spec = system({bus});
  const double mu = 5.0 / (50.0 * kG0);
  DeviceSpec vent = device("jet", "vent", {}, {{"at", "bus"}, {"end", "bus.nozzle"}});
  vent.inputs["rate"] = {mu, {}}, vent.inputs["supply"] = {"tank.supply", {}};
  Registry all = registry();
  all.devices.add(device_table<Vent>());
  // Evenly in a sphere, whose mass centre stays; settled in a cylinder, whose top is drawn off: a disc there goes.
  const double m = 100.0, R = 0.3, length = 1.2, density = 900.0, height = m / (density * std::numbers::pi * R * R);
  const Vector3d place(0.4, -0.3, 0.2), u(0.36, -0.48, 0.8), top = place + (height - 0.5 * length) * u;
  DeviceSpec even = with_vector(tank("bus", m, R, "jet.flow"), "position", place), settled = with_vector(even, "axis", u);
  settled.params["length"] = number(length), settled.params["density"] = number(density);
  settled.params["shape"].value = std::string("cylinder"), settled.params["fill"].value = std::string("settled");
  const auto about = [](const Vector3d& r) { return Eigen::Matrix3d(r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose()); };
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  struct Case {
    DeviceSpec tank;
    Vector3d c, c_rate, gone;  // mass centre, its rate, where what goes was
    Eigen::Matrix3d of_what_goes;
  };
  for (const auto& [of, c, c_rate, gone, of_what_goes] :
       {Case{even, place, Vector3d::Zero(), place, 0.4 * R * R * I},
        Case{settled, place + 0.5 * (height - length) * u, -0.5 * mu * height / m * u, top, 0.25 * R * R * (I + u * u.transpose())}})
    for (const DeviceSpec& jet : {thruster("jet", "bus.nozzle", 5.0, 50.0, {0, 0, 1}), vent}) {
      spec.devices = {of, jet};
      Simulation sim(compile(spec, all), {});
      sim.observe();
      const Eigen::Matrix3d J_rate = -mu * (about(gone) + of_what_goes);
      const Vector3d force = -2.0 * w.cross(-mu * gone + mu * e),
                     moment = -(J_rate + mu * about(e)) * w - w.cross(m * c.cross(c_rate) + mu * c.cross(e));
      Vector3d f = Vector3d::Zero(), n = f;
      for (const NodeWrench& at : sim.wrenches()) {
        const Vector3d here = to_eigen(sim.model().nodes[static_cast<std::size_t>(at.node)].shapes.pose.p), push = to_eigen(at.f.f);
        f += push, n += to_eigen(at.f.n) + here.cross(push);
      }
      const Vector3d thrust(0, 0, jet.type == "thruster" ? 5 : 0);
      EXPECT_LT((f - thrust - force).norm(), 1e-14) << jet.type;
      EXPECT_LT((n - e.cross(thrust) - moment).norm(), 1e-14) << jet.type;
    }
}

/// How the mass of a device without a `mass_tangent` changes is found by differences: those of a settled sphere, of whose cap each number
/// is a function of the mass that is not simple, against the derivative that it tells itself.
TEST(Tank, RatesByDifferencesAreThoseThatATypeTells) {
  static cardan_device_family silent = *registry().devices.find("tank");
  silent.type = "silent_tank", silent.mass_tangent = nullptr;
  Registry all = registry();
  all.devices.add(silent);
  const double radius = 0.5, density = 900.0, full = density * 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  for (const double part : {0.001, 0.01, 0.3, 0.5, 0.8}) {
    SystemSpec spec = system({on(rigid("bus", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free")});
    DeviceSpec d = with_vector(tank("bus", part * full, radius, ""), "axis", {0.36, -0.48, 0.8});
    d.inputs.clear();
    d.params["density"] = number(density), d.params["fill"].value = std::string("settled");
    spec.devices = {d, d};
    spec.devices[1].name = "silent", spec.devices[1].type = "silent_tank";
    const auto model = compile(spec, all);
    const double z[] = {part * full, part * full}, dz[] = {-2.0, -2.0}, marks[] = {0.0, 0.0};
    const cardan_mass told = mass_rate(model->devices, model->devices.all[0], z, marks, dz),
                      found = mass_rate(model->devices, model->devices.all[1], z, marks, dz);
    for (int i = 0; i < 10; ++i) EXPECT_NEAR((&found.mass)[i], (&told.mass)[i], 1e-11) << part << ", " << i;
  }
}

/// Mass, mass centre and moments of what is in the tank, by sums over a fine grid.
TEST(Tank, WherePropellantIsFollowsFromItsFill) {
  const double radius = 0.5, length = 1.2, density = 900.0;
  for (const std::string shape : {"sphere", "cylinder"})
    for (const std::string fill : {"even", "settled", "ball"})
      for (const double part : {0.1, 0.5, 0.8, 1.0}) {
        if (shape == "cylinder" && fill == "ball") continue;
        const double volume = std::numbers::pi * radius * radius * (shape == "sphere" ? 4.0 / 3.0 * radius : length),
                     m = part * density * volume;
        SystemSpec spec = system({on(rigid("bus", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free")});
        DeviceSpec d = tank("bus", m, radius, "");
        d.inputs.clear();
        d.params["length"] = number(length), d.params["density"] = number(density);
        d.params["shape"].value = shape, d.params["fill"].value = fill;
        spec.devices = {d};
        const auto model = compiled(spec);
        const RigidInertia<double> M = model->user[0].M;
        // slices across the axis: of the cylinder and the spheres they are discs
        const double ball = fill == "ball" ? std::cbrt(0.75 * m / density / std::numbers::pi) : radius,
                     half = shape == "sphere" ? ball : 0.5 * length;
        const int n = 200'000;
        double sum = 0.0, first = 0.0, second = 0.0, across = 0.0;
        const double wanted = fill == "even" ? volume : m / density, rho = m / wanted;
        for (int i = 0; i < n; ++i) {
          const double z = -half + (i + 0.5) * 2.0 * half / n, r2 = shape == "sphere" ? ball * ball - z * z : radius * radius;
          double slice = std::numbers::pi * r2 * 2.0 * half / n;
          slice = std::min(slice, wanted - sum);
          sum += slice, first += slice * z, second += slice * z * z, across += slice * r2 / 4.0;
        }
        const std::string what = shape + " " + fill + fmt::format(" {}", part);
        EXPECT_NEAR(M.m, 1.0 + m, 1e-9 * m) << what;
        EXPECT_NEAR(M.h.z, rho * first, 1e-4 * m) << what;  // of the last slice
        EXPECT_NEAR(M.J.zz, 1.0 + 2.0 * rho * across, 1e-4 * m) << what;
        EXPECT_NEAR(M.J.xx, 1.0 + rho * (across + second), 1e-4 * m) << what;
      }
}

/// The same in a tank that stands anywhere else along any axis, moved and turned: by Steiner's theorem.
TEST(Tank, IsWhereItsPlaceAndItsAxisSay) {
  const Vector3d place(0.7, -0.4, 1.1), axis(0.36, -0.48, 0.8);
  const Eigen::Matrix3d R = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
  for (const std::string shape : {"sphere", "cylinder"}) {
    SystemSpec spec = system({on(rigid("bus", 1.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "free")});
    DeviceSpec d = tank("bus", 300.0, 0.5, "");
    d.inputs.clear();
    d.params["length"] = number(1.2), d.params["density"] = number(900.0);
    d.params["shape"].value = shape, d.params["fill"].value = std::string("settled");
    spec.devices = {d};
    const RigidInertia<double> at_home = compiled(spec)->user[0].M;
    spec.devices = {with_vector(with_vector(d, "position", place), "axis", axis)};
    const RigidInertia<double> M = compiled(spec)->user[0].M;
    const auto point = [](double m, const Vector3d& r) -> Eigen::Matrix3d {
      return m * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
    };
    const double m = 300.0;
    const Eigen::Matrix3d of_bus = Eigen::Matrix3d::Identity();
    const Vector3d centre = to_eigen(at_home.h) / m, there = place + R * centre;
    const Eigen::Matrix3d about_centre = to_eigen(at_home.J) - of_bus - point(m, centre);
    EXPECT_NEAR(M.m, 301.0, 1e-12);
    EXPECT_LT((to_eigen(M.h) - m * there).norm(), 1e-12) << shape;
    EXPECT_LT((to_eigen(M.J) - of_bus - R * about_centre * R.transpose() - point(m, there)).norm(), 1e-11) << shape;
  }
}

/// The gas expands as it empties: F falls with p = p_0 (V_0 / V)^n, and m' with it: (V^(n+1) - V_0^(n+1)) / (n + 1) = V_0^n mu_0 t / rho.
TEST(Tank, TheThrustFallsAsItsGasExpands) {
  const double radius = 0.4, density = 1000.0, loaded = 180.0, n = 1.3, F = 40.0, isp = 215.0, t = 900.0;
  SystemSpec spec = system({on(rigid("bus", 300.0, {0, 0, 0}, diagonal({60, 70, 80})), "", "free")});
  DeviceSpec d = tank("bus", loaded, radius, "jet.flow");
  d.params["density"] = number(density), d.params["pressure"] = number(2.4e6), d.params["loaded"] = number(loaded);
  d.params["exponent"] = number(n);
  spec.devices = {d, thruster("jet", "bus", F, isp, {0, 1, 0})};
  Simulation sim(compiled(spec), accurate());
  sim.run(t);
  const double gas = 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3) - loaded / density, mu = F / (isp * kG0);
  const double now = std::pow(std::pow(gas, n + 1) + (n + 1) * std::pow(gas, n) * mu * t / density, 1.0 / (n + 1));
  EXPECT_NEAR(sim.state().z[2], loaded - density * (now - gas), 1e-7);
  EXPECT_NEAR(sim.state().z[1], density * (now - gas), 1e-7);  // what the thruster has used
  EXPECT_NEAR(sim.device_output(0), F * std::pow(gas / now, n), 1e-7);
}

/// Devices of with_devices(), a tank on a rigid body, two thrusters on nodes anywhere that draw from it.
SystemSpec with_tank(SystemSpec spec, unsigned seed) {
  std::mt19937 random(seed + 100);
  const auto x = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const auto bare = compiled(spec);
  std::vector<std::string> bodies, nodes;
  for (const UserBody& u : bare->user)
    if (u.n_modes == 0) bodies.push_back(u.name);
  for (const UserNode& n : bare->nodes) nodes.push_back(n.name);
  spec = with_devices(std::move(spec), seed);
  if (bodies.empty()) return spec;
  const auto any = [&](const auto& all) { return all[random() % all.size()]; };
  DeviceSpec d = tank(any(bodies), x(1, 3), x(0.2, 0.4), "left.flow + right.flow");
  d.params["length"] = number(0.7), d.params["density"] = number(800.0);
  d.params["shape"].value = std::string(random() % 2 ? "sphere" : "cylinder");
  d.params["fill"].value = std::string(random() % 2 ? "even" : "settled");
  d = with_vector(with_vector(d, "position", {x(-1, 1), x(-1, 1), x(-1, 1)}), "axis", {x(-1, 1), x(-1, 1), 1.0});
  spec.devices.push_back(d);
  for (const std::string name : {"left", "right"}) {
    spec.devices.push_back(thruster(name, any(nodes), x(1, 5), x(3, 10), {x(-1, 1), x(-1, 1), 1.0}));
    spec.devices.back().params["rise_time"] = spec.devices.back().params["fall_time"] = number(0.1);
    spec.devices.back().initial["level"] = number(x(0.3, 0.9));
  }
  return spec;
}
TEST(VaryingMass, AgreesWithTheDenseTwin) {
  for_all_trees(kAny, 1e-10, [](const RandomTree& tree) {
    SystemSpec spec = with_tank(tree.spec, tree.seed);
    Simulation sim(compiled(spec), {});
    Output difference = reference_output(sim);
    double x = 0.0, y = 0.0;
    difference.fill(&x);
    State other = sim.state();
    const int i = sim.model().devices.find("tank");
    if (i >= 0) other.z[sim.model().devices.all[static_cast<std::size_t>(i)].z] *= 0.6;
    sim.set_state(other);
    difference.fill(&y);
    return worse(x, y);
  });
}

/// Momentum and energy of any tree, with what leaves it.
TEST(VaryingMass, IsInTheLedger) {
  TreeOptions options{.bodies = 5, .roots = 1, .flexible = 0.4, .floating = true};
  options.gravity = GravitySpec::Kind::none;
  for (const GravitySpec& g : {GravitySpec{}, uniform_gravity({0.5, -1, 2}), central_gravity(50.0, true, {7, 5, -6})}) {
    if (g.kind == GravitySpec::Kind::central) options.flexible = 0.0;
    for_all_trees(
        options, 1e-10,  // each of some dozen steps is within 1e-11 of the state
        [&](const RandomTree& tree) {
          SystemSpec spec = with_tank(tree.spec, tree.seed);
          spec.gravity = g;
          Simulation sim(compiled(spec), accurate("dopri5", 1e-11));
          sim.run(0.4);
          const LedgerState l = sim.ledger();
          return worse(worse(l.linear_relative, l.angular_relative), l.energy_relative);
        },
        12);
  }
}

/// A body that the ground carries, and what leaves it, is in no sum of the ledger, wherever it stands and whatever pulls.
TEST(VaryingMass, OnTheGroundIsInNoBalance) {
  for (const GravitySpec& g : {GravitySpec{}, uniform_gravity({1, -2, 3}), central_gravity(50.0, true, {7, 5, -6})}) {
    BodySpec arm = on(rigid("arm", 1.0, {0.5, 0, 0}, diagonal({0.1, 0.1, 0.1})), "stand", "revolute", {{0, 0, 1}});
    arm.hinge.v = {1.0};
    SystemSpec spec = system({on(rigid("stand", 10.0, {0, 0, 0}, diagonal({1, 1, 1})), "", "locked", {}, {1, 2, 3}), arm}, g);
    spec.devices = {tank("stand", 1.0, 0.2, "jet.flow"), thruster("jet", "stand", 20.0, 50.0, {0, 1, 0})};
    Simulation sim(compiled(spec), accurate());
    sim.run(1.0);
    EXPECT_TRUE(sim.ledger().pass) << residuals(sim);
  }
}

TEST(VaryingMass, TakesPartInTheJacobian) {
  for (const GravitySpec& g : {GravitySpec{}, uniform_gravity({0.5, -1, 2}), central_gravity(50.0, true, {7, 5, -6})})
    for_all_trees(
        kAny, 1e-8,
        [&](const RandomTree& tree) {
          SystemSpec spec = with_tank(tree.spec, tree.seed);
          spec.gravity = g;
          return jacobian_error(spec);
        },
        20);
}

/// dv' along q and v, and dtau, with devices and flows as they change, against differences of the right-hand side and of the inverse of it.
TEST(Devices, TakePartInSensitivities) {
  for (const GravitySpec& g : {uniform_gravity({0.5, -1, 2}), central_gravity(50.0, true, {7, 5, -6})})
    for_all_trees(
        kAny, 1e-8,
        [&](const RandomTree& tree) {
          SystemSpec spec = with_tank(tree.spec, tree.seed);
          spec.gravity = g;
          SimulationOptions plain;
          plain.ledger = false;
          Simulation sim(compiled(spec), plain);
          const int nq = sim.model().nq, nv = sim.model().nv;
          if (nv == 0) return 0.0;
          const OdeProblem ode = sim.ode();
          const State here = sim.state();
          const std::vector<double> tau = sim.applied_forces();
          const std::vector<NodeWrench> wrenches(sim.wrenches().begin(), sim.wrenches().end());
          const DeviceForces devices(*sim.devices());
          operators::Sensitivities about(sim.shared_model());
          const Inputs in{.q = here.q.data(), .v = here.v.data(), .tau = tau.data(), .wrenches = wrenches};
          about.solve(in, &devices);
          VectorXd x(ode.n), u(nv), w(nv), got(nv), truth(ode.n), work(ode.n), back(nv);
          x << here.q, here.v, here.z;
          for (int i = 0; i < nv; ++i) u[i] = std::sin(2.7 * i + 0.3), w[i] = std::cos(1.9 * i);
          VectorXd d = VectorXd::Zero(ode.n);
          sim.model().qdot(here.q.data(), u.data(), d.data());
          d.segment(nq, nv) = w;
          soa::derivative(
              [&](double h, double* out) {
                const VectorXd at = x + h * d;
                if (!ode.rhs(0.0, at.data(), out)) throw std::runtime_error("breakdown");
              },
              0.002, ode.n, truth.data(), work.data());
          about.forward({.q = u.data(), .v = w.data()}, got.data());
          const VectorXd dvdot = truth.segment(nq, nv);
          about.inverse({.q = u.data(), .v = w.data(), .vdot = dvdot.data()}, back.data());  // nothing of actuators is needed for that
          return worse(distance(got, dvdot) / (1.0 + largest(dvdot)), largest(back) / (1.0 + largest(dvdot)));
        },
        20);
}

TEST(VaryingMass, GivesTheSameBitsInAnyOrder) {
  for_all_trees(
      kAny, 0.0,
      [](const RandomTree& tree) {
        SystemSpec spec = with_tank(tree.spec, tree.seed);
        Simulation a(compiled(spec), {});
        const VectorXd v = a.vdot();
        std::reverse(spec.devices.begin(), spec.devices.end());
        for (DeviceSpec& d : spec.devices)
          if (d.type == "tank") d.inputs["flow"] = {"right.flow + left.flow", {}};
        Simulation b(compiled(spec), {});
        return distance(v, b.vdot());
      },
      20);
}

/// At one q, with another mass: nothing of the evaluation before is used again.
TEST(VaryingMass, IsNeverStale) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.devices = {tank("base", 5.0, 0.3, "jet.flow"), thruster("jet", "base", 1.0, 1.0, {0, 0, 1})};
  Simulation sim(compiled(spec), {});
  const VectorXd heavy = sim.vdot();
  const std::shared_ptr<const Model> then = sim.shared_model();
  State light = sim.state();
  light.z[2] = 1.0;
  sim.set_state(light);
  const VectorXd now = sim.vdot();
  spec.devices[0].initial["propellant"] = number(1.0);
  Simulation other(compiled(spec), {});
  EXPECT_GT((now - heavy).norm(), 1e-3);
  EXPECT_EQ((now - other.vdot()).norm(), 0.0);
  EXPECT_EQ(sim.model().user[0].mass, 11.0);
  EXPECT_EQ(then->user[0].mass, 15.0) << "what was kept stays as it was";
  // mass matrix and its analyses
  Workspace ws(sim.model());
  const MatrixXd M = mass_matrix(sim.model(), ws, sim.state().q.data());
  VectorXd tau(sim.model().nv), zero = VectorXd::Zero(sim.model().nv), unit = VectorXd::Unit(sim.model().nv, 3);
  inverse_dynamics(sim.model(), ws, Inputs{.q = sim.state().q.data(), .v = zero.data(), .vdot = unit.data()}, tau.data(),
                   {.velocity = false, .gravity = false, .elastic = false});
  EXPECT_LT((M.col(3) - tau).norm(), 1e-12);
  EXPECT_NEAR(tau.segment<3>(3).norm(), 13.0, 1e-12) << "the arm has 2 kg";
  operators::TreeOperators tree(sim.shared_model());
  tree.at(sim.state().q.data());
  EXPECT_NEAR(operators::mass_properties(tree).mass, 13.0, 1e-12);
}

/// On the bus, on what a hinge moves, at the tip of a beam: the momentum that leaves is that of the vehicle at the nozzle, the mass is
/// exact, and a run goes on from a checkpoint bit for bit.
TEST(VaryingMass, GoesOnFromACheckpoint) {
  for (const std::string method : {"rk4", "dopri5", "dop853", "cvode_bdf", "cvode_adams", "ark_explicit", "ark_imex", "ark_implicit"}) {
    TreeOptions rigid_ones;
    rigid_ones.flexible = 0.0;
    const SystemSpec spec = with_tank(random_tree(7, rigid_ones).spec, 7);
    SimulationOptions options = accurate(method, 1e-7);
    if (method == "rk4") options.integrator.fixed_step = 0.005;
    const auto model = compiled(spec);
    Simulation whole(model, options), part(model, options);
    whole.run(0.7);
    const Checkpoint at = whole.checkpoint();
    part.resume(at);
    EXPECT_EQ(part.model().user[0].mass, whole.model().user[0].mass);
    whole.run(1.3), part.run(1.3);
    EXPECT_TRUE(whole.state().q == part.state().q && whole.state().v == part.state().v && whole.state().z == part.state().z) << method;
  }
}

/// With a fixed step h the error falls as h^4, across the edges of a valve and an empty tank.
TEST(Tank, KeepsTheOrderOfTheMethodAcrossCorners) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.bodies[0] = with_node(spec.bodies[0], "nozzle", {-0.5, 0.1, 0.2});
  spec.devices = {tank("base", 1.0, 0.3, "jet.flow"), thruster("jet", "base.nozzle", 20.0, 5.0, {0.3, 0.2, 1})};
  spec.devices[1].params["rise_time"] = spec.devices[1].params["fall_time"] = number(0.3);
  spec.devices[1].inputs.erase("command");
  const auto end = [&](double step, bool exact) {
    SimulationOptions options = accurate(exact ? "dopri5" : "rk4", 1e-13);
    if (!exact) options.integrator.fixed_step = step;
    Simulation sim(compiled(spec), options);
    const int command = sim.model().devices.all[0].in;
    sim.every({37, 100}, [&] { sim.set_device_input(command, sim.time() < 0.5 || sim.time() > 1.0 ? 1.0 : 0.2); });
    sim.run(6.0);
    EXPECT_EQ(sim.state().marks[0], 1.0) << "it is empty";
    VectorXd x(sim.state().q.size() + sim.state().v.size());
    x << sim.state().q, sim.state().v;
    return x;
  };
  const VectorXd truth = end(0, true);
  const double coarse = distance(end(0.02, false), truth), fine = distance(end(0.01, false), truth);
  EXPECT_GT(coarse / fine, 13.0) << coarse << " " << fine;
  EXPECT_LT(coarse / fine, 20.0);
}

/// Propellant among the states: its column of A against differences of the right-hand side, and that of the momentum.
TEST(VaryingMass, TakesPartInLinearModels) {
  TreeOptions options;
  options.hinges = {"revolute", "prismatic", "cylindrical", "universal"};  // dtheta is dq
  for_all_trees(options, 1e-7, [](const RandomTree& tree) {
    SimulationOptions plain;
    plain.ledger = false;
    Simulation sim(compiled(with_tank(tree.spec, tree.seed)), plain);
    const Model& m = sim.model();
    const int at = m.devices.find("tank");
    if (at < 0) return 0.0;
    const int z = m.devices.all[static_cast<std::size_t>(at)].z, n = 2 * m.nv + m.devices.n_z;
    const OdeProblem ode = sim.ode();
    const std::vector<double> tau = sim.applied_forces();
    const State here = sim.state();
    const operators::LinearModel linear = operators::linearize(
        m, {.q = here.q.data(), .v = here.v.data(), .tau = tau.data(), .wrenches = sim.wrenches(), .devices = sim.devices()},
        {{}, {"momentum:linear", "momentum:angular"}});
    VectorXd x(n), truth(n), work(n), scratch(6);
    x << here.q, here.v, here.z;
    const auto beside = [&](double h) {
      VectorXd moved = x;
      moved[2 * m.nv + z] += h;
      return moved;
    };
    soa::derivative([&](double h, double* out) { ode.rhs(0.0, beside(h).data(), out); }, 2e-3, n, truth.data(), work.data());
    MatrixXd momentum(6, n);  // of the whole, with that of the wheel
    for (int j = 0; j < n; ++j)
      soa::derivative(
          [&](double h, double* out) {
            State other = here;
            (j < m.nv ? other.q[j] : j < 2 * m.nv ? other.v[j - m.nv] : other.z[j - 2 * m.nv]) += h;
            sim.set_state(other);
            const Momentum p = sim.momentum();
            VectorXd::Map(out, 6) << p.linear, p.angular;
          },
          2e-3, 6, momentum.col(j).data(), scratch.data());
    sim.set_state(here);
    return worse(distance(VectorXd(linear.A.col(2 * m.nv + z)), truth) / (1.0 + largest(truth)),
                 distance(linear.C, momentum) / (1.0 + largest(momentum)));
  });
}

/// The same at every level of what is in the tank, where the laws of its mass are steep: next to empty and next to full, of a type that
/// tells how its mass changes and of one that does not.
TEST(VaryingMass, TakesPartInLinearModelsAtEveryLevel) {
  static cardan_device_family silent = *registry().devices.find("tank");
  silent.type = "silent_tank", silent.mass_tangent = nullptr;
  Registry all = registry();
  all.devices.add(silent);
  BodySpec hub = with_node(on(rigid("hub", 40.0, {0.1, 0, 0}, diagonal({6, 7, 8})), "", "universal", {{1, 0, 0}, {0, 1, 0}}), "side",
                           {-0.5, 0.7, 1.1}),
           arm = with_node(on(rigid("arm", 5.0, {1, 0, 0}, diagonal({0.1, 2, 2})), "hub", "revolute", {{0, 0.6, 0.8}}), "tip", {2, 0, 0});
  hub.hinge.q = {0.3, -0.4}, hub.hinge.v = {0.5, -0.7}, arm.hinge.q = {0.6}, arm.hinge.v = {1.1};
  const double radius = 0.3, length = 1.2, density = 900.0;
  for (const std::string type : {"tank", "silent_tank"})
    for (const std::string shape : {"sphere", "cylinder"})
      for (const double part : {1e-4, 0.001, 0.02, 0.5, 0.97, 0.999}) {
        const double full = density * std::numbers::pi * radius * radius * (shape == "sphere" ? 4.0 / 3.0 * radius : length);
        SystemSpec spec = system({hub, arm});
        DeviceSpec d = with_vector(with_vector(tank("hub", part * full, radius, "left.flow + right.flow"), "axis", {0.36, -0.48, 0.8}),
                                   "position", {0.4, -0.3, 0.2});
        d.type = type;
        d.params["length"] = number(length), d.params["density"] = number(density), d.params["pressure"] = number(2e6);
        d.params["loaded"] = number(0.9995 * full), d.params["shape"].value = shape, d.params["fill"].value = std::string("settled");
        spec.devices = {d, thruster("left", "hub.side", 20.0, 50.0, {0.6, 0, 0.8}), thruster("right", "arm.tip", 10.0, 50.0, {0, 1, 0})};
        SimulationOptions plain;
        plain.ledger = false;
        Simulation sim(compile(spec, all), plain);
        const Model& m = sim.model();
        const int n = 2 * m.nv + m.devices.n_z;
        const OdeProblem ode = sim.ode();
        const std::vector<double> tau = sim.applied_forces();
        const State here = sim.state();
        const operators::LinearModel linear = operators::linearize(
            m, {.q = here.q.data(), .v = here.v.data(), .tau = tau.data(), .wrenches = sim.wrenches(), .devices = sim.devices()}, {});
        const Device& carries = *std::ranges::find(m.devices.all, type, [](const Device& each) { return std::string(each.family->type); });
        VectorXd x(n), truth(n), work(n);
        x << here.q, here.v, here.z;
        for (int j = 0; j < n; ++j) {
          const bool is_propellant = j == 2 * m.nv + carries.z;
          const double step = is_propellant ? std::min(part, 1.0 - part) * full / 40.0 : 1e-2;
          soa::derivative(
              [&](double h, double* out) {
                VectorXd moved = x;
                moved[j] += h;
                ode.rhs(0.0, moved.data(), out);
              },
              step, n, truth.data(), work.data());
          EXPECT_LT(distance(VectorXd(linear.A.col(j)), truth), 1e-9 * (1.0 + largest(truth)))
              << type << ", " << shape << " " << part << ", column " << j << ": " << largest(truth);
        }
      }
}

/// Slosh of the first mode in a cylinder of radius R filled to h is a pendulum [Abramson, NASA SP-106, 1966]: w^2 = (a / R) x tanh(x h /
/// R), L = a / w^2, m_1 / m = 2 tanh(x h / R) / (h / R x (x^2 - 1)), x = 1.841184. Under a thrust F through its pivot, the mass centre of
/// the rest, the pivot gives way: w^2 = F / (M L), and a damper c on the hinge damps 2 zeta w = c (1 / m_1 + 1 / M) / L^2.
TEST(Slosh, IsAPendulumThatTheThrustPulls) {
  const double x = 1.841184, R = 0.6, liquid = 90.0, dry = 400.0, F = 800.0, zeta = 0.02;
  struct Published {
    double fill, frequency, share, length;  // h/R, w^2 R/a, m_1/m, L/R
  };
  for (const Published& p : {Published{1.0, 1.750798, 0.432197, 0.571168}, Published{0.5, 1.337026, 0.660108, 0.747929},
                             Published{2.0, 1.838854, 0.226967, 0.543817}}) {
    const double t = std::tanh(x * p.fill), L = R / (x * t), share = 2.0 * t / (p.fill * x * (x * x - 1.0));
    EXPECT_NEAR(R / L, p.frequency, 1e-6);
    EXPECT_NEAR(share, p.share, 1e-6);
    EXPECT_NEAR(L / R, p.length, 1e-6);
    const double m = share * liquid, M = dry + liquid - m, w = std::sqrt(F / (M * L)), c = 2.0 * zeta * w * L * L / (1.0 / m + 1.0 / M);
    BodySpec stage = on(rigid("stage", M, {0, 0, 0}, diagonal({3e9, 3e9, 8e8})), "", "free");  // the damper turns it by 1e-11
    BodySpec slosh = on(particle("slosh", m, {0, 0, -L}), "stage", "universal", {{1, 0, 0}, {0, 1, 0}});
    slosh.hinge.q = {1e-3, 0.0};
    SpringDamper damper;
    damper.damping = c;
    slosh.hinge.springs = {damper, damper};
    slosh.hinge.springs[1].component = 1;
    SystemSpec spec = system({stage, slosh});
    spec.devices = {thruster("jet", "stage", F, 300.0, {0, 0, 1})};
    spec.devices[0].inputs.erase("supply");
    Simulation sim(compiled(spec), accurate());
    const double time = 7.0;
    sim.run(time);
    const double decay = zeta * w, damped = std::sqrt(w * w - decay * decay);
    const double truth = 1e-3 * std::exp(-decay * time) * (std::cos(damped * time) + decay / damped * std::sin(damped * time));
    EXPECT_NEAR(sim.state().q[7], truth, 2e-9) << "of small swings: their cubes are 1e-9";
    const Momentum momentum = sim.momentum();
    EXPECT_NEAR(momentum.linear[2], F * time, 1e-8 * F * time);
    EXPECT_LT(momentum.linear.head<2>().norm(), 1e-3);
    EXPECT_TRUE(sim.ledger().pass) << residuals(sim);
  }
}

/// The integral of what two thrusters tell is what the tank has lost, on any mount.
TEST(Tank, LosesWhatItsThrustersTell) {
  for_all_trees(
      kAny, 1e-9,
      [](const RandomTree& tree) {
        const SystemSpec spec = with_tank(tree.spec, tree.seed);
        Simulation sim(compiled(spec), accurate("dopri5", 1e-11));
        const Devices& all = sim.model().devices;
        if (all.find("tank") < 0) return 0.0;
        const auto z = [&](const char* name) { return all.all[static_cast<std::size_t>(all.find(name))].z; };
        const double before = sim.state().z[z("tank")];
        sim.run(0.3);
        const double burnt = sim.state().z[z("left") + 1] + sim.state().z[z("right") + 1];
        return std::abs(before - sim.state().z[z("tank")] - burnt) + (burnt > 0.0 ? 0.0 : 1.0);
      },
      12);
}

/// What flows in again fills it: nothing is empty for ever.
TEST(Tank, ThatIsFilledAgainGivesAgain) {
  SystemSpec spec = system({on(rigid("bus", 400.0, {0, 0, 0}, diagonal({60, 70, 80})), "", "free")});
  DeviceSpec d = tank("bus", 1.0, 0.4, "");
  d.inputs.clear();
  d.params["residual"] = number(0.25);
  spec.devices = {d};
  for (const std::string method : {"dopri5", "dop853", "cvode_bdf"}) {
    Simulation sim(compiled(spec), accurate(method));
    sim.set_device_input(0, 0.5);
    sim.run(2.0);
    EXPECT_EQ(sim.state().z[0], 0.25);
    EXPECT_EQ(sim.device_output(1), 0.0) << "supply";
    sim.set_device_input(0, -0.5);
    sim.run(3.0);
    EXPECT_NEAR(sim.state().z[0], 0.75, 1e-9) << method;
    EXPECT_EQ(sim.device_output(1), 1.0) << method;
    sim.set_device_input(0, 0.5);
    sim.run(5.0);
    EXPECT_EQ(sim.state().z[0], 0.25) << method;
  }
}

/// Full to the last drop, settled in a sphere, it gives as well: its mass centre goes down by R dm / m at first.
TEST(Tank, ThatIsFullGives) {
  const double radius = 0.4, density = 1000.0, volume = 4.0 / 3.0 * std::numbers::pi * radius * radius * radius, t = 5.0;
  BodySpec bus = on(rigid("bus", 40.0, {0, 0, 0}, diagonal({6, 7, 8})), "", "free");
  bus.hinge.v = {0.3, 0.2, -0.4, 0, 0, 0};
  SystemSpec spec = system({bus});
  DeviceSpec d = tank("bus", density * volume, radius, "jet.flow");
  d.params["density"] = number(density), d.params["fill"].value = std::string("settled");
  spec.devices = {d, thruster("jet", "bus", 10.0, 220.0, {1, 0, 0})};
  Simulation sim(compiled(spec), accurate());
  sim.run(t);
  EXPECT_NEAR(sim.state().z[2], density * volume - 10.0 * t / (220.0 * kG0), 1e-10);
  EXPECT_TRUE(sim.ledger().pass) << residuals(sim);
}

TEST(Tank, RefusesWhatItCannotCarry) {
  SystemSpec spec = system({on(rigid("bus", 400.0, {0, 0, 0}, diagonal({60, 70, 80})), "", "free")});
  spec.devices = {tank("bus", 300.0, 0.4, "jet.flow"), thruster("jet", "bus", 1.0, 220.0, {1, 0, 0})};
  EXPECT_EQ(refusal(spec), "it compiled");
  spec.devices[0].params["density"] = number(1000.0);  // 268 kg
  EXPECT_NE(refusal(spec).find("it cannot carry propellant = 300 kg"), std::string::npos) << refusal(spec);
  spec.devices[0].initial["propellant"] = number(-3.0);
  EXPECT_NE(refusal(spec).find("-3 kg"), std::string::npos) << refusal(spec);
  // in the run, by what flows in
  spec.devices[0].initial["propellant"] = number(260.0), spec.devices[0].inputs.clear(), spec.devices.pop_back();
  Simulation sim(compiled(spec), accurate());
  sim.set_device_input(0, -1.0);
  try {
    sim.run(20.0);
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_NE(e.failure().what.find("device tank (tank): it cannot carry propellant = 268"), std::string::npos) << e.failure().what;
  }
}

TEST(Tank, IsNotDrawnFromForAnother) {
  SystemSpec spec = system({on(rigid("bus", 400.0, {0, 0, 0}, diagonal({60, 70, 80})), "", "free")});
  spec.devices = {tank("bus", 30.0, 0.4, "jet.flow"), tank("bus", 30.0, 0.4, "jet.flow"), thruster("jet", "bus", 1.0, 220.0, {1, 0, 0})};
  spec.devices[1].name = "second";
  spec.devices[2].inputs["supply"] = {"tank.supply + second.supply", {}};
  EXPECT_NE(refusal(spec).find("that of jet, which second gives too"), std::string::npos) << refusal(spec);
}

/// A tank of another model may be empty at what was left in it before.
TEST(VaryingMass, AnAdoptedTankKnowsWhetherItIsEmpty) {
  SystemSpec spec = system({on(rigid("bus", 400.0, {0, 0, 0}, diagonal({60, 70, 80})), "", "free")});
  spec.devices = {tank("bus", 5.0, 0.4, "jet.flow"), thruster("jet", "bus", 10.0, 220.0, {1, 0, 0})};
  Simulation sim(compiled(spec), accurate());
  sim.run(10.0);
  EXPECT_GT(sim.device_output(0), 0.0);
  spec.devices[0].params["residual"] = number(4.99);
  sim.adopt(compiled(spec));
  sim.run(20.0);
  EXPECT_EQ(sim.device_output(0), 0.0);
  spec.devices[0].params["residual"] = number(1.0);
  sim.adopt(compiled(spec));
  sim.run(21.0);
  EXPECT_GT(sim.device_output(0), 0.0);
}

TEST(VaryingMass, IsRefusedByNameWhereItCannotBe) {
  SystemSpec spec = system(base_with_sprung_arm());
  spec.devices = {tank("base", 5.0, 0.3, "jet.flow"), thruster("jet", "base", 1.0, 1.0, {0, 0, 1})};
  try {
    Batch batch(*compiled(spec));
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("device jet (thruster)"), std::string::npos) << e.what();
  }
  // thrust without a tank that takes its flow: the mass stays, and nothing is in the program for it
  spec.devices = {spec.devices[1]};
  spec.devices[0].inputs.erase("supply");
  const auto model = compiled(spec);
  EXPECT_TRUE(model->varies.empty() && !model->world && model->devices.flows.empty());
}

}  // namespace
}  // namespace cardan::test
