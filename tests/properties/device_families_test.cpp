// Devices that come with Cardan, each against its closed form.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;

BodySpec free_bus(double mass) { return on(rigid("bus", mass, {0, 0, 0}, diagonal({20, 25, 30})), "", "free"); }
BodySpec hinged(double J) { return on(rigid("arm", 3.0, {0, 0, 0}, diagonal({J, J, J})), "", "revolute", {{0, 0, 1}}); }

/// A pulse of 0.5 s of a valve that rises and falls with one time constant brings F times 0.5 s, exactly, whatever the steps.
TEST(Thruster, BringsTheImpulseOfItsPulse) {
  const double F = 4.5, isp = 226.1, tau = 0.02, m = 100.0;
  SystemSpec spec = system({free_bus(m)});
  spec.devices = {with_vector(
      device("jet", "thruster", {{"thrust", F}, {"specific_impulse", isp}, {"rise_time", tau}, {"fall_time", tau}}, {{"at", "bus"}}),
      "direction", {0, 3, 4})};
  Simulation sim(compiled(spec), accurate());
  sim.every({1, 2}, [&] { sim.set_device_input(0, sim.time() < 0.25 ? 1.0 : 0.0); });
  sim.run(1.5);
  EXPECT_NEAR(sim.state().v[4], 0.6 * F * 0.5 / m, 1e-10);
  EXPECT_NEAR(sim.state().v[5], 0.8 * F * 0.5 / m, 1e-10);
  EXPECT_NEAR(sim.state().z[1], F * 0.5 / (isp * 9.80665), 1e-11);
  EXPECT_TRUE(sim.ledger().pass);
  // without delay
  spec.devices[0].params["rise_time"] = spec.devices[0].params["fall_time"] = number(0.0);
  spec.devices[0].inputs["command"] = {2.0, {}};  // cut to 1
  Simulation at_once(compiled(spec), accurate());
  at_once.run(0.5);
  EXPECT_NEAR(at_once.state().v[5], 0.8 * F * 0.5 / m, 1e-12);
  at_once.set_device_input(0, -1.0), at_once.run(1.0);  // to 0
  EXPECT_NEAR(at_once.state().v[5], 0.8 * F * 0.5 / m, 1e-12);
  EXPECT_EQ(at_once.device_output(0), 0.0);
  EXPECT_EQ(at_once.state().z[0], 0.0);  // no lag that nothing follows: it would be a pole, and steps would heed it
}

/// A valve that opens slowly and closes fast: 1 - e^(-t / rise) while it is told to open, then falls by e^(-t / fall).
TEST(Thruster, OpensAndClosesByItsOwnTimes) {
  const double F = 4.5, rise = 0.4, fall = 0.1, m = 100.0, level = -std::expm1(-0.5 / rise);
  SystemSpec spec = system({free_bus(m)});
  spec.devices = {with_vector(
      device("jet", "thruster", {{"thrust", F}, {"specific_impulse", 220.0}, {"rise_time", rise}, {"fall_time", fall}}, {{"at", "bus"}}),
      "direction", {0, 0, 1})};
  Simulation sim(compiled(spec), accurate());
  sim.every({1, 2}, [&] { sim.set_device_input(0, sim.time() == 0.0 ? 1.0 : 0.0); });
  sim.run(0.5);
  EXPECT_NEAR(sim.state().z[0], level, 1e-11);
  EXPECT_NEAR(sim.state().v[5], F / m * (0.5 - rise * level), 1e-11);
  sim.run(0.75);
  EXPECT_NEAR(sim.state().z[0], level * std::exp(-0.25 / fall), 1e-11);
  EXPECT_NEAR(sim.state().v[5], F / m * (0.5 - rise * level - fall * level * std::expm1(-0.25 / fall)), 1e-11);
}

/// Between open and closed the way down takes the time of closing too.
TEST(Thruster, IsThrottledByItsOwnTimes) {
  const double rise = 0.4, fall = 0.1, t = 0.15;
  for (const double from : {0.9, 0.1}) {
    SystemSpec spec = system({free_bus(100.0)});
    spec.devices = {
        with_vector(device("jet", "thruster", {{"thrust", 4.5}, {"specific_impulse", 220.0}, {"rise_time", rise}, {"fall_time", fall}},
                           {{"at", "bus"}}),
                    "direction", {0, 0, 1})};
    spec.devices[0].inputs["command"] = {0.4, {}};
    spec.devices[0].initial["level"] = number(from), spec.devices[0].initial["propellant"] = number(0.6);  // used before
    Simulation sim(compiled(spec), accurate());
    sim.run(t);
    EXPECT_NEAR(sim.state().z[0], 0.4 + (from - 0.4) * std::exp(-t / (from > 0.4 ? fall : rise)), 1e-11);
  }
}

/// What is commanded at each tick of 0.5 s, of a valve whose shortest pulse is 0.05 s: the impulse is F times the time that it is open,
/// whatever the steps. Full pulses join, and what is carried comes later.
TEST(PulseModulator, GivesTheTimesThatAreCommanded) {
  const double F = 4.5, tau = 0.02, m = 100.0, period = 0.5;
  const std::vector<double> commands = {0.3, 0.06, 0.06, 1.0, 1.0, 0.02, 0.0, 2.0, -1.0, 0.1, 0.06, 1.0};
  const std::map<std::string, double> open = {
      {"skip", 0.3 + 1.0 + 1.0 + 0.02 + 1.0 + 0.1 + 1.0},  // the first two of 0.03 s are left out, 0.01 s after a full one is not short
      {"raise", 0.3 + 0.1 + 0.1 + 1.0 + 1.0 + 0.02 + 1.0 + 0.1 + 0.1 + 1.0},  // a tenth of the period is the shortest
      {"carry", 0.3 + 0.12 + 1.0 + 1.0 + 0.02 + 1.0 + 0.1 + 1.06}};           // also what is carried beyond a full one
  for (const auto& [when_short, parts] : open)
    for (const std::string method : {"dopri5", "dop853", "rk4", "cvode_adams"}) {
      SystemSpec spec = system({free_bus(m)});
      spec.devices = {
          with_vector(device("jet", "thruster", {{"thrust", F}, {"specific_impulse", 220.0}, {"rise_time", tau}, {"fall_time", tau}},
                             {{"at", "bus"}}),
                      "direction", {0, 0, 1}),
          device("valve", "pulse_modulator", {{"minimum", 0.05}}, {})};
      spec.devices[0].inputs["command"] = {"valve.open", {}};
      spec.devices[1].params["short"].value = when_short;
      spec.devices[1].rate = 1.0 / period;
      SimulationOptions options = accurate(method);
      if (method == "rk4") options.integrator.fixed_step = 0.002;
      Simulation sim(compiled(spec), options);
      const int command = sim.model().devices.all[static_cast<std::size_t>(sim.model().devices.find("valve"))].in;
      std::size_t k = 0;
      sim.every({1, 2}, [&] { sim.set_device_input(command, k < commands.size() ? commands[k] : 0.0), ++k; });
      sim.run(7.5);
      EXPECT_NEAR(sim.state().v[5], F * parts * period / m, method == "rk4" ? 1e-7 : 1e-9) << when_short << ", " << method;
    }
}

/// A shortest pulse that is longer than a period is given over several, and what is commanded all the time is not short.
TEST(PulseModulator, GoesOnForItsShortestPulse) {
  SystemSpec spec = system({free_bus(100.0)});
  spec.devices = {
      with_vector(device("jet", "thruster", {{"thrust", 1.0}, {"specific_impulse", 220.0}}, {{"at", "bus"}}), "direction", {0, 0, 1}),
      device("valve", "pulse_modulator", {{"minimum", 0.25}}, {})};
  spec.devices[0].inputs["command"] = {"valve.open", {}};
  spec.devices[1].rate = 10.0;
  struct Case {
    const char* when_short;
    double part, until, open;
  };
  for (const auto& [when_short, part, until, open] : {Case{"raise", 0.1, 0.05, 0.25},
                                                      {"skip", 1.0, 0.05, 0.25},
                                                      {"skip", 1.0, 0.45, 0.5},
                                                      {"skip", 0.9, 0.45, 0.0},
                                                      {"carry", 1.0, 0.45, 0.5}}) {
    spec.devices[1].params["short"].value = std::string(when_short);
    Simulation sim(compiled(spec), accurate());
    const int command = sim.model().devices.all[1].in;
    sim.set_device_input(command, part);
    sim.every({1, 10}, [&, part = part, until = until] { sim.set_device_input(command, sim.time() < until ? part : 0.0); });
    sim.run(1.0);
    EXPECT_NEAR(sim.state().v[5], open / 100.0, 1e-12) << when_short << " " << part << " until " << until;
  }
}

/// The field of a dipole along z: -D/r^3 z at the equator, 2 D/r^3 z at the pole; and m x B is never along B.
TEST(Magnetorquer, CrossesTheFieldOfADipole) {
  const double D = -7.77e15, r = 6.9e6;
  for (const bool pole : {false, true}) {
    BodySpec bus = free_bus(100.0);
    bus.hinge.q = {std::sqrt(0.5), 0, 0, std::sqrt(0.5), pole ? 0.0 : r, 0, pole ? r : 0.0};  // turned by 90 degrees about z
    SystemSpec spec = system({bus});
    spec.fields = {{"earth", "dipole", {}, false, {}}};
    spec.devices = {device("rods", "magnetorquer", {{"max_moment", 30.0}}, {{"at", "bus"}})};
    spec.devices[0].inputs["moment_x"] = {50.0, {}};   // cut to 30
    spec.devices[0].inputs["moment_y"] = {-50.0, {}};  // cut to -30
    spec.devices[0].inputs["moment_z"] = {10.0, {}};
    Simulation sim(compiled(spec), {});
    sim.observe();
    const Vector3d B(sim.device_output(0), sim.device_output(1), sim.device_output(2)), field(0, 0, (pole ? 2.0 : -1.0) * D / (r * r * r));
    EXPECT_LT((B - field).norm(), 1e-18);
    const Vector3d moment = to_eigen(sim.wrenches()[0].f.n);
    EXPECT_LT((moment - Vector3d(30, -30, 10).cross(field)).norm(), 1e-15);
    EXPECT_NEAR(moment.dot(B), 0.0, 1e-19);
  }
}

/// At any place and attitude: B = D / r^3 (3 (a . r) r - a) and m x B in the axes of the node.
TEST(Magnetorquer, TellsTheFieldInTheAxesOfItsNode) {
  const double D = -7.77e15;
  const Eigen::Quaterniond q = Eigen::Quaterniond(0.7, -0.3, 0.5, 0.4).normalized();
  const Vector3d place(3e6, -4e6, 5e6), centre(1e5, -2e5, 3e5), axis(0.36, -0.48, 0.8), m(12, -17, 25), up = (place - centre).normalized();
  BodySpec bus = free_bus(100.0);
  bus.hinge.q = {q.w(), q.x(), q.y(), q.z(), place[0], place[1], place[2]};
  SystemSpec spec = system({bus});
  spec.fields = {{"earth", "dipole", {}, false, {}}};
  spec.fields[0].params["axis"].value = std::vector<double>{axis[0], axis[1], axis[2]};
  spec.fields[0].params["centre"].value = std::vector<double>{centre[0], centre[1], centre[2]};
  spec.devices = {device("rods", "magnetorquer", {{"max_moment", 30.0}}, {{"at", "bus"}})};
  for (int i = 0; i < 3; ++i) spec.devices[0].inputs[std::string("moment_") + "xyz"[i]] = {m[i], {}};
  Simulation sim(compiled(spec), {});
  sim.observe();
  const Vector3d B = q.conjugate() * Vector3d(D / std::pow((place - centre).norm(), 3) * (3.0 * axis.dot(up) * up - axis));
  EXPECT_LT((Vector3d(sim.device_output(0), sim.device_output(1), sim.device_output(2)) - B).norm(), 1e-14 * B.norm());
  EXPECT_LT((to_eigen(sim.wrenches()[0].f.n) - m.cross(B)).norm(), 1e-14 * m.norm() * B.norm());
}

/// Of J w' = n K i, L i' = U - R i - K n w from rest; both poles real here.
TEST(DcMotor, RunsUpAsItsTwoPolesSay) {
  const double J = 0.02, K = 0.05, R = 1.5, L = 0.01, n = 3.0, U = 12.0, k = n * K;
  SystemSpec spec = system({hinged(J)});
  spec.devices = {device("motor", "dc_motor", {{"constant", K}, {"resistance", R}, {"inductance", L}, {"gear", n}}, {{"at", "arm"}})};
  spec.devices[0].inputs["voltage"] = {U, {}};
  for (const std::string method : {"dopri5", "dop853", "cvode_bdf"}) {
    Simulation sim(compiled(spec), accurate(method));
    const double t = 0.3;
    sim.run(t);
    const double half = 0.5 * R / L, root = std::sqrt(half * half - k * k / (J * L)), a = -half + root, b = -half - root;
    const double w = U / k * (1.0 + (b * std::exp(a * t) - a * std::exp(b * t)) / (a - b));
    const double i = J / k * U / k * a * b * (std::exp(a * t) - std::exp(b * t)) / (a - b);
    EXPECT_NEAR(sim.state().v[0], w, 1e-8) << method;
    EXPECT_NEAR(sim.state().z[0], i, 1e-8) << method;
    EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit;
  }
}

/// Released folded, it comes back with the energy it held; the moment has its peak where it is said to.
TEST(TapeSpring, SnapsStraightWithTheEnergyItHeld) {
  const double J = 0.5, peak = 4.0, angle = 0.05, steady = 0.3, folded = 1.5;
  BodySpec arm = hinged(J);
  arm.hinge.q = {folded};
  SystemSpec spec = system({arm});
  spec.devices = {
      device("blade", "tape_spring", {{"peak_moment", peak}, {"peak_angle", angle}, {"steady_moment", steady}}, {{"at", "arm"}})};
  Simulation sim(compiled(spec), accurate());
  double fastest = 0.0, largest = 0.0, where = 0.0;
  sim.add_event({"straight", [](double, const double* q, const double*) { return q[0]; }, 0,
                 [&] {
                   fastest = std::abs(sim.state().v[0]);
                   sim.stop();
                 }});
  sim.run(20.0, [&](double) {
    if (const double m = std::abs(sim.device_output(0)); m > largest) largest = m, where = sim.state().q[0];
  });
  // the integral of M: steps fine enough that Simpson's rule has twelve digits
  double work = 0.0;
  const int n = 20'000;
  const double rest = peak - steady * std::tanh(1.0);
  for (int i = 0; i <= n; ++i) {
    const double s = folded / angle * i / n, M = steady * std::tanh(s) + rest * s * std::exp(0.5 * (1.0 - s * s));
    work += (i == 0 || i == n ? 1.0 : i % 2 ? 4.0 : 2.0) * M * folded / n / 3.0;
  }
  EXPECT_NEAR(0.5 * J * fastest * fastest, work, 1e-8);
  EXPECT_NEAR(largest, peak, 0.01 * peak);  // at step ends
  EXPECT_NEAR(where, angle, 0.2 * angle);
  EXPECT_TRUE(sim.ledger().pass) << sim.ledger().energy_relative << " of " << sim.ledger().energy_limit << ", "
                                 << sim.ledger().angular_relative << " of " << sim.ledger().angular_limit << ", "
                                 << sim.ledger().linear_relative << " of " << sim.ledger().linear_limit;
}

/// Its port has all of what is on the hinge: the arm answers with that over its inertia.
TEST(TapeSpring, TellsItsDampingInItsMoment) {
  const double J = 0.5, q = -0.07, v = 1.3, damping = 0.8, s = q / 0.05, steady = 0.3, peak = 4.0;
  BodySpec arm = hinged(J);
  arm.hinge.q = {q}, arm.hinge.v = {v};
  SystemSpec spec = system({arm});
  spec.devices = {device("blade", "tape_spring",
                         {{"peak_moment", peak}, {"peak_angle", 0.05}, {"steady_moment", steady}, {"damping", damping}}, {{"at", "arm"}})};
  Simulation sim(compiled(spec), {});
  const double held = steady * std::tanh(s) + (peak - steady * std::tanh(1.0)) * s * std::exp(0.5 * (1.0 - s * s));
  EXPECT_NEAR(sim.vdot()[0], -(held + damping * v) / J, 1e-13);
  EXPECT_NEAR(sim.device_output(0), -(held + damping * v), 1e-14);
}

/// It lets what is too fast pass, and holds what is slow enough: then it swings about the place at sqrt(k / J).
TEST(Latch, CatchesWhatIsSlowEnough) {
  const double J = 0.4, k = 90.0, place = 0.5;
  for (const double rate : {0.9, 1.1}) {
    BodySpec arm = hinged(J);
    arm.hinge.v = {rate};
    SystemSpec spec = system({arm});
    spec.devices = {device("latch", "latch", {{"place", place}, {"max_rate", 1.0}, {"stiffness", k}}, {{"at", "arm"}})};
    Simulation sim(compiled(spec), accurate());
    const double caught = place / rate, t = caught + 0.37;
    sim.run(t);
    const double omega = std::sqrt(k / J);
    EXPECT_NEAR(sim.state().q[0], rate < 1.0 ? place + rate / omega * std::sin(omega * 0.37) : rate * t, 1e-8);
    EXPECT_EQ(sim.state().marks[0], rate < 1.0 ? 1.0 : 0.0);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// What it has caught swings about its place and comes to rest: v / w_d exp(-a s) sin(w_d s). It catches from either side.
TEST(Latch, HoldsByItsDamperToo) {
  const double J = 0.4, k = 90.0, c = 1.6, place = 0.5, s = 0.37, a = c / (2 * J), w = std::sqrt(k / J - a * a);
  for (const double side : {1.0, -1.0}) {
    const double rate = 0.9 * side, begin = place - 0.3 * side;
    BodySpec arm = hinged(J);
    arm.hinge.q = {begin}, arm.hinge.v = {rate};
    SystemSpec spec = system({arm});
    spec.devices = {device("latch", "latch", {{"place", place}, {"max_rate", 1.0}, {"stiffness", k}, {"damping", c}}, {{"at", "arm"}})};
    Simulation sim(compiled(spec), accurate());
    sim.run((place - begin) / rate + s);
    EXPECT_NEAR(sim.state().q[0], place + rate / w * std::exp(-a * s) * std::sin(w * s), 1e-8);
    EXPECT_NEAR(sim.device_output(0), J * sim.vdot()[0], 1e-12);
    EXPECT_TRUE(sim.ledger().pass);
    arm.hinge.v = {1.1 * side};
    spec.bodies = {arm};
    Simulation fast(compiled(spec), accurate());
    fast.run((place - begin) / (1.1 * side) + s);
    EXPECT_EQ(fast.state().v[0], 1.1 * side);  // not caught
  }
}

}  // namespace
}  // namespace cardan::test
