// Published cases of spacecraft: wheels, hinged panels, orbits, gravity gradient. Each to the tolerance its file
// recommends.
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "core/model/loops.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/system_modes.hpp"
#include "tests/cases/published.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
constexpr double kRpm = std::numbers::pi / 30.0;

/// Modified Rodrigues parameters of the shorter rotation.
Vector3d mrp(const double* wxyz) {
  const Eigen::Quaterniond q = quaternion(wxyz);
  return (q.w() < 0 ? -1.0 : 1.0) / (1.0 + std::abs(q.w())) * q.vec();
}
std::vector<double> joined(const VectorXd& a, const VectorXd& b) {
  std::vector<double> out(a.data(), a.data() + a.size());
  out.insert(out.end(), b.data(), b.data() + b.size());
  return out;
}
const Eigen::Vector4d kIdentity(1, 0, 0, 0);

// The case gives the spin inertia J of the wheels alone and counts them in the hub's inertia: each is a mass at the
// hub's mass centre with J in every direction, and both are taken off the hub.
TEST(ReactionWheels, TurnTheHubInOrbit) {
  const Published ref("rigid-basilisk-rw-balanced");
  const YAML::Node hub_data = ref.model()["hub"], wheels = ref.model()["wheels"];
  const double J = wheels["spin_inertia_kgm2"].as<double>(), wheel_mass = 1.0;
  const Vector3d c = Published::as_vector(hub_data["com_in_body_m"]), omega = Published::as_vector(ref.initial()["omega_body"]);
  const Vector3d r_C = Published::as_vector(ref.initial()["r_C_m"]), v_C = Published::as_vector(ref.initial()["v_C_ms"]);
  const Matrix3d sphere = J * Matrix3d::Identity();
  const Matrix3d whole = diagonal(Published::as_vector(hub_data["inertia_diag_about_com_kgm2"]));
  BodySpec hub = on(rigid("hub", hub_data["mass_kg"].as<double>() - 3 * wheel_mass, c, whole - 3 * sphere), "", "free");
  hub.hinge.q = joined(kIdentity, r_C - c);
  hub.hinge.v = joined(omega, v_C - omega.cross(c));
  std::vector<BodySpec> bodies = {hub};
  for (int i = 0; i < 3; ++i) {
    const auto at = static_cast<std::size_t>(i);
    bodies.push_back(on(rigid(fmt::format("wheel_{}", i), wheel_mass, Vector3d::Zero(), sphere), "hub", "revolute",
                        {Published::as_vector(wheels["axes"][at])}, c));
    bodies.back().hinge.v = {wheels["speeds_rpm"][at].as<double>() * kRpm};
  }
  const auto sim = run_of(system(bodies, central_gravity(ref.model()["mu_m3s2"].as<double>(), false)));
  for (int i = 0; i < 3; ++i) sim->set_force(6 + i, ref.model()["motor_torque_Nm"][static_cast<std::size_t>(i)].as<double>());
  sim->run(0.5);
  for (int i = 0; i < 3; ++i) sim->set_force(6 + i, 0.0);
  sim->run(1.0);
  const State& s = sim->state();
  const VectorXd sigma = ref.vector("sigma_BN at 1 s");
  expect_vector("r_B", s.q.segment<3>(4), ref.vector("r_B at 1 s"), ref.tolerance("r_m"));
  expect_vector("r_B, recomputed", s.q.segment<3>(4), ref.vector("r_B recomputed"), 2e-8);  // 1 ulp of r at 9 digits after the point
  expect_vector("sigma", mrp(s.q.data()), sigma, ref.tolerance("sigma_rel"), largest(sigma));
  expect_vector("sigma, recomputed", mrp(s.q.data()), ref.vector("sigma recomputed"), 1e-10, largest(sigma));  // its digits
  expect_vector("wheel speeds", s.v.tail<3>() / kRpm, ref.vector("wheel speeds"), 1e-10);                      // its digits
}

TEST(ReactionWheel, TakesUpWhatTheHubGives) {
  const Published ref("rigid-basilisk-rw-boe");
  const double J = ref.model()["wheel_inertia_kgm2"].as<double>();
  // The wheel's spin inertia counts about z alone: the hub turns with the wheel's bearing, not with the wheel.
  BodySpec hub = on(rigid("hub", 5.0, Vector3d::Zero(), diagonal({2, 2, 2})), "", "revolute", {Z});
  BodySpec wheel = on(rigid("wheel", 1.0, Vector3d::Zero(), diagonal({J, J, J})), "hub", "revolute", {Z});
  hub.hinge.v = {0.35};
  wheel.hinge.v = {100.0 * kRpm};
  const auto sim = run_of(system({hub, wheel}));
  const VectorXd rate = ref.vector("hub rate"), angle = ref.vector("hub angle"), speed = ref.vector("wheel speed");
  for (int i = 0; i < 5; ++i) {
    const double t = 2.0 * (i + 1), rel = ref.tolerance("rel");
    if (i == 2) {
      sim->run(5.0);
      sim->set_force(1, 0.2);
    }
    sim->run(t);
    expect_absolute(fmt::format("hub rate at {} s", t), sim->state().v[0], rate[i], rel);
    expect_absolute(fmt::format("hub angle at {} s", t), sim->state().q[0], angle[i], rel);
    if (i >= 2) expect_relative(fmt::format("wheel speed at {} s", t), sim->state().v[1], speed[i - 2], rel);
  }
}

TEST(HingedPanels, ReactOnTheirHub) {
  const Published ref("rigid-basilisk-planar-hinged-panels");
  // Motion in the plane: the other moments do not enter.
  std::vector<BodySpec> bodies = {on(rigid("hub", 750.0, Vector3d::Zero(), diagonal({600, 600, 600})), "", "planar", {X, Y})};
  for (const auto& p : ref.model()["panels"]) {
    const Vector3d com(p["com_from_hinge_m"][0].as<double>(), p["com_from_hinge_m"][1].as<double>(), 0.0);
    const Vector3d at(p["hinge_in_hub_m"][0].as<double>(), p["hinge_in_hub_m"][1].as<double>(), 0.0);
    const double I = p["inertia_about_hinge_axis_at_com_kgm2"].as<double>();
    BodySpec panel =
        on(rigid(fmt::format("panel_{}", bodies.size()), p["mass_kg"].as<double>(), com, diagonal({I, I, I})), "hub", "revolute", {Z}, at);
    panel.hinge.springs = {{0, p["spring_Nmrad"].as<double>(), 0.0, p["damper_Nms"].as<double>(), {}}};
    bodies.push_back(panel);
  }
  const auto sim = run_of(system(bodies));
  const int thruster = sim->add_wrench(sim->model().find_node("hub"), false);
  const auto push = [&](double fx, double fy, double torque) { sim->set_wrench(thruster, {{0, 0, torque}, {fx, fy, 0}}); };
  const auto check = [&](double t, const char* quantity) {
    sim->run(t);
    const VectorXd want = ref.vector(quantity);
    expect_vector(fmt::format("hub at {} s [m]", t), sim->state().q.head<2>(), want.head<2>(), ref.tolerance("position_m"));
    expect_vector(fmt::format("angles at {} s", t), sim->state().q.tail<3>(), want.tail<3>(), ref.tolerance("angle_rad"));
  };
  push(0.2, 0.7, ref.model()["loads"][0]["torque_Nm"].as<double>());
  check(5.0, "t=5 s");
  push(0, 0, 0);
  check(11.0, "t=11 s");
  push(0.0, 1.0, ref.model()["loads"][1]["torque_Nm"].as<double>());
  check(18.0, "t=18 s");
  push(0, 0, 0);
  check(20.0, "t=20 s");
  // Along the way: impulse, angular impulse and work against what the thruster gave, to the integrator's 1e-13 per
  // step.
  const LedgerState ledger = sim->ledger();
  expect_within("ledger", worse({ledger.linear_relative, ledger.angular_relative, ledger.energy_relative}), 1e-11);
}

TEST(AsymmetricHub, TumblesAlongItsOrbit) {
  const Published ref("rigid-torquefree-asym-basilisk");
  BodySpec hub = on(rigid("hub", 100.0, Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["inertia_diag_kgm2"]))), "", "free");
  const VectorXd omega = Published::as_vector(ref.initial()["omega_body_rads"]);
  hub.hinge.q = joined(kIdentity, Published::as_vector(ref.initial()["r_m"]));
  hub.hinge.v = joined(omega, Published::as_vector(ref.initial()["v_ms"]));
  const auto sim = run_of(system({hub}, central_gravity(ref.model()["mu_m3s2"].as<double>(), false)));
  const auto expect_omega = [&](const std::string& at, const VectorXd& want) {
    expect_vector("omega at " + at, sim->state().v.head<3>(), want, ref.tolerance("omega_abs"));
  };
  for (const std::string t : {"2 s", "5 s", "10 s"}) {
    sim->run(std::stod(t));
    expect_omega(t, ref.vector("omega_body at " + t));
  }
  const VectorXd r = ref.vector("r at 10 s");
  expect_vector("r", sim->state().q.tail<3>(), r, ref.tolerance("position_rel"), r.norm());
  expect_vector("sigma", mrp(sim->state().q.data()), ref.vector("sigma_BN at 10 s"), ref.tolerance("mrp_abs"));
  sim->run(ref.number("period of the body-rate motion"));
  expect_omega("one period", omega);
}

TEST(KeplerOrbit, ArrivesAfterFortyMinutes) {
  const Published ref("orbit-kepler-vallado-2-4");
  BodySpec body = on(particle("body", 3.0, Vector3d::Zero()), "", "translational");
  body.hinge.q = joined(VectorXd(1e3 * Published::as_vector(ref.initial()["r_km"])), VectorXd());
  body.hinge.v = joined(VectorXd(1e3 * Published::as_vector(ref.initial()["v_kms"])), VectorXd());
  const auto sim = run_of(system({body}, central_gravity(1e9 * ref.model()["mu_km3s2"].as<double>(), true)));
  sim->run(2400.0);
  expect_vector("r [km]", 1e-3 * sim->state().q, ref.vector("r, 13 digits"), ref.tolerance("r_km"));
  // Free fall: an accelerometer reads the rounding of 8 m/s^2 less 8 m/s^2.
  const int node = sim->model().find_node("body");
  expect_absolute("specific force [m/s^2]", sim->observe().node(node).specific_force.norm(), 0.0, 1e-14);
  expect_vector("v [km/s]", 1e-3 * sim->state().v, ref.vector("v, 13 digits"), ref.tolerance("v_kms"));
}

// A circular orbit in the x-y plane; body axes x radial (yaw), y along the track (roll), z normal (pitch). The orbit
// feels the body's extent by (0.05 m / 1e7 m)^2.
TEST(GravityGradient, LibratesWithTheEllipticPeriod) {
  const Published ref("orbit-gravity-gradient-libration");
  const double mu = 398600.4418e9, radius = 1e7, n = std::sqrt(mu / (radius * radius * radius));
  const Vector3d inertia(1.0, 2.5, 3.0);
  const double K = (inertia.y() - inertia.x()) / inertia.z();
  const VectorXd want = ref.vector("T n sqrt(3K)");
  const double amplitudes[] = {10.0, 30.0, 60.0, 80.0};
  for (int i = 0; i < 4; ++i) {
    const double A = amplitudes[i] * std::numbers::pi / 180.0;
    BodySpec body = on(rigid("body", 1000.0, Vector3d::Zero(), diagonal(inertia)), "", "free");
    body.hinge.q = joined(Eigen::Vector4d(std::cos(A / 2), 0, 0, std::sin(A / 2)), radius * X);
    body.hinge.v = joined(n * Z, n * radius * Y);
    const auto sim = run_of(system({body}, central_gravity(mu, true)), "dopri5", 1e-12);
    const auto back = crossings(*sim, -1, [n](const double*, const double* v) { return v[2] - n; });
    sim->run(1.05 * want[i] / (n * std::sqrt(3 * K)));
    ASSERT_EQ(back->size(), 1u);
    expect_relative(fmt::format("period from {} deg", amplitudes[i]), back->front() * n * std::sqrt(3 * K), want[i], ref.tolerance("rel"));
  }
}

// The roll angle is a sum of two cosines, cos(a k) and cos(b k) of samples k: one recursion of five samples has them all.
TEST(GravityGradient, RollAndYawHaveTheFrequenciesOfDeBraAndDelp) {
  const Published ref("orbit-debra-delp-roll-yaw");
  const double mu = ref.model()["mu_m3s2"].as<double>(), radius = ref.model()["radius_m"].as<double>(),
               n = std::sqrt(mu / std::pow(radius, 3));
  const double roll = ref.initial()["roll_rad"].as<double>(), step = 300.0;
  BodySpec body =
      on(rigid("body", 1000.0, Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["inertia_yaw_roll_pitch_kgm2"]))), "", "free");
  body.hinge.q = joined(Eigen::Vector4d(std::cos(0.5 * roll), 0, std::sin(0.5 * roll), 0), radius * X);
  body.hinge.v = joined(n * Z, n * radius * Y);
  const auto sim = run_of(system({body}, central_gravity(mu, true)), "dop853");
  std::vector<Vector3d> turned;
  for (int k = 0; k * step * n < 6.0 * std::numbers::pi; ++k) {
    sim->run(k * step);
    const Eigen::Quaterniond from_orbit = Eigen::AngleAxisd(-n * sim->time(), Z) * quaternion(sim->state().q.data());
    turned.push_back(2.0 * (from_orbit.w() < 0 ? -1.0 : 1.0) * from_orbit.vec() / roll);
  }
  const VectorXd w = ref.vector("frequencies over that of the orbit") * n * step;
  const double a = 2.0 * std::cos(w[0]), b = 2.0 * std::cos(w[1]);
  double off = 0.0;
  for (std::size_t k = 2; k + 2 < turned.size(); ++k)
    for (const int axis : {0, 1})
      off = worse(off, std::abs(turned[k + 2][axis] + turned[k - 2][axis] - (a + b) * (turned[k + 1][axis] + turned[k - 1][axis]) +
                                (2.0 + a * b) * turned[k][axis]));
  expect_within("recursion of roll and yaw", off, ref.tolerance("recursion"));
}

SystemSpec dumbbell(const Published& ref) {
  const VectorXd mass = Published::as_vector(ref.model()["masses_kg"]), radius = Published::as_vector(ref.model()["radii_m"]);
  const double rate = ref.number("rate of revolution");
  SystemSpec spec = system({}, central_gravity(ref.model()["mu_m3s2"].as<double>(), true));
  for (int i = 0; i < 2; ++i) {
    BodySpec body = on(particle(fmt::format("body_{}", i), mass[i], Vector3d::Zero()), "", "translational");
    body.hinge.q = {radius[i], 0, 0}, body.hinge.v = {0, rate * radius[i], 0};
    spec.bodies.push_back(body);
  }
  LoopSpec tether;
  tether.name = "tether", tether.type = "distance", tether.length = radius[0] - radius[1];
  tether.from.body = "body_0", tether.to.body = "body_1";
  spec.loops = {tether};
  return spec;
}

TEST(Tether, HoldsTwoSatellitesOnTheVertical) {
  const Published ref("orbit-tether-dumbbell");
  const VectorXd radius = Published::as_vector(ref.model()["radii_m"]);
  const double rate = ref.number("rate of revolution");
  SystemSpec spec = dumbbell(ref);
  for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers}) {
    spec.loop_form = form;
    const auto sim = run_of(spec, "dop853", 1e-12);
    const std::string by = loop_forms()[static_cast<std::size_t>(form)] + ": ";
    double slack = 0.0;
    const double want = ref.number("tension [N]");
    sim->every({60, 1}, [&] { slack = worse(slack, std::abs(std::abs(sim->loop_forces().multipliers[0]) / want - 1.0)); });
    sim->run(2.0 * std::numbers::pi / rate);
    expect_within(by + "tension", slack, ref.tolerance("tension_rel"));
    const VectorXd q = sim->state().q;
    expect_vector(by + "after a revolution [m]", q, (VectorXd(6) << radius[0], 0, 0, radius[1], 0, 0).finished(),
                  ref.tolerance("position_m"));
  }
}

// Methods that keep their history are told to start anew where it is off the closed loops: by what their tolerance is relative to, places
// of 7000 km, not by the size of the tether. Else they begin at order 1 in every step, and are kilometres off.
TEST(Tether, IsHeldByMethodsThatKeepTheirHistory) {
  const Published ref("orbit-tether-dumbbell");
  const double rate = ref.number("rate of revolution");
  for (const char* method : {"cvode_adams", "cvode_bdf"}) {
    const auto sim = run_of(dumbbell(ref), method, 1e-9);
    const Vector3d start = sim->state().q.head<3>();
    sim->run(2.0 * std::numbers::pi / rate);
    const double off = (sim->state().q.head<3>() - start).norm() / start.norm();
    expect_within(fmt::format("{}: after a revolution, of the radius", method), off, 1e-5);  // errors of steps add up to 1e3 tolerances
  }
}

TEST(AllenEggers, FallsIntoTheAirWithTheSpeedOfTheClosedForm) {
  const Published ref("env-allen-eggers-entry");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  const double H = of("scale_height_m"), R = of("radius_m"), ground = of("density_at_ground"),
               start = ref.initial()["height_m"].as<double>(), speed = ref.initial()["speed_ms"].as<double>(),
               beta = of("mass_kg") / (of("area_m2") * of("drag_coefficient"));
  BodySpec body = on(particle("body", of("mass_kg"), Vector3d::Zero()), "", "translational");
  body.hinge.q = {R + start, 0, 0}, body.hinge.v = {-speed, 0, 0};
  SystemSpec spec = system({body});
  FieldSpec air;
  air.name = "air", air.type = "exponential_atmosphere";
  for (const auto& [key, x] : {std::pair("density", ground), {"height", 0.0}, {"scale_height", H}, {"radius", R}})
    air.params[key].value = x;
  spec.fields = {air};
  DeviceSpec drag;
  drag.name = "drag", drag.type = "drag", drag.mounts["at"] = {"body", {}};
  drag.params["area"].value = of("area_m2"), drag.params["coefficient"].value = of("drag_coefficient");
  spec.devices = {drag};
  const auto sim = run_of(spec, "dop853");
  double off = 0.0, largest = 0.0, there = 0.0;
  sim->every({1, 1000}, [&] {
    const double h = sim->state().q[0] - R, v = -sim->state().v[0];
    off = worse(off, std::abs(v / (speed * std::exp(-ground * H / (2.0 * beta) * (std::exp(-h / H) - std::exp(-start / H)))) - 1.0));
    if (const double a = sim->vdot()[0]; a > largest) largest = a, there = v;
  });
  sim->run(30.0);
  expect_within("speed over height", off, ref.tolerance("speed_rel"));
  expect_relative("largest deceleration", largest, ref.number("largest deceleration"), ref.tolerance("peak_rel"));
  expect_relative("speed there", there, ref.number("speed there"), 5e-4);  // between two looks 1252 m/s^2 take 1.3 m/s
}

GravitySpec pull_of_field(const std::string& name) {
  GravitySpec g;
  g.kind = GravitySpec::Kind::field, g.fields = {name};
  return g;
}
/// A particle in the gravity of an oblate planet.
SystemSpec about_an_oblate_planet(double mu, double radius, double J2, const Vector3d& r, const Vector3d& v) {
  BodySpec body = on(particle("body", 100.0, Vector3d::Zero()), "", "translational");
  body.hinge.q = {r.x(), r.y(), r.z()}, body.hinge.v = {v.x(), v.y(), v.z()};
  FieldSpec planet;
  planet.name = "planet", planet.type = "zonal_harmonics";
  for (const auto& [key, x] : {std::pair("mu", mu), {"radius", radius}, {"J2", J2}}) planet.params[key].value = x;
  SystemSpec spec = system({body}, pull_of_field("planet"));
  spec.fields = {planet};
  return spec;
}

TEST(DraglessSphere, FallsToTheRotatingEarthAsSixProgramsSay) {
  const Published ref("orbit-nesc-atmos01-dragless-sphere");
  const YAML::Node earth = ref.model()["earth"];
  const auto of = [&](const char* name) { return earth[name].as<double>(); };
  const double a = of("radius_m"), rate = of("rate_rads"), foot = 0.3048, start = a + ref.initial()["altitude_m"].as<double>();
  const auto sim = run_of(about_an_oblate_planet(of("mu_m3s2"), a, of("J2"), start * X, rate * start * Y), "dop853");
  expect_relative("gravity at the start [ft/s2]", -sim->vdot()[0] / foot, ref.number("local gravity at t=0"), 1e-11);  // its digits
  sim->run(30.0);
  const Vector3d r = sim->state().q;
  expect_vector("position [m]", r, foot * ref.vector("inertial position at 30 s"), ref.tolerance("position_m"));
  // On the equator the ellipsoid is as far as its radius. Of the six programs those that print the position.
  const VectorXd altitude = foot * ref.vector("altitude at 30 s, six tools");
  for (const int tool : {3, 4, 5})
    expect_absolute(fmt::format("altitude, tool 0{} [m]", tool + 1), r.norm() - a, altitude[tool], ref.tolerance("altitude_m"));
  const double longitude = (std::atan2(r.y(), r.x()) - rate * 30.0) * 180.0 / std::numbers::pi;
  expect_absolute("longitude [deg]", longitude, ref.number("longitude at 30 s"), ref.tolerance("longitude_deg"));
}

/// Eight hours of the program of the Johnson Space Center: torque of the gravity gradient, or a push of a thousand seconds.
TEST(OrbitsOfJEOD, TurnUnderTheTorqueOfGravityAndUnderAPush) {
  const Published ref("orbit-jeod-torques");
  for (const std::string run : {"run_10A", "run_10D", "run_9C"}) {
    const bool pushed = run == "run_9C";
    const YAML::Node station = ref.model()["station"], J = station["inertia_kgm2"], start = ref.initial()[run];
    const auto of = [&](const char* name) { return J[name].as<double>(); };
    Matrix3d inertia = diagonal(Published::as_vector(ref.model()["cylinder_kgm2"]));
    if (pushed) inertia << of("xx"), of("xy"), of("xz"), of("xy"), of("yy"), of("yz"), of("xz"), of("yz"), of("zz");
    const VectorXd T = Published::as_vector(start["T_inertial_to_body"]);
    const Eigen::Quaterniond q(Eigen::Map<const Matrix3d>(T.data()));  // by columns: body to inertial
    BodySpec body = on(rigid("body", pushed ? station["mass_kg"].as<double>() : 12250.0, Vector3d::Zero(), inertia), "", "free");
    body.hinge.q = joined(Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()), Published::as_vector(start["r_m"]));
    body.hinge.v = joined(Published::as_vector(start["omega_body_rads"]), Published::as_vector(start["v_ms"]));
    NodeSpec middle;
    middle.name = "middle";
    body.nodes = {middle};
    const auto sim = run_of(system({body}, central_gravity(ref.model()["mu_m3s2"].as<double>(), !pushed)), "dop853");
    if (pushed) {
      const int load = sim->add_wrench(0, false);
      sim->run(1000.0);
      sim->set_wrench(load, {{10.0, 0.0, 0.0}, {10.0, 0.0, 0.0}});
      sim->run(2000.0);
      sim->set_wrench(load, {});
    }
    sim->run(run == "run_10D" ? 28680.0 : 28800.0);
    const State& s = sim->state();
    expect_vector(run + " position [m]", s.q.tail<3>(), ref.vector(run + " position"), ref.tolerance("position_m"));
    const VectorXd omega = ref.vector(run + " omega");
    expect_vector(run + " rate [rad/s]", VectorXd(s.v.head<3>().tail(omega.size())), omega, ref.tolerance("omega_rads"));
    if (run != "run_10D") {
      const Vector3d row = quaternion(s.q.data()).toRotationMatrix().col(0);
      expect_vector(run + " first row of T", row, ref.vector(run + " first row of T"), ref.tolerance("row"));
    }
  }
}

// Osculating elements swing about the mean ones, of which the case speaks: the start is beside them by what the theory of first order says
// of the semi-major axis (Kaula 1966), and drifts are taken over whole revolutions from one ascending node to the next.
TEST(OblatePlanet, TurnsOrbitsAtTheSecularRates) {
  const Published ref("orbit-j2-secular");
  const double mu = ref.model()["mu_m3s2"].as<double>(), R = ref.model()["radius_m"].as<double>(), J2 = ref.model()["J2"].as<double>();
  const auto drifts = [&](const YAML::Node& orbit, double omega) {
    const double a = orbit["a_m"].as<double>(), e = orbit["e"].as<double>(), i = orbit["i_deg"].as<double>() * std::numbers::pi / 180.0;
    const double s2 = std::pow(std::sin(i), 2), apogee = 1.0 + e, u = omega + std::numbers::pi;
    const double beside =
        J2 * R * R / a *
        (std::pow(apogee, -3) * (1.0 - 1.5 * s2 + 1.5 * s2 * std::cos(2.0 * u)) - (1.0 - 1.5 * s2) * std::pow(1.0 - e * e, -1.5));
    const double r = (a + beside) * apogee, v = std::sqrt(mu / (a + beside) * (1.0 - e) / (1.0 + e));
    const Vector3d out(std::cos(u), std::sin(u) * std::cos(i), std::sin(u) * std::sin(i));
    const Vector3d ahead(-std::sin(u), std::cos(u) * std::cos(i), std::cos(u) * std::sin(i));
    const auto sim = run_of(about_an_oblate_planet(mu, R, J2, r * out, v * ahead), "dop853", 1e-12);
    std::vector<Vector3d> nodes;  // [s], longitude and argument of perigee
    const auto times = crossings(
        *sim, +1, [](const double* q, const double*) { return q[2]; },
        [&] {
          const Vector3d x = sim->state().q, w = sim->state().v, h = x.cross(w), node = Z.cross(h).normalized();
          const Vector3d perigee = w.cross(h) / mu - x.normalized();
          nodes.push_back(
              {sim->time(), std::atan2(node.y(), node.x()), std::atan2(perigee.dot(h.normalized().cross(node)), perigee.dot(node))});
        });
    sim->run(5.0 * 86400.0);
    const Vector3d over = nodes.back() - nodes.front();
    const double days = over[0] / 86400.0, degree = 180.0 / std::numbers::pi;
    return Vector3d(std::remainder(over[1], 2 * std::numbers::pi) * degree / days,
                    std::remainder(over[2], 2 * std::numbers::pi) * degree / days, 360.0 * static_cast<double>(nodes.size() - 1) / days);
  };
  const YAML::Node orbits = ref.initial()["orbits"], near = ref.at("orbit 1"), far = ref.at("orbit 2");
  const auto rate = [](const YAML::Node& of, const char* name) { return of[name].as<double>(); };
  const Vector3d low = drifts(orbits[0], 0.5 * std::numbers::pi);
  expect_relative("node of orbit 1 [deg/day]", low[0], rate(near, "raan"), ref.tolerance("rel"));
  // From node to node: mean motion, excess and perigee together; against what J2 takes of it. J2^2 is 1e-6 of the mean motion, and some
  // times that of the semi-major axis: 1 % of what J2 takes.
  const double taken = rate(near, "mean_excess") + rate(near, "argp");
  expect_relative("turn from node to node of orbit 1, less the mean motion [deg/day]", low[2] - rate(near, "mean_motion"), taken, 0.01);
  const Vector3d molniya = drifts(orbits[1], 1.5 * std::numbers::pi);
  expect_relative("node of orbit 2 [deg/day]", molniya[0], rate(far, "raan"), ref.tolerance("rel"));
  expect_absolute("perigee of orbit 2 [deg/day]", molniya[1], rate(far, "argp"), ref.tolerance("rel") * std::abs(rate(far, "raan")));
}

// Not a vehicle: the integrators on a field that the engine does not have. An error grows a millionfold on the way
// round.
TEST(ArenstorfOrbit, ClosesAfterItsPeriod) {
  const Published ref("orbit-arenstorf");
  const double mu = ref.model()["mu"].as<double>();
  OdeProblem problem;
  problem.n = 4;
  problem.rhs = [mu](double, const double* x, double* f) {
    const double a = std::pow(std::hypot(x[0] + mu, x[1]), -3), b = std::pow(std::hypot(x[0] - (1.0 - mu), x[1]), -3);
    f[0] = x[2], f[1] = x[3];
    f[2] = x[0] + 2.0 * x[3] - (1.0 - mu) * (x[0] + mu) * a - mu * (x[0] - (1.0 - mu)) * b;
    f[3] = x[1] - 2.0 * x[2] - (1.0 - mu) * x[1] * a - mu * x[1] * b;
    return true;
  };
  problem.absolute_tolerance.assign(4, 1e-14);
  const auto integrator = make_integrator(problem, {.method = "dopri5", .relative_tolerance = 1e-14});
  const auto start = [&](const char* name) { return ref.initial()[name].as<double>(); };
  const Eigen::Vector4d from(start("x"), start("y"), start("xd"), start("yd"));
  Eigen::Vector4d x = from;
  integrator->restart(0.0, x.data());
  for (double t = 0.0; t < ref.number("period");) t = integrator->step(ref.number("period"), x.data()).t;
  expect_vector("return", x, from, ref.tolerance("return_error"));
}

// Among the poles are also those of rest and of the spin itself.
TEST(BallInTube, DampsNutation) {
  const Published ref("rigid-ball-in-tube-damper");
  const auto of = [&](const char* name) { return ref.model()[name].as<double>(); };
  BodySpec body =
      on(rigid("body", of("body_mass_kg"), Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["body_inertia_kgm2"]))), "", "free");
  body.hinge.v = {0, 0, ref.initial()["spin_rads"].as<double>(), 0, 0, 0};
  BodySpec ball = on(particle("ball", of("ball_mass_kg"), Vector3d::Zero()), "body", "prismatic", {Z}, of("tube_at_m") * X);
  SpringDamper spring;
  spring.stiffness = of("spring_Nm"), spring.damping = of("damper_Nsm");
  ball.hinge.springs = {spring};
  const auto model = compiled(system({body, ball}));
  const State s = model->initial_state();
  const auto poles = operators::poles(operators::linearize(*model, {.q = s.q.data(), .v = s.v.data()}).A);
  for (const char* which : {"nutation", "ball"}) {
    const VectorXd want = ref.vector(which);
    const std::complex<double> pole(want[0], want[1]);
    double off = std::numeric_limits<double>::infinity();
    for (const operators::Pole& p : poles) off = std::min(off, std::abs(p.value - pole) / std::abs(pole));
    expect_within(fmt::format("pole of the {}", which), off, ref.tolerance("rel"));
  }
}

TEST(ScissoredPair, TurnsTheBusAboutOneAxis) {
  const Published ref("rigid-scissored-pair");
  const double J = ref.model()["bus_inertia_y_kgm2"].as<double>(), spin = ref.model()["spin_rads"].as<double>();
  std::vector<BodySpec> bodies = {on(rigid("bus", 100.0, Vector3d::Zero(), diagonal({50, J, 60})), "", "free")};
  for (const int i : {0, 1}) {
    const std::string gimbal = fmt::format("gimbal_{}", i), rotor = fmt::format("rotor_{}", i);
    bodies.push_back(on(rigid(gimbal, 2.0, Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["gimbal_inertia_kgm2"]))), "bus",
                        "revolute", {Z}));
    bodies.back().hinge.prescribed = {0};
    bodies.push_back(on(rigid(rotor, 4.0, Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["rotor_inertia_kgm2"]))), gimbal,
                        "revolute", {X}));
    bodies.back().hinge.v = {i == 0 ? spin : -spin};
  }
  const auto sim = run_of(system(bodies), "dop853");
  for (const int i : {0, 1}) sim->prescribe(6 + 2 * i, MotionProfile::sine(i == 0 ? 0.7 : -0.7, 0.1, 0.0));
  for (const int t : {1, 4}) {
    sim->run(t);
    const Vector3d w = sim->state().v.head<3>();
    expect_absolute(fmt::format("rate at {} s", t), w.y(), ref.number(fmt::format("rate at {} s", t)), ref.tolerance("abs"));
    expect_within(fmt::format("other rates at {} s", t), std::max(std::abs(w.x()), std::abs(w.z())), ref.tolerance("abs"));
  }
}

// Pitch is the angle of the body beyond the true anomaly, which is that of its place.
TEST(Beletsky, ForcedByTheEccentricity) {
  const Published ref("orbit-beletsky-pitch");
  const double mu = ref.model()["mu_m3s2"].as<double>(), a = ref.model()["semi_major_axis_m"].as<double>(),
               e = ref.model()["eccentricity"].as<double>(), perigee = a * (1.0 - e), speed = std::sqrt(mu * (1.0 + e) / perigee),
               pitch = ref.initial()["pitch_rad"].as<double>(), half = 0.5 * pitch;
  BodySpec body = on(rigid("body", 100.0, Vector3d::Zero(), diagonal(Published::as_vector(ref.model()["inertia_kgm2"]))), "", "free");
  body.hinge.q = {std::cos(half), 0, 0, std::sin(half), perigee, 0, 0};
  body.hinge.v = {0, 0, speed / perigee, 0, speed, 0};
  SimulationOptions options;
  options.integrator = {.method = "dop853", .relative_tolerance = 1e-13};
  options.tolerances.angle = 1e-13, options.tolerances.rate = 1e-16;  // of rates of 1e-3 rad/s
  Simulation sim(compiled(system({body}, central_gravity(mu, true))), options);
  for (const int revolution : {1, 3}) {
    sim.run(revolution * 2.0 * std::numbers::pi * std::sqrt(a * a * a / mu));
    const State& s = sim.state();
    const Vector3d r = s.q.segment<3>(4), v = s.v.segment<3>(3);
    const double anomaly_rate = r.cross(v).z() / r.squaredNorm();
    const Eigen::Vector2d ours(std::remainder(2.0 * std::atan2(s.q[3], s.q[0]) - std::atan2(r.y(), r.x()), 2.0 * std::numbers::pi),
                               s.v[2] / anomaly_rate - 1.0);
    expect_vector(fmt::format("pitch after {} revolutions", revolution), ours, ref.vector(fmt::format("after {} revolution", revolution)),
                  ref.tolerance("abs"));
  }
}

}  // namespace
}  // namespace cardan::test
