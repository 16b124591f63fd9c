// Cases of bodies that spin: without torque, with wheels, on a point, spun up, on wires, as they burn. Numbers by closed forms and by
// equations of another kind, in the files of tests/reference/cases.
#include <cmath>
#include <complex>
#include <numbers>

#include "tests/cases/poles.hpp"
#include "tests/cases/published.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

BodySpec free_body(const Vector3d& inertia, const Vector3d& rate) {
  BodySpec b = on(rigid("body", 100.0, Vector3d::Zero(), diagonal(inertia)), "", "free");
  b.hinge.q = {1, 0, 0, 0, 0, 0, 0};
  b.hinge.v = {rate.x(), rate.y(), rate.z(), 0, 0, 0};
  return b;
}

TEST(TriaxialBody, KeepsItsAttitudeForTenThousandSeconds) {
  const Published ref("rigid-triaxial-attitude");
  const auto sim = run_of(system({free_body({20, 30, 45}, {0.02, 0, 0.05})}), "dop853");
  sim->run(1e4);
  expect_vector("rates", sim->state().v.head<3>(), ref.vector("rates at 1e4 s"), ref.tolerance("rate_abs"));
  const Matrix3d R = quaternion(sim->state().q.data()).toRotationMatrix();
  expect_vector("attitude", VectorXd(R.transpose().reshaped()), ref.vector("attitude at 1e4 s"), ref.tolerance("attitude_abs"));
}

TEST(TriaxialBody, FlipsOnceOnTheSeparatrix) {
  const Published ref("rigid-separatrix");
  const double middle = ref.model()["middle_rate_rads"].as<double>(), k = middle * std::sqrt(15.0 * 10.0 / (20.0 * 45.0)), half = 8.0 / k;
  const VectorXd peak = ref.vector("rates in the flip over the middle rate");
  const auto exact = [&](double t) {
    const double s = 1.0 / std::cosh(k * (t - half));
    return Vector3d(middle * Vector3d(peak[0] * s, std::tanh(k * (t - half)), peak[1] * s));
  };
  const auto sim = run_of(system({free_body({20, 30, 45}, exact(0.0))}), "dop853");
  double before = 0.0, after = 0.0;
  sim->every({2, 1}, [&] {
    double& off = sim->time() < half ? before : after;
    off = worse(off, (sim->state().v.head<3>() - exact(sim->time())).norm());
  });
  sim->run(2.0 * half);
  expect_within("rates before the flip", before, ref.tolerance("before_abs"));
  expect_within("rates after it", after, ref.tolerance("after_abs"));
}

// The wheel as a device, whose momentum stays, as a body that turns freely, and as one that turns as it is told.
TEST(Gyrostats, OfKelvinAndOfVolterra) {
  const Published ref("rigid-gyrostats");
  const Vector3d I(20, 30, 45), axis = Vector3d(1, 2, 2) / 3.0, w(0.02, 0.05, -0.03);
  const double J = 0.5, across = 0.3, h = 4.0;
  const Matrix3d spun = axis * axis.transpose(), beside = Matrix3d::Identity() - spun;
  const auto compare = [&](const std::string& how, const std::string& whose, const SystemSpec& spec) {
    const auto sim = run_of(spec, "dop853");
    sim->run(200.0);
    expect_vector(how + ": rates", sim->state().v.head<3>(), ref.vector(whose + ": rates"), ref.tolerance("abs"));
    const Eigen::Vector4d q = sim->state().q.head<4>(), want = ref.vector(whose + ": attitude");
    expect_vector(how + ": attitude", q * std::copysign(1.0, q.dot(want)), want, ref.tolerance("abs"));
  };
  SystemSpec device = system({free_body(I, w)});
  DeviceSpec wheel;
  wheel.name = "wheel", wheel.type = "momentum_wheel", wheel.mounts["at"] = {"body", {}};
  wheel.params = along({axis});
  wheel.params["inertia"].value = J;
  wheel.initial["momentum"].value = h;
  device.devices = {wheel};
  compare("a device", "Kelvin", device);
  for (const bool given : {false, true}) {
    BodySpec hub = free_body(I, w);
    hub.inertia_com -= across * beside;
    BodySpec rotor = on(rigid("rotor", 10.0, Vector3d::Zero(), J * spun + across * beside), "body", "revolute", {axis});
    rotor.hinge.v = {h / J - axis.dot(w)};
    if (given) rotor.hinge.prescribed = {0};
    compare(given ? "a body of given speed" : "a free body", given ? "Volterra" : "Kelvin", system({hub, rotor}));
  }
}

TEST(SpinUp, LeavesTransverseRatesOfFresnelsIntegrals) {
  const Published ref("rigid-spin-up-fresnel");
  const auto sim = run_of(system({free_body({80, 80, 120}, {0, 0, 0.2})}), "dop853");
  const VectorXd torque = Published::as_vector(ref.model()["torque_body_Nm"]);
  for (int i = 0; i < 3; ++i) sim->set_force(i, torque[i]);
  sim->run(60.0);
  expect_vector("transverse rates", sim->state().v.head<2>(), ref.vector("transverse rates"), ref.tolerance("abs"));
}

TEST(HeavyTop, PrecessesSteadilyInTwoWaysAndSleeps) {
  const Published ref("rigid-steady-top");
  const double m = 1.0, l = 0.1, g = 9.81, I1 = 0.02, I3 = 0.005, tilt = std::numbers::pi / 3.0;
  const auto top = [&](double angle, const Vector3d& rate) {
    BodySpec b = on(rigid("top", m, l * Z, diagonal({I1 - m * l * l, I1 - m * l * l, I3})), "", "ball");
    b.hinge.q = {std::cos(0.5 * angle), std::sin(0.5 * angle), 0, 0};
    b.hinge.v = {rate.x(), rate.y(), rate.z()};
    return system({b}, uniform_gravity(-g * Z));
  };
  const VectorXd rates = ref.vector("fast and slow precession");
  for (int i = 0; i < 2; ++i) {
    const std::string which = i == 0 ? "fast" : "slow";
    const auto sim = run_of(top(tilt, {0, rates[i] * std::sin(tilt), 60.0}), "dop853");
    double off = 0.0;
    sim->every({1, 20}, [&] { off = worse(off, std::abs((quaternion(sim->state().q.data()) * Z).z() - std::cos(tilt))); });
    sim->run(2.0);
    const Vector3d axis = quaternion(sim->state().q.data()) * Z;
    expect_within(which + " precession: the tilt stays", off, ref.tolerance("tilt_abs"));
    expect_angle(which + " precession: azimuth after 2 s", std::atan2(axis.y(), axis.x()) + 0.5 * std::numbers::pi, 2.0 * rates[i],
                 ref.tolerance("azimuth_abs"));
  }
  for (const double share : {0.999, 1.001}) {
    const double w = share * ref.number("least spin of a sleeping top");
    const auto poles = operators::poles(linear_at_start(*compiled(top(0.0, {0, 0, w}))).A);
    const std::complex<double> root = std::sqrt(std::complex<double>(4.0 * I1 * m * g * l - I3 * I3 * w * w, 0.0)), i(0, 1);
    for (const double sign : {-1.0, 1.0})
      expect_within(fmt::format("pole upright at {} of the least spin", share),
                    distance_of(poles, (i * I3 * w + sign * root) / (2.0 * I1) - i * w), ref.tolerance("poles_abs"));
  }
}

TEST(WireBooms, SwingAsFastAsTheSpinHoldsThem) {
  const Published ref("rigid-wire-booms");
  const double R = ref.model()["hub_radius_m"].as<double>(), l = ref.model()["wire_length_m"].as<double>(), spin = 0.5;
  std::vector<BodySpec> bodies = {free_body({50, 50, 60}, spin * Z)};
  bodies.front().mass = ref.model()["hub_mass_kg"].as<double>();
  for (int i = 0; i < 4; ++i) {
    const Matrix3d turned = Eigen::AngleAxisd(0.5 * std::numbers::pi * i, Z).toRotationMatrix();
    bodies.push_back(on(particle(fmt::format("wire_{}", i), ref.model()["tip_mass_kg"].as<double>(), l * X), "body", "universal", {Z, Y},
                        R * turned * X));
    bodies.back().hinge.onode_R = turned;
  }
  const auto poles = operators::poles(linear_at_start(*compiled(system(bodies))).A);
  for (const char* which : {"in plane, against each other", "in plane, with the hub", "across the plane"}) {
    const std::complex<double> want(0.0, spin * ref.number(which));
    expect_within(which, distance_of(poles, want) / std::abs(want), ref.tolerance("rel"));
  }
}

TEST(RocketOffAxis, TurnsAsTheMomentumOfAllThatFlows) {
  const Published ref("rigid-rocket-off-axis");
  BodySpec body = free_body({120, 130, 50}, {0.2, -0.1, 0.6});
  body.mass = 150.0, body.com = {0.02, -0.01, 0.3};
  body.hinge.v[3] = 1.0;
  body.nodes = {{"nozzle", {0.05, 0.02, -1.5}, Matrix3d::Identity(), {}}};
  SystemSpec spec = system({body});
  DeviceSpec tank, engine;
  tank.name = "tank", tank.type = "tank", tank.mounts["at"] = {"body", {}};
  tank.params["position"].value = std::vector<double>{0.1, 0.05, -0.4};
  tank.params["radius"].value = 0.5;
  tank.initial["propellant"].value = 200.0;
  tank.inputs["flow"].value = "engine.flow";
  engine.name = "engine", engine.type = "thruster", engine.mounts["at"] = {"body.nozzle", {}};
  engine.params["thrust"].value = 1500.0, engine.params["specific_impulse"].value = 240.0;
  engine.params["direction"].value = std::vector<double>{0.03, -0.02, 1.0};
  engine.inputs["supply"].value = "tank.supply";
  engine.inputs["command"].value = 1.0;
  spec.devices = {tank, engine};
  const auto sim = run_of(spec, "dop853");
  sim->run(30.0);
  expect_vector("rates", sim->state().v.head<3>(), ref.vector("rates at 30 s"), ref.tolerance("rate_abs"));
  const VectorXd want = ref.vector("position at 30 s");
  expect_vector("position", sim->state().q.segment<3>(4), want, ref.tolerance("position_rel"), want.norm());
}

}  // namespace
}  // namespace cardan::test
