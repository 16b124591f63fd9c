// Published and analytic cases of rigid bodies. Each to the tolerance its file recommends.
#include <cmath>
#include <numbers>

#include "core/dynamics/inverse.hpp"
#include "core/linalg/dense.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/system_modes.hpp"
#include "tests/cases/published.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(BranchedTree, FallsFromRestAsFeatherstoneSays) {
  const Published ref("rigid-rbdl-branched-tree");
  std::vector<BodySpec> bodies;
  for (const auto& b : ref.model()["bodies"]) {
    const auto parent = b["parent"].as<std::string>();
    bodies.push_back(on(rigid(b["name"].as<std::string>(), 1.0, Published::as_vector(b["com_m"]), diagonal({1, 1, 1})),
                        parent == "world" ? "" : parent, "revolute", {Published::as_vector(b["joint_axis"])},
                        Published::as_vector(b["joint_origin_m"])));
  }
  const VectorXd want = ref.vector("qdd");
  const auto sim = run_of(system(bodies, uniform_gravity(-9.81 * Y)));
  expect_vector("qdd", sim->vdot(), want, ref.tolerance("rel"), largest(want));
}

// A body that turns about a fixed mass centre.
SystemSpec tumbling(const Vector3d& inertia, const VectorXd& omega) {
  BodySpec b = on(rigid("body", 2.0, Vector3d::Zero(), diagonal(inertia)), "", "ball");
  b.hinge.v = {omega[0], omega[1], omega[2]};
  return system({b});
}

TEST(IntermediateAxis, FlipsWithTheEllipticPeriod) {
  const Published ref("rigid-dzhanibekov-elliptic");
  const VectorXd start = Published::as_vector(ref.initial()["omega_body_rads"]);
  const SystemSpec body = tumbling(Published::as_vector(ref.model()["inertia_diag_kgm2"]), start);
  SimulationOptions options;
  options.integrator = {.method = "dopri5", .relative_tolerance = 1e-13};
  options.absolute_tolerance = 1e-18;  // the start lies 1e-3 beside an unstable axis: small rates count
  Simulation sim(compiled(body), options);
  // omega_x vanishes at the summit of omega_y, a quarter of a period before omega_y does. After the flip one unit in
  // the last place of omega_x = 3 rad/s already moves the next one by 1e-8 s: 1e-10 of a period can be seen in the
  // first quarter only.
  const auto summit = crossings(sim, -1, [](const double*, const double* v) { return v[0]; });
  const auto over = crossings(sim, -1, [](const double*, const double* v) { return v[1]; });
  const double half = 0.5 * ref.number("full period"), energy = sim.observe().energy().kinetic;
  const Vector3d H = sim.observe().momentum().angular;
  const auto expect_omega = [&](const std::string& at, const VectorXd& want) {
    expect_vector("omega at " + at, sim.state().v, want, ref.tolerance("omega_abs"));
  };
  for (int t = 1; t <= 4; ++t) {
    sim.run(t);
    expect_omega(fmt::format("{} s", t), ref.vector(fmt::format("omega at {} s", t)));
  }
  sim.run(half);
  expect_omega("half period", ref.vector("omega at half period"));
  sim.run(2.0 * half);
  expect_omega("full period", start);
  ASSERT_FALSE(summit->empty() || over->empty());
  expect_relative("period", 2.0 * (over->front() - summit->front()), half, ref.tolerance("period_rel"));
  expect_within("energy", std::abs(sim.observe().energy().kinetic / energy - 1.0), ref.tolerance("energy_rel"));
  expect_within("momentum", (sim.observe().momentum().angular - H).norm() / H.norm(), ref.tolerance("momentum_rel"));
}

struct Method {
  const char* name;
  double relative, step;  // step: of rk4; of the others at most
};
class SymmetricTop : public testing::TestWithParam<Method> {};

// All four methods. rk4 with 0.25 ms: (5 rad/s h)^4 / 120 * 5 = 1e-13. CVODE controls the error of a step, and the errors
// of some hundred add up to ten (Adams) and two hundred times the tolerance of the case: its steps are bounded.
TEST_P(SymmetricTop, RunsOnItsBodyConeAndItsSpaceCone) {
  const auto [method, relative, step] = GetParam();
  const Published ref("rigid-symmetric-free-top");
  const double It = ref.model()["inertia_transverse_kgm2"].as<double>(), Ia = ref.model()["inertia_axial_kgm2"].as<double>();
  const double tolerance = ref.tolerance("omega_abs");
  SimulationOptions options;
  options.integrator.method = method;
  options.integrator.relative_tolerance = relative;
  (method == std::string("rk4") ? options.integrator.fixed_step : options.integrator.max_step) = step;
  const auto sim =
      std::make_unique<Simulation>(compiled(tumbling({It, It, Ia}, Published::as_vector(ref.initial()["omega_body_rads"]))), options);
  const Vector3d H = sim->observe().momentum().angular.normalized();
  // The symmetry axis seen along H.
  const auto axis = [&] { return Vector3d(quaternion(sim->state().q.data()) * Z); };
  const Vector3d e1 = (axis() - H * H.dot(axis())).normalized(), e2 = H.cross(e1);
  expect_absolute("cone", std::acos(H.dot(axis())), ref.number("cone half angle"), 1e-15);
  sim->run(1.0);
  expect_vector("omega", sim->state().v, ref.vector("omega_body at 1 s"), tolerance);
  expect_absolute("nutation", std::atan2(sim->state().v[1], sim->state().v[0]), ref.number("body nutation rate"), tolerance);
  const double turned = std::atan2(e2.dot(axis()), e1.dot(axis()));
  expect_angle("precession", turned, ref.number("precession rate"), tolerance);
  expect_absolute("cone at the end", std::acos(H.dot(axis())), ref.number("cone half angle"), tolerance);
}
INSTANTIATE_TEST_SUITE_P(By, SymmetricTop,
                         testing::Values(Method{"rk4", 1e-9, 2.5e-4}, Method{"dopri5", 1e-13, 0.0}, Method{"cvode_adams", 1e-14, 5e-4},
                                         Method{"cvode_bdf", 1e-14, 2e-4}),
                         [](const auto& method) { return std::string(method.param.name); });

TEST(HeavyTop, NutatesWithTheEllipticPeriod) {
  const Published ref("rigid-heavy-top-fast");
  BodySpec top = on(rigid("top", 15.0, Y, diagonal(Published::as_vector(ref.model()["inertia_com_diag_kgm2"]))), "", "ball");
  const VectorXd omega = Published::as_vector(ref.initial()["omega_body_rads"]);
  top.hinge.v = {omega[0], omega[1], omega[2]};
  const auto sim = run_of(system({top}, uniform_gravity(-9.81 * Z)));
  // Turning points: the mass centre neither rises nor falls.
  double azimuth = 0.0, height = 1.0, lowest = 1.0;
  const auto com = [&] { return Vector3d(quaternion(sim->state().q.data()) * Y); };
  const auto rise = [](const double* q, const double* v) { return (quaternion(q) * Vector3d(v[0], v[1], v[2]).cross(Y)).z(); };
  const auto maxima = crossings(*sim, -1, rise, [&] {
    if (azimuth == 0.0) azimuth = std::atan2(com().y(), com().x()), height = com().z();
  });
  crossings(*sim, +1, rise, [&] { lowest = std::min(lowest, com().z()); });
  const double energy = sim->observe().energy().total(), kinetic = sim->observe().energy().kinetic;
  const auto expect_com = [&](const std::string& at) { expect_vector(at, com(), ref.vector(at), ref.tolerance("com_abs")); };
  sim->run(0.1);
  expect_com("com at 0.1 s");
  sim->run(0.2);
  const Eigen::Map<const Eigen::Vector4d> q(sim->state().q.data());
  const VectorXd want = ref.vector("quaternion at 0.2 s");
  expect_vector("quaternion, published", (q.dot(want) < 0.0 ? -1.0 : 1.0) * q, want, 1e-5);  // printed with five digits
  for (const char* t : {"0.5", "1", "2"}) {
    sim->run(std::stod(t));
    expect_com(std::string("com at ") + t + " s");
  }
  ASSERT_EQ(maxima->size(), 2u);
  expect_relative("nutation period", maxima->front(), ref.number("nutation period"), ref.tolerance("nutation_period_rel"));
  // The top starts on the y axis; it goes round the vertical once with each nutation.
  const double advance = std::abs(std::remainder(azimuth - 0.5 * std::numbers::pi, 2 * std::numbers::pi));
  expect_absolute("precession", advance, ref.number("precession angle"), 1e-7);
  expect_vector("turning points", Eigen::Vector2d(lowest, height), ref.vector("turning points"), 1e-10);
  expect_relative("spin", sim->state().v[1], ref.number("spin rate"), 1e-12);
  expect_within("energy", std::abs(sim->observe().energy().total() - energy) / kinetic, ref.tolerance("energy_rel"));
}

TEST(SphericalPendulum, AdvancesItsApsides) {
  const Published ref("rigid-spherical-pendulum-apsidal");
  // At azimuth 0: the second angle is minus the polar angle, and a rate p about x moves the bob along y with p
  // cos(polar).
  const double polar = 60.0 * kDegree;
  BodySpec bob = on(particle("bob", 1.0, -Z), "", "universal", {X, Y});
  bob.hinge.q = {0.0, -polar};
  bob.hinge.v = {2.0 * std::sin(polar) / std::cos(polar), 0.0};
  const auto sim = run_of(system({bob}, uniform_gravity(-9.81 * Z)));
  const int node = sim->model().find_node("bob");
  ASSERT_GE(node, 0);
  const auto bob_at = [&] { return Vector3d(-(sim->observe().node(node).R_WN * Z)); };
  double azimuth = 0.0, lowest = 0.0, highest = -1.0;
  // z = -cos q1 cos q2 of the bob
  const auto rise = [](const double* q, const double* v) {
    return std::sin(q[0]) * std::cos(q[1]) * v[0] + std::cos(q[0]) * std::sin(q[1]) * v[1];
  };
  const auto maxima = crossings(*sim, -1, rise, [&] { azimuth = std::atan2(bob_at().y(), bob_at().x()), highest = bob_at().z(); });
  crossings(*sim, +1, rise, [&] { lowest = bob_at().z(); });
  sim->run(1.2);
  ASSERT_EQ(maxima->size(), 1u);
  const double rel = ref.tolerance("rel");
  expect_relative("period", maxima->front(), ref.number("period of z"), rel);
  const double advance = ref.number("azimuth advance per period");
  expect_angle("advance", azimuth, advance, rel, advance);
  expect_relative("lowest", lowest, ref.vector("vertical coordinate")[0], rel);
  expect_relative("highest", highest, ref.vector("vertical coordinate")[1], rel);
}

TEST(PlanarPendulum, KeepsItsPhaseOver845Periods) {
  const Published ref("rigid-iftomm-a01-pendulum");
  const SystemSpec pendulum = system({on(particle("P1", 1.0, X), "", "revolute", {Z})}, uniform_gravity(-9.81 * Y));
  auto sim = run_of(pendulum);
  const auto P1 = [&] { return Eigen::Vector2d(std::cos(sim->state().q[0]), std::sin(sim->state().q[0])); };
  for (const char* t : {"1", "2", "5", "10"}) {
    sim->run(std::stod(t));
    const std::string at = std::string("P1 at ") + t + " s";
    expect_vector(at, P1(), ref.vector(std::string(t) == "1" ? "P1 at 1 s [m]" : at), ref.tolerance("own_target_abs"));
  }
  // At a quarter of a period it is lowest and fastest: 4.4 m/s times the error of phase.
  sim = run_of(pendulum, "dopri5", 1e-11);
  sim->run(844.25 * ref.number("period"));
  expect_vector("P1 near 2000 s", P1(), Eigen::Vector2d(0.0, -1.0), ref.tolerance("error_high"));
}

TEST(Babyboot, KeepsSevenDigitsOverTenChaoticSeconds) {
  const Published ref("rigid-chaotic-babyboot");
  // The rod only swings, so its other moments do not enter.
  BodySpec A = on(rigid("A", 0.01, -0.075 * Z, diagonal({5e-6, 5e-6, 1e-6})), "", "revolute", {X});
  BodySpec B =
      on(rigid("B", 0.1, -0.2 * Z, diagonal(Published::as_vector(ref.model()["plate_B"]["inertia_xyz_kgm2"]))), "A", "revolute", {Z});
  A.hinge.q = {90.0 * kDegree};
  B.hinge.q = {1.0 * kDegree};
  const auto sim = run_of(system({A, B}, uniform_gravity(-9.81 * Z)));
  const double start = sim->observe().energy().total();
  sim->run(10.0);
  const State& s = sim->state();
  expect_relative("qA", s.q[0] / kDegree, ref.number("qA [deg]"), ref.tolerance("qA_rel"));
  expect_relative("qB", s.q[1] / kDegree, ref.number("qB [deg]"), ref.tolerance("qB_rel"));
  expect_relative("qA_dot", s.v[0], ref.number("qA_dot"), ref.tolerance("rates_rel"));
  expect_relative("qB_dot", s.v[1], ref.number("qB_dot"), ref.tolerance("rates_rel"));
  expect_relative("qA_ddot", sim->vdot()[0], ref.number("qA_ddot"), ref.tolerance("acc_rel"));
  expect_relative("qB_ddot", sim->vdot()[1], ref.number("qB_ddot"), ref.tolerance("acc_rel"));
  expect_within("energy", std::abs(sim->observe().energy().total() - start), ref.tolerance("energy_J"));
}

// K = -d(gravity force)/dq by differences of order four: error h^4 q'''' = 1e-11, rounding 1e-16 * 20 N m / h = 2e-12.
TEST(DoublePendulum, SwingsWithItsTwoFrequencies) {
  const Published ref("rigid-double-pendulum-modes");
  const auto model =
      compiled(system({on(particle("one", 1.0, -Z), "", "revolute", {X}), on(particle("two", 1.0, -Z), "one", "revolute", {X}, -Z)},
                      uniform_gravity(-9.81 * Z)));
  Workspace ws(*model);
  const double h = 1e-3;
  Eigen::Matrix2d K;
  for (int i = 0; i < 2; ++i) {
    const auto force = [&](double step) {
      Eigen::Vector2d q = Eigen::Vector2d::Zero();
      q[i] = step;
      return gravity_force(*model, ws, q.data());
    };
    K.col(i) = -(8.0 * (force(h) - force(-h)) - (force(2 * h) - force(-2 * h))) / (12.0 * h);
  }
  const Eigen::Vector2d zero = Eigen::Vector2d::Zero();
  const VectorXd omega = generalised_eigenvalues(0.5 * (K + K.transpose()), mass_matrix(*model, ws, zero.data())).value().cwiseSqrt();
  expect_relative("omega_1", omega[0], ref.number("omega_1"), ref.tolerance("rel"));
  expect_relative("omega_2", omega[1], ref.number("omega_2"), ref.tolerance("rel"));
}

Eigen::Matrix3d from_rpy(const VectorXd& rpy) {
  return (Eigen::AngleAxisd(rpy[2], Z) * Eigen::AngleAxisd(rpy[1], Y) * Eigen::AngleAxisd(rpy[0], X)).toRotationMatrix();
}
Eigen::Matrix3d tensor(const YAML::Node& i) {
  const auto at = [&](const char* name) { return i[name].as<double>(); };
  Eigen::Matrix3d I;
  I << at("ixx"), at("ixy"), at("ixz"), at("ixy"), at("iyy"), at("iyz"), at("ixz"), at("iyz"), at("izz");
  return I;
}
/// The published inertias of three links are about no mass centre: 1.69 > 0.25 + 0.25, which the engine refuses. Mass
/// matrix, momentum and forces are linear in them, so that f(I) = 2 f(I + c) - f(I + 2 c) of two arms whose links have
/// c in each direction more. c = 3 kg m^2 costs one digit of sixteen.
class EtsVii : public testing::Test {
 protected:
  SystemSpec arm(double more) const {
    const YAML::Node model = ref.model();
    const auto body = [](const std::string& name, const YAML::Node& b, double c) {
      return rigid(name, b["mass"].as<double>(), Published::as_vector(b["com"]), tensor(b["inertia"]) + c * Eigen::Matrix3d::Identity());
    };
    std::vector<BodySpec> bodies{on(body("Base_SC", model["base"], 0.0), "", "free")};
    const VectorXd q = Published::as_vector(ref.initial()["q_rad"]);
    for (std::size_t i = 0; i < 6; ++i) {
      const YAML::Node joint = model["joints"][i];
      bodies.push_back(on(body(joint["child"].as<std::string>(), model["links"][i], more), joint["parent"].as<std::string>(), "revolute",
                          {Published::as_vector(joint["axis"])}, Published::as_vector(joint["origin_m"])));
      bodies.back().hinge.onode_R = from_rpy(Published::as_vector(joint["origin_rpy_rad"]));
      bodies.back().hinge.q = {q[static_cast<Eigen::Index>(i)]};
    }
    return system(bodies);
  }
  /// f of the published arm.
  template <class F>
  auto published(F&& f) const {
    return (2.0 * f(arm(3.0)) - f(arm(6.0))).eval();
  }
  const Published ref{"rigid-ets7-free-floating"};
  const double rel = ref.tolerance("rel");
};

TEST_F(EtsVii, KeepsItsMomentumZeroWithThePublishedMotionOfItsBase) {
  const VectorXd rates = Published::as_vector(ref.initial()["qd_rads"]);
  // The base at the world's origin, axes parallel: its rows of M are the momentum.
  const Eigen::MatrixXd M = published([](const SystemSpec& spec) {
    const auto model = compiled(spec);
    Workspace ws(*model);
    return mass_matrix(*model, ws, model->initial_state().q.data());
  });
  const VectorXd base = -symmetric_solve(Eigen::MatrixXd(M.topLeftCorner(6, 6)), VectorXd(M.topRightCorner(6, 6) * rates));
  expect_entries("base angular velocity", base.head<3>(), ref.vector("base angular velocity"), rel);
  expect_entries("base linear velocity", base.tail<3>(), ref.vector("base linear velocity"), rel);
  double size = 0.0;
  const Eigen::Matrix<double, 6, 1> momentum = published([&](const SystemSpec& spec) {
    const auto sim = run_of(spec);
    for (int i = 0; i < 3; ++i) sim->v(i) = ref.vector("base angular velocity")[i], sim->v(3 + i) = ref.vector("base linear velocity")[i];
    for (int i = 0; i < 6; ++i) sim->v(6 + i) = rates[i];
    const Momentum h = sim->observe().momentum();
    expect_relative("total mass", h.mass, ref.number("total mass"), rel);
    expect_entries("mass centre", h.com, ref.vector("centre of mass"), rel);
    size = worse(h.linear_magnitude, h.angular_magnitude);
    return (Eigen::Matrix<double, 6, 1>() << h.angular, h.linear).finished();
  });
  expect_within("momentum", largest(momentum) / size, rel);
}

TEST_F(EtsVii, NeedsThePublishedTorquesToAccelerateAsPublished) {
  const VectorXd given = ref.vector("accelerations from rest"), torque = ref.vector("joint torques");
  VectorXd vdot(12);  // [angular; linear; joints]
  vdot << given.segment<3>(3), given.head<3>(), given.tail<6>();
  const VectorXd tau = published([&](const SystemSpec& spec) {
    const auto model = compiled(spec);
    Workspace ws(*model);
    const State s = model->initial_state();
    Inputs in;
    in.q = s.q.data(), in.v = s.v.data(), in.vdot = vdot.data();
    VectorXd out(12);
    inverse_dynamics(*model, ws, in, out.data());
    return out;
  });
  expect_entries("joint torques", tau.tail<6>(), torque, rel);
  expect_vector("base wrench", tau.head<6>(), VectorXd::Zero(6), rel, largest(torque));
  const Eigen::MatrixXd M = published([](const SystemSpec& spec) {
    const auto model = compiled(spec);
    Workspace ws(*model);
    return mass_matrix(*model, ws, model->initial_state().q.data());
  });
  expect_entries("accelerations", symmetric_solve(M, (VectorXd(12) << VectorXd::Zero(6), torque).finished()), vdot, rel);
}

// Dropped over the equator with the rotating Earth, without air. In the plane of the equator J2 multiplies the central
// field by 1 + 1.5 J2 (a / r)^2: its value at the start is taken. On the way down the factor grows by 2e-6, which is 2
// mm of the 4.4 km fallen, and nothing for the attitude.
TEST(TumblingBrick, TurnsAndFallsLikeCaseTwoOfTheNesc) {
  const Published ref("rigid-nesc-atmos02-tumbling-brick");
  const YAML::Node earth = ref.model()["earth"], brick = ref.model()["body"];
  const double a = earth["radius_m"].as<double>(), r = a + ref.initial()["altitude_m"].as<double>(), rate = earth["rate_rads"].as<double>(),
               J2 = earth["J2"].as<double>();
  const double mu = earth["mu_m3s2"].as<double>() * (1.0 + 1.5 * J2 * std::pow(a / r, 2));
  BodySpec body =
      on(rigid("brick", brick["mass_kg"].as<double>(), Vector3d::Zero(), diagonal(Published::as_vector(brick["inertia_diag_kgm2"]))), "",
         "free");
  // Columns: north, east, down in inertial axes, at the longitude that is at this angle from inertial x.
  const auto local = [](double angle) {
    Eigen::Matrix3d R;
    R << Z, Vector3d(-std::sin(angle), std::cos(angle), 0.0), Vector3d(-std::cos(angle), -std::sin(angle), 0.0);
    return R;
  };
  const Eigen::Quaterniond start(local(0.0));
  const Vector3d omega = kDegree * Published::as_vector(ref.initial()["omega_body_wrt_inertial_degs"]);
  body.hinge.q = {start.w(), start.x(), start.y(), start.z(), r, 0.0, 0.0};
  body.hinge.v = {omega[0], omega[1], omega[2], 0.0, rate * r, 0.0};
  const auto sim = run_of(system({body}, central_gravity(mu, false)));
  sim->run(30.0);
  const State& s = sim->state();
  expect_vector("rates [deg/s]", s.v.head<3>() / kDegree, ref.vector("body rates at 30 s, tools 01/04"), ref.tolerance("rate_degs"));
  const Eigen::Matrix3d R = local(std::atan2(s.q[5], s.q[4])).transpose() * quaternion(s.q.data()).toRotationMatrix();
  const Vector3d euler(std::atan2(R(1, 0), R(0, 0)), -std::asin(R(2, 0)), std::atan2(R(2, 1), R(2, 2)));
  expect_vector("yaw, pitch, roll [deg]", euler / kDegree, ref.vector("yaw,pitch,roll"), ref.tolerance("euler_deg"));
  expect_absolute("altitude [ft]", (s.q.tail<3>().norm() - a) / 0.3048, ref.number("altitude"), 0.01);
}

// The Earth turns by prescription and carries the pivot; the bob falls towards its centre. The latitude is that of the
// plumb line, which the rotation tilts. From rest the bob swings in a narrow ellipse, which adds 3/8 of its semi-axes'
// product over l^2 per radian of swing: 7e-4 of the precession, within the tolerance.
TEST(FoucaultPendulum, TurnsWithTheSineOfTheLatitude) {
  const Published ref("rigid-foucault");
  const double length = ref.model()["length_m"].as<double>(), rate = ref.model()["earth_rate_rads"].as<double>(),
               latitude = ref.model()["latitude_deg"].as<double>() * kDegree, R = 6.371e6;
  // Where the plumb line has this latitude, and with which mu gravity and rotation together have this size.
  const double g = ref.model()["gravity_ms2"].as<double>();
  double mu = g * R * R, geocentric = latitude;
  Vector3d pivot, down;
  for (int i = 0; i < 20; ++i) {
    pivot = R * Vector3d(std::cos(geocentric), 0.0, std::sin(geocentric));
    down = -mu / (R * R * R) * pivot + rate * rate * Vector3d(pivot.x(), 0.0, 0.0);
    mu *= g / down.norm();
    geocentric += latitude - std::atan2(-down.z(), -down.x());
  }
  const Vector3d up = -down.normalized(), east = Y, north = up.cross(east);
  BodySpec earth = on(rigid("earth", 1.0, pivot, diagonal({1, 1, 1})), "", "revolute", {Z});
  earth.hinge.prescribed = {0};
  earth.hinge.v = {rate};
  BodySpec bob = on(particle("bob", 28.0, -length * up), "earth", "universal", {east, north}, pivot);
  bob.hinge.q = {std::asin(ref.initial()["amplitude_m"].as<double>() / length), 0.0};  // a turn about east: to the south or north
  const auto sim = run_of(system({earth, bob}, central_gravity(mu, false)), "dopri5", 1e-11);
  sim->prescribe(0, MotionProfile::hold(rate));
  // In the Earth's axes, from the pivot: east and north.
  const auto at = [=](const double* q) {
    const Vector3d r = -length * (Eigen::AngleAxisd(q[1], east) * Eigen::AngleAxisd(q[2], north) * up);
    return Eigen::Vector2d(r.dot(east), r.dot(north));
  };
  const Eigen::Vector2d start = at(sim->state().q.data());
  const double amplitude = start.norm();
  double azimuth = 0.0;  // clockwise from the start, seen from above, at the farthest points on the side of the start
  const auto farthest = crossings(
      *sim, -1,
      [=](const double* q, const double* v) {
        const double h = 1e-6 / amplitude, ahead[] = {q[0], q[1] + h * v[1], q[2] + h * v[2]},
                     behind[] = {q[0], q[1] - h * v[1], q[2] - h * v[2]};
        return at(ahead).squaredNorm() - at(behind).squaredNorm();  // the rate of the distance squared
      },
      [&] {
        const Eigen::Vector2d p = at(sim->state().q.data());
        if (p.dot(start) > 0.0) azimuth = std::atan2(p.x() * start.y() - p.y() * start.x(), p.dot(start));
      });
  sim->run(3600.0);
  ASSERT_GT(farthest->size(), 430u);                                                // twice per swing of 16.4 s
  const std::size_t last = farthest->size() - (farthest->size() % 2 == 0 ? 1 : 2);  // counted from 0: the odd ones are on its side
  expect_relative("precession", azimuth / kDegree / (farthest->at(last) / 3600.0), ref.number("plane precession"), ref.tolerance("rel"));
}

// P at the tip along the second rod: the load at which a pole first leaves the left half plane, by bisection.
TEST(ZieglersPendulum, FluttersAtThePublishedLoads) {
  const Published ref("rigid-ziegler-follower-force");
  const auto flutter = [](double damping) {
    std::vector<BodySpec> rods;
    for (const auto& [name, inboard, mass] : {std::tuple("lower", "", 2.0), std::tuple("upper", "lower", 1.0)}) {
      BodySpec rod = on(particle(name, mass, X), inboard, "revolute", {Z}, *inboard ? X : Vector3d(Vector3d::Zero()));
      rod.hinge.springs = {{0, 1.0, 0.0, damping, {}}};
      rod.nodes = {{"end", X, Eigen::Matrix3d::Identity(), {}}};
      rods.push_back(rod);
    }
    const auto model = compiled(system(rods));
    const State s = model->initial_state();
    const auto grows = [&](double load) {
      const NodeWrench push{model->find_node("upper.end"), false, {{0, 0, 0}, {-load, 0, 0}}};
      const auto linear = operators::linearize(*model, {.q = s.q.data(), .v = s.v.data(), .wrenches = {&push, 1}});
      double most = -HUGE_VAL;
      for (const operators::Pole& p : operators::poles(linear.A)) most = std::max(most, p.value.real());
      return most > (damping > 0.0 ? 0.0 : 1e-6);  // without damping all poles are on the axis, but for rounding: sqrt(P - P_cr) beyond
    };
    double low = 1.0, high = 3.0;
    for (int i = 0; i < 50; ++i) (grows(0.5 * (low + high)) ? high : low) = 0.5 * (low + high);
    return low;
  };
  expect_absolute("without damping", flutter(0.0), ref.number("P l/k without damping"), ref.tolerance("undamped"));
  expect_absolute("B = 0.001", flutter(0.001), ref.number("P l/k with B = 0.001"), ref.tolerance("damped"));
  expect_absolute("B = 0.1", flutter(0.1), ref.number("P l/k with B = 0.1"), ref.tolerance("damped"));
}

TEST(KovalevskayaTop, KeepsTheFourthIntegral) {
  const Published ref("rigid-kovalevskaya-top");
  const Vector3d c = Published::as_vector(ref.model()["com_from_point_m"]),
                 about = Published::as_vector(ref.model()["inertia_about_point_kgm2"]);
  const double m = ref.model()["mass"].as<double>(), g = 9.81, k = m * g * c.x() / about.z();
  BodySpec top = on(rigid("top", m, c, diagonal(about - m * c.x() * c.x() * Vector3d(0, 1, 1))), "", "ball");
  const VectorXd turn = Published::as_vector(ref.initial()["orientation_zyx_rad"]),
                 omega = Published::as_vector(ref.initial()["omega_body_rads"]);
  const Eigen::Quaterniond at = Eigen::AngleAxisd(turn[0], Z) * Eigen::AngleAxisd(turn[1], Y) * Eigen::AngleAxisd(turn[2], X);
  top.hinge.q = {at.w(), at.x(), at.y(), at.z()};
  top.hinge.v = {omega[0], omega[1], omega[2]};
  const auto sim = run_of(system({top}, uniform_gravity(-g * Z)), "dop853");
  const auto vertical = [&] { return Vector3d(quaternion(sim->state().q.data()).conjugate() * Z); };
  double off = 0.0;
  const double want = ref.number("fourth integral");
  sim->every({1, 50}, [&] {
    const double* w = sim->state().v.data();
    const Vector3d up = vertical();
    const double kept = std::pow(w[0] * w[0] - w[1] * w[1] - k * up[0], 2) + std::pow(2.0 * w[0] * w[1] - k * up[1], 2);
    off = worse(off, std::abs(kept / want - 1.0));
  });
  for (const char* t : {"1 s", "2 s"}) {
    sim->run(std::stod(t));
    expect_vector(std::string("omega at ") + t, sim->state().v, ref.vector(std::string("omega at ") + t), ref.tolerance("omega_abs"));
    expect_vector(std::string("vertical at ") + t, vertical(), ref.vector(std::string("vertical at ") + t), ref.tolerance("omega_abs"));
  }
  sim->run(20.0);
  expect_within("fourth integral", off, ref.tolerance("integral_rel"));
}

/// The far end of the spring is a carriage that is driven, ten metres ahead.
TEST(LuGreFriction, SticksAndSlipsAsAnotherProgramSays) {
  const Published ref("rigid-lugre-stick-slip");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double ahead = 10.0, drawn = of("drawn_at_ms");
  BodySpec block = on(particle("block", of("mass_kg"), Eigen::Vector3d::Zero()), "", "prismatic", {X});
  BodySpec carriage = on(particle("carriage", 1.0, Eigen::Vector3d::Zero()), "", "prismatic", {X}, ahead * X);
  carriage.hinge.v = {drawn}, carriage.hinge.prescribed = {0};
  SystemSpec spec = system({block, carriage});
  DeviceSpec friction, spring;
  friction.name = "friction", friction.type = "lugre_friction", friction.mounts["at"] = {"block", {}};
  for (const auto& [key, x] : {std::pair("coulomb", of("coulomb_N")),
                               {"breakaway", of("breakaway_N")},
                               {"stribeck_rate", of("stribeck_ms")},
                               {"stiffness", of("sigma_0")},
                               {"damping", of("sigma_1")},
                               {"viscous", of("sigma_2")}})
    friction.params[key].value = x;
  spring.name = "spring", spring.type = "spring_damper", spring.mounts["from"] = {"block", {}}, spring.mounts["to"] = {"carriage", {}};
  spring.params["stiffness"].value = of("spring_N_m"), spring.params["rest"].value = ahead;
  spec.devices = {friction, spring};
  const auto sim = run_of(spec, "cvode_bdf", 1e-11);
  sim->prescribe(1, MotionProfile::hold(drawn));
  std::vector<double> places;
  double top = 0.0;
  const auto slips = crossings(
      *sim, +1, [](const double*, const double* v) { return v[0] - 0.05; }, [&] { places.push_back(sim->state().q[0]); });
  sim->every({1, 1000}, [&] { top = std::max(top, sim->state().v[0]); });
  sim->run(28.0);
  ASSERT_EQ(slips->size(), 4U);
  expect_absolute("first slip [s]", slips->front(), ref.number("speed passes"), ref.tolerance("time_s"));
  for (std::size_t i = 1; i < slips->size(); ++i) {
    expect_absolute("cycle [s]", (*slips)[i] - (*slips)[i - 1], ref.number("cycle"), ref.tolerance("time_s"));
    expect_absolute("travel of a cycle [m]", places[i] - places[i - 1], ref.number("travel"), ref.tolerance("travel_m"));
  }
  expect_absolute("top speed [m/s]", top, ref.number("top speed"), ref.tolerance("speed_ms"));  // between looks 1e-7 of it
}

TEST(Chimney, BendsMostAtAThirdOfItsHeight) {
  const Published ref("rigid-falling-chimney");
  const double L = ref.model()["length_m"].as<double>(), m = ref.model()["mass_kg"].as<double>(),
               g = ref.model()["gravity_ms2"].as<double>();
  const VectorXd cuts = ref.vector("cuts"), moments = ref.vector("moments"), shear = ref.vector("shear forces");
  const auto part = [&](const char* name, double length) {
    const double mass = m * length / L, J = mass * length * length / 12.0;
    return rigid(name, mass, 0.5 * length * X, diagonal({1e-3, J, J}));
  };
  for (int i = 0; i < cuts.size(); ++i) {
    BodySpec low = on(part("low", cuts[i]), "", "revolute", {Z}), up = on(part("up", L - cuts[i]), "low", "locked", {}, cuts[i] * X);
    low.hinge.q = {ref.initial()["angle_rad"].as<double>()};
    const auto sim = run_of(system({low, up}, uniform_gravity(-g * Y)));
    const auto wrench = sim->observe().hinge_wrench(1);
    expect_absolute(fmt::format("moment at {} m", cuts[i]), wrench.n.z, moments[i], ref.tolerance("abs"));
    expect_absolute(fmt::format("shear at {} m", cuts[i]), wrench.f.y, shear[i], ref.tolerance("abs"));
  }
}

}  // namespace
}  // namespace cardan::test
