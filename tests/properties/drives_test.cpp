// Stepper drives, and what shakes a vehicle: rotors, tones, records.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/diagnostic.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

using std::numbers::pi;

SystemSpec on_a_shaft(double inertia, double q, const std::vector<std::pair<std::string, double>>& numbers, double rate) {
  BodySpec rotor = on(rigid("rotor", 1.0, {0, 0, 0}, diagonal({1, 1, inertia})), "", "revolute", {{0, 0, 1}});
  rotor.hinge.q = {q};
  SystemSpec spec = system({rotor});
  spec.devices = {device("drive", "stepper", numbers, {{"at", "rotor"}})};
  spec.devices[0].inputs["rate"] = {rate, {}};
  return spec;
}

/// About where its field stands it swings at sqrt(T_h p / J), p = pi / (2 step), about a full step at sqrt((T_h + 4 T_d) p / J).
TEST(Stepper, SwingsAboutItsField) {
  const double J = 0.3, step = 0.02, Th = 2.0, Td = 0.4, p = pi / (2 * step), small = 1e-7, t = 0.2;
  for (const double detent : {0.0, Td}) {
    SystemSpec spec = on_a_shaft(J, 3 * step + small, {{"step", step}, {"holding_torque", Th}, {"detent_torque", detent}}, 0.0);
    spec.devices[0].initial["steps"] = number(3.0);
    SimulationOptions options = accurate();
    options.absolute_tolerance = 1e-19;
    Simulation sim(compiled(spec), options);
    sim.run(t);
    const double omega = std::sqrt((Th + 4 * detent) * p / J);
    // of the amplitude: (4 p small)^2 / 16 of the frequency times 30 rad
    EXPECT_NEAR((sim.state().q[0] - 3 * step) / small, std::cos(omega * t), 1e-6);
  }
}

/// A steady torque puts it off by asin(T / T_h) / p; beyond T_h it gives way. The torque is the weight of an arm that is nearly level.
TEST(Stepper, HoldsUpToItsTorque) {
  const double step = 1e-4, Th = 2.0, p = pi / (2 * step);
  for (const double load : {0.6 * Th, 1.05 * Th}) {
    BodySpec arm = on(rigid("arm", 1.0, {0.1, 0, 0}, diagonal({0.01, 0.01, 0.01})), "", "revolute", {{0, 0, 1}});
    SystemSpec spec = system({arm}, uniform_gravity({0, -load / 0.1, 0}));
    spec.devices = {device("drive", "stepper", {{"step", step}, {"holding_torque", Th}, {"damping", 20.0}}, {{"at", "arm"}})};
    Simulation sim(compiled(spec), accurate("cvode_bdf", 1e-10));
    sim.run(0.5);
    const double steps = sim.state().q[0] / step;
    if (load < Th) {
      EXPECT_NEAR(steps, -std::asin(load / Th) / p / step, 1e-6);
      EXPECT_NEAR(sim.device_output(0), load, 1e-5);
    } else {
      EXPECT_LT(steps, -100.0);  // 0.1 N m over 20 N m s, for a part of the time
    }
  }
}

/// Slow steps are followed, each of them; the field ends where the rate has added up to, forwards and back, in microsteps too.
TEST(Stepper, FollowsSlowSteps) {
  const double J = 0.001, step = 0.02, Th = 2.0;
  for (const double microsteps : {1.0, 8.0})
    for (const char* method : {"dopri5", "dop853", "cvode_bdf"}) {
      Simulation sim(
          compiled(on_a_shaft(J, 0.0, {{"step", step}, {"holding_torque", Th}, {"microsteps", microsteps}, {"damping", 0.6}}, 10.0)),
          accurate(method, 1e-9));
      sim.run(1.2);
      EXPECT_NEAR(sim.device_output(1), 12 * step, 1e-15) << method;
      // Whole steps leave the rotor time to come to rest: each brings in T_h / p.
      if (microsteps == 1.0) {
        EXPECT_NEAR(sim.device_output(2), 12 * Th * 2 * step / pi, 1e-8) << method;
      }
      sim.set_device_input(0, -20.0);
      sim.run(1.4);
      sim.set_device_input(0, 0.0);
      sim.run(2.4);
      EXPECT_NEAR(sim.device_output(1), 8 * step, 1e-15) << method;
      EXPECT_NEAR(sim.state().q[0], 8 * step, 1e-9) << method;
      EXPECT_TRUE(sim.ledger().pass) << method;
      EXPECT_GT(sim.device_output(2), 0.0);
    }
}

/// Told to turn back where it has just stepped, half a step ahead of where its field stood, the field turns back with it.
TEST(Stepper, TurnsBackWhereItHasJustStepped) {
  const double step = 0.02;
  for (const double microsteps : {1.0, 16.0}) {
    Simulation sim(
        compiled(on_a_shaft(0.001, 0.0, {{"step", step}, {"holding_torque", 2.0}, {"microsteps", microsteps}, {"damping", 0.6}}, 1.0)),
        accurate("dopri5", 1e-9));
    sim.run(0.5 / microsteps);
    sim.set_device_input(0, -1.0);
    sim.run(0.75 / microsteps + 4.5);
    EXPECT_NEAR(sim.device_output(1), step * std::round(0.25 - 4.5 * microsteps) / microsteps, 1e-14);
    EXPECT_TRUE(sim.ledger().pass);
  }
}

/// A field that begins between two of its places stands at the nearer one.
TEST(Stepper, BeginsAtTheNearestMicrostep) {
  const double step = 0.02;
  for (const double steps : {0.7, -0.7, 2.2}) {
    SystemSpec spec = on_a_shaft(0.001, 0.0, {{"step", step}, {"holding_torque", 2.0}, {"microsteps", 2.0}, {"damping", 0.6}}, 0.0);
    spec.devices[0].initial["steps"] = number(steps);
    Simulation sim(compiled(spec), accurate());
    sim.run(0.0);
    EXPECT_NEAR(sim.device_output(1), step * 0.5 * std::round(2.0 * steps), 1e-16) << steps;
  }
}

/// Too fast from the start it is left behind by whole turns of the field: four steps each.
TEST(Stepper, MissesStepsByFours) {
  const double step = 0.02;
  Simulation sim(compiled(on_a_shaft(0.01, 0.0, {{"step", step}, {"holding_torque", 2.0}, {"damping", 0.5}}, 2000.0)),
                 accurate("dopri5", 1e-9));
  sim.run(0.1);
  sim.set_device_input(0, 0.0);
  sim.run(2.0);
  EXPECT_NEAR(sim.device_output(1), 200 * step, 1e-13);
  const double missed = 200.0 - sim.state().q[0] / step;
  EXPECT_GT(missed, 3.9);
  EXPECT_NEAR(missed / 4.0, std::round(missed / 4.0), 1e-6) << missed;
  EXPECT_TRUE(sim.ledger().pass);
}

/// A field that turns evenly draws a damped rotor along behind it by asin(c W / T_h) / p, and brings in c W^2.
TEST(Stepper, TurnsEvenlyWithoutSteps) {
  const double step = 0.02, Th = 2.0, c = 0.5, rate = 100.0, W = rate * step, p = pi / (2 * step);
  SystemSpec spec =
      on_a_shaft(1e-4, -std::asin(c * W / Th) / p, {{"step", step}, {"holding_torque", Th}, {"microsteps", 0.0}, {"damping", c}}, rate);
  spec.bodies[0].hinge.v = {W};
  Simulation sim(compiled(spec), accurate());
  sim.run(0.7);
  EXPECT_NEAR(sim.device_output(1), W * 0.7, 1e-13);
  EXPECT_NEAR(sim.state().q[0], W * 0.7 - std::asin(c * W / Th) / p, 1e-11);
  sim.observe();
  const auto [delivered, lost] = sim.devices()->powers(0);
  EXPECT_NEAR(delivered, c * W * W, 1e-10);
  EXPECT_NEAR(lost, c * W * W, 1e-10);
}

TEST(Stepper, GoesNoFasterThanItsLimit) {
  const double step = 0.02, limit = 100.0;
  for (const double rate : {-400.0, -50.0, 50.0, 400.0}) {
    Simulation sim(
        compiled(on_a_shaft(1e-4, 0.0,
                            {{"step", step}, {"holding_torque", 2.0}, {"microsteps", 0.0}, {"damping", 0.5}, {"rate_limit", limit}}, rate)),
        accurate());
    sim.run(0.7);
    EXPECT_NEAR(sim.device_output(1), 0.7 * step * std::clamp(rate, -limit, limit), 1e-13) << rate;
  }
}

/// Behind a gear N and an output that gives way: motor on a hinge, coupled to the shaft that carries the array by a spring. Two
/// frequencies: of the inertias J_s + N^2 J_m and J_a, and the stiffnesses N^2 T_h p to the ground and k between them.
TEST(Stepper, DrivesThroughAGearAndAnOutputThatGivesWay) {
  const double N = 20.0, Jm = 2e-4, Js = 0.05, Ja = 3.0, k = 400.0, Th = 0.05, step = 0.03, p = pi / (2 * step), small = 1e-7, t = 0.6;
  BodySpec motor = on(rigid("motor", 1.0, {0, 0, 0}, diagonal({1, 1, Jm})), "", "revolute", {{0, 0, 1}});
  BodySpec shaft = on(rigid("shaft", 1.0, {0, 0, 0}, diagonal({1, 1, Js})), "", "revolute", {{0, 0, 1}});
  BodySpec array = on(rigid("array", 1.0, {0, 0, 0}, diagonal({Ja, Ja, Ja})), "shaft", "revolute", {{0, 0, 1}});
  SpringDamper spring;
  spring.stiffness = k;
  array.hinge.springs = {spring};
  array.hinge.q = {small};
  SystemSpec spec = system({motor, shaft, array});
  LoopSpec gear;
  gear.name = "gear", gear.type = "coupling", gear.terms = {{"motor", 1.0, {}}, {"shaft", -N, {}}}, gear.offset = 0.0;
  spec.loops = {gear};
  spec.devices = {device("drive", "stepper", {{"step", step}, {"holding_torque", Th}}, {{"at", "motor"}})};
  SimulationOptions options = accurate();
  options.absolute_tolerance = 1e-19;
  Simulation sim(compiled(spec), options);
  sim.run(t);
  // M x'' + K x = 0 of (shaft, array), x(0) = (0, small): by the roots of the characteristic polynomial.
  const double m1 = Js + N * N * Jm, m2 = Ja, k1 = N * N * Th * p;
  const double a = (k1 + k) / m1, b = k / m2, root = std::sqrt((a - b) * (a - b) + 4 * k * k / (m1 * m2));
  const double w2[2] = {0.5 * (a + b - root), 0.5 * (a + b + root)};
  double expected = 0.0;
  for (int i = 0; i < 2; ++i) {
    const double other = w2[1 - i];  // its part in the array: (b - other) / (w2 - other), from x''(0) = -b x
    expected += (b - other) / (w2[i] - other) * std::cos(std::sqrt(w2[i]) * t);
  }
  EXPECT_NEAR((sim.state().q[1] + sim.state().q[2]) / small, expected, 1e-6);
}

// ---- what shakes ----

DeviceSpec with_rows(DeviceSpec d, const std::string& key, std::vector<double> rows) {
  d.params[key].value = std::move(rows);
  return d;
}
BodySpec floating(double mass) { return on(rigid("bus", mass, {0, 0, 0}, diagonal({2, 3, 4})), "", "free"); }

/// HR16 at 6000 rpm: its static imbalance of 4.8e-6 kg m gives 1.89496 N; in the axes of a node that is turned.
TEST(RotorDisturbance, HasTheForceOfTheImbalance) {
  SystemSpec spec = system({floating(1.0)});
  spec.devices = {with_rows(with_vector(device("jitter", "wheel_disturbance", {}, {{"at", "bus"}}), "axis", {1, 0, 0}), "harmonics",
                            {1, 4.8e-6, 1.54e-6, 0, 0.7})};
  spec.devices[0].inputs["rate"] = {6000 * 2 * pi / 60, {}};
  spec.devices[0].initial["angle"] = number(0.5);
  Simulation sim(compiled(spec), {});
  const Vector3d f = sim.vdot().tail<3>(), m = sim.vdot().head<3>().cwiseProduct(Vector3d(2, 3, 4));
  EXPECT_NEAR(f.norm(), 1.89496, 5e-6);                // half of the last digit
  EXPECT_NEAR(f[1], f.norm() * std::cos(1.2), 1e-14);  // about x from y on
  EXPECT_NEAR(f[2], f.norm() * std::sin(1.2), 1e-14);
  EXPECT_NEAR(m[2], m.norm() * std::sin(1.2), 1e-14);
  EXPECT_NEAR(m.norm(), 1.54e-6 * std::pow(200 * pi, 2), 1e-12);
  EXPECT_NEAR(m[1], m.norm() * std::cos(1.2), 1e-14);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sim.device_output(i), f[i], 1e-14);
    EXPECT_NEAR(sim.device_output(3 + i), m[i], 1e-14);
  }
}

/// About any axis what turns with the rotor is across it, and a quarter of a turn later it is turned by a quarter about it.
TEST(RotorDisturbance, TurnsAboutItsAxis) {
  for (const Vector3d& u : {Vector3d(0.36, 0.48, 0.8), Vector3d(0.96, -0.28, 0), Vector3d(-0.48, 0.6, 0.64)}) {
    const auto pushed_by = [&](const std::vector<double>& rows) {
      SystemSpec spec = system({floating(1.0)});
      spec.devices = {with_rows(with_vector(device("jitter", "wheel_disturbance", {}, {{"at", "bus"}}), "axis", u), "harmonics", rows)};
      spec.devices[0].inputs["rate"] = {10.0, {}};
      Simulation sim(compiled(spec), {});
      sim.observe();
      return std::pair(Vector3d(sim.device_output(0), sim.device_output(1), sim.device_output(2)),
                       Vector3d(sim.device_output(3), sim.device_output(4), sim.device_output(5)));
    };
    const auto pushed = [&](double phase) { return pushed_by({1, 2e-3, 3e-3, 0, phase}); };
    const auto [f, m] = pushed(0.4);
    const auto [f_other, m_other] = pushed_by({2, 1e-3, -2e-3, 4e-3, 1.3});
    const auto [f_both, m_both] = pushed_by({1, 2e-3, 3e-3, 0, 0.4, 2, 1e-3, -2e-3, 4e-3, 1.3});
    EXPECT_LT((f_both - f - f_other).norm(), 1e-15);
    EXPECT_LT((m_both - m - m_other).norm(), 1e-15);
    const auto [later, moment_later] = pushed(0.4 + 0.5 * pi);
    const Vector3d near = std::abs(u.x()) < 0.8 ? Vector3d::UnitX() : Vector3d::UnitY(), e = near.cross(u).cross(u).normalized() * -1.0;
    EXPECT_LT((f - 0.2 * (std::cos(0.4) * e + std::sin(0.4) * u.cross(e))).norm(), 1e-15);
    EXPECT_LT((m - 1.5 * f).norm(), 1e-15);
    EXPECT_LT((later - u.cross(f)).norm(), 1e-15);
    EXPECT_LT((moment_later - u.cross(m)).norm(), 1e-15);
  }
}

/// The same as a rotor out of balance on a hinge whose rate is given: (M + m) x'' = m e W^2 cos(W t).
TEST(RotorDisturbance, IsARotorOutOfBalance) {
  const double M = 50.0, m = 4.0, e = 1e-3, W = 30.0;
  const auto end = [&](double offset) {
    BodySpec bus = on(rigid("bus", M, {0, 0, 0}, diagonal({2, 3, 4})), "", "prismatic", {{1, 0, 0}});
    BodySpec rotor = on(rigid("rotor", m, {offset, 0, 0}, diagonal({0.1, 0.1, 0.1})), "bus", "revolute", {{0, 0, 1}});
    rotor.hinge.v = {W}, rotor.hinge.prescribed = {0};
    SystemSpec spec = system({bus, rotor});
    if (offset == 0.0)
      spec.devices = {
          with_rows(device("jitter", "rotor_disturbance", {}, {{"at", "bus"}, {"rotor", "rotor"}}), "harmonics", {1, m * e, 0, 0, 0})};
    Simulation sim(compiled(spec), accurate());
    sim.run(0.5);
    return sim.state().q[0];
  };
  const double x = m * e / (M + m) * (1.0 - std::cos(W * 0.5));
  EXPECT_NEAR(end(0.0), x, 1e-12);
  EXPECT_NEAR(end(e), x, 1e-12);
}

/// Harmonics of any order on a free bus: C (W / (h W))^2 / M of each, force along the axis and about it, with the wheel's own rate.
TEST(RotorDisturbance, AddsHarmonicsOfItsAngle) {
  const double M = 20.0, W = 40.0, t = 0.9;
  SystemSpec spec = system({floating(M)});
  spec.devices = {
      with_vector(device("wheel", "momentum_wheel", {{"inertia", 0.05}}, {{"at", "bus"}}), "axis", {0, 0, 1}),
      with_rows(device("jitter", "wheel_disturbance", {}, {{"at", "bus"}}), "harmonics", {2.9, 1e-3, 0, 0, 0.3, 5, 0, 0, 2e-3, 1.0})};
  spec.devices[0].initial["momentum"] = number(0.05 * W);
  spec.devices[1].inputs["rate"] = {"wheel.rate", {}};
  Simulation sim(compiled(spec), accurate());
  sim.run(t);
  const auto swing = [&](double C, double h, double phase, bool sine) {  // twice integrated from rest
    const double w = h * W, a = C * W * W / M;
    return sine ? a / (w * w) * (std::sin(phase) + w * t * std::cos(phase) - std::sin(w * t + phase))
                : a / (w * w) * (std::cos(phase) - w * t * std::sin(phase) - std::cos(w * t + phase));
  };
  EXPECT_NEAR(sim.state().q[4], swing(1e-3, 2.9, 0.3, false), 1e-11);
  EXPECT_NEAR(sim.state().q[5], swing(1e-3, 2.9, 0.3, true), 1e-11);
  EXPECT_NEAR(sim.state().q[6], swing(2e-3, 5, 1.0, false), 1e-11);
  EXPECT_TRUE(sim.ledger().pass);
}

TEST(Vibration, IsASumOfTones) {
  const double M = 20.0, t = 0.73;
  const auto end = [&](const std::vector<double>& tones) {
    SystemSpec spec = system({floating(M)});
    spec.devices = {with_rows(device("cooler", "vibration", {}, {{"at", "bus"}}), "tones", tones)};
    Simulation sim(compiled(spec), accurate());
    sim.run(t);
    EXPECT_TRUE(sim.ledger().pass);
    return sim.state().q;
  };
  const auto swing = [&](double amplitude, double f, double phase) {  // twice integrated from rest
    const double w = 2 * pi * f;
    return amplitude / (w * w) * (std::sin(phase) + w * t * std::cos(phase) - std::sin(w * t + phase));
  };
  const auto shifted = end({50, 0.4, 0.3, 0, -0.2, 0, 0, 0, 100, -1.1, 0.05, 0.1, 0, 0, 0, 0});
  EXPECT_NEAR(shifted[4], (swing(0.3, 50, 0.4) + swing(0.05, 100, -1.1)) / M, 1e-12);
  EXPECT_NEAR(shifted[5], swing(0.1, 100, -1.1) / M, 1e-12);
  EXPECT_NEAR(shifted[6], swing(-0.2, 50, 0.4) / M, 1e-12);
  const auto turned = end({7, 0.2, 0, 0, 0, 0, 0.6, 0});
  EXPECT_NEAR(2.0 * std::atan2(turned[2], turned[0]), swing(0.6, 7, 0.2) / 3.0, 1e-12);  // about y
}

/// Position and velocity of 1 kg at the end of a run, from rest, along x.
std::pair<double, double> driven(const std::vector<double>& rows, const std::string& between, const std::string& outside, double end,
                                 double start = 0.0, const char* method = "dopri5") {
  SystemSpec spec = system({on(particle("m", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
  DeviceSpec d = with_rows(device("push", "recorded_load", {{"start", start}}, {{"at", "m"}}), "record", rows);
  d.params["between"].value = between, d.params["outside"].value = outside;
  spec.devices = {d};
  Simulation sim(compiled(spec), accurate(method, 1e-10));
  sim.run(end);
  EXPECT_TRUE(sim.ledger().pass);
  return {sim.state().q[0], sim.state().v[0]};
}
std::vector<double> rows_of_force(const std::vector<double>& times, const std::function<double(double)>& f) {
  std::vector<double> rows;
  for (const double t : times) rows.insert(rows.end(), {t, f(t), 0, 0, 0, 0, 0});
  return rows;
}

/// Cubics are given back by any rows, and by a method of fifth order exactly; a line by lines; what is held by sums.
TEST(RecordedLoad, IsExactForWhatItsCurvesCanBe) {
  const std::vector<double> times = {0.0, 0.1, 0.35, 0.5, 0.9, 1.3, 1.4, 2.0};
  const auto cubic = [](double t) { return 1.0 - 3.0 * t + 0.5 * t * t + 0.8 * t * t * t; };
  const auto [x, v] = driven(rows_of_force(times, cubic), "cubic", "zero", 2.0);
  EXPECT_NEAR(v, 2.0 - 6.0 + 0.5 * 8 / 3 + 0.8 * 4, 1e-13);
  EXPECT_NEAR(x, 2.0 - 4.0 + 0.5 * 16 / 12 + 0.8 * 32 / 20, 1e-13);
  // Trapezia and steps of 1 / (1 + t): their sums.
  const auto f = [](double t) { return 1.0 / (1.0 + t); };
  double trapezia = 0.0, steps = 0.0;
  for (std::size_t i = 0; i + 1 < times.size(); ++i) {
    const double h = times[i + 1] - times[i];
    trapezia += 0.5 * h * (f(times[i]) + f(times[i + 1])), steps += h * f(times[i]);
  }
  for (const char* method : {"dopri5", "dop853", "cvode_adams"}) {
    EXPECT_NEAR(driven(rows_of_force(times, f), "linear", "zero", 2.0, 0.0, method).second, trapezia, 1e-9) << method;
    EXPECT_NEAR(driven(rows_of_force(times, f), "steps", "zero", 2.0, 0.0, method).second, steps, 1e-9) << method;
  }
}

/// Beyond its ends: nothing, the last row held, or the same again; and it may start late. A pulse of a millisecond in a long run at rest is
/// not passed over.
TEST(RecordedLoad, HasEndsAsTold) {
  const std::vector<double> pulse = rows_of_force({1.0, 1.0005, 1.001}, [](double t) { return t == 1.0005 ? 2.0 : 0.0; });
  EXPECT_NEAR(driven(pulse, "linear", "zero", 5.0).second, 1e-3, 1e-13);
  EXPECT_NEAR(driven(pulse, "linear", "zero", 50.0, 30.0).second, 1e-3, 1e-13);
  EXPECT_NEAR(driven(pulse, "linear", "zero", 30.5, 30.0).second, 0.0, 0.0);
  const std::vector<double> ramp = rows_of_force({1.0, 2.0}, [](double t) { return t; });
  EXPECT_NEAR(driven(ramp, "linear", "hold", 4.0).second, 1.0 + 1.5 + 4.0, 1e-11);
  EXPECT_NEAR(driven(ramp, "linear", "zero", 4.0).second, 1.5, 1e-11);
  // sin(2 pi t) in sixteenths of a second, from 0.25 s on and back to the start of the run: five rows leave (2 pi / 16)^4 / 30 of a slope.
  std::vector<double> times;
  for (int i = 0; i <= 16; ++i) times.push_back(i / 16.0);
  const auto sine = [](double t) { return t == 1.0 ? 0.0 : std::sin(2 * pi * t); };
  const auto [x, v] = driven(rows_of_force(times, sine), "cubic", "repeat", 3.6, 0.25);
  EXPECT_NEAR(v, (std::cos(2 * pi * -0.25) - std::cos(2 * pi * 3.35)) / (2 * pi), 2e-4);
  EXPECT_NEAR(driven(rows_of_force(times, sine), "cubic", "repeat", 3.0, 0.25).second, 0.0, 1e-12);  // whole periods
  (void)x;
  // An odd record about its beginning: five rows on both sides of it make an odd curve, which pushes nothing from 0.2 s before to 0.2 s
  // after.
  const std::vector<double> odd = {0, 1, -0.5, 0, 0.5, -1, 0};
  std::vector<double> sixths;
  for (int i = 0; i <= 6; ++i) sixths.push_back(i / 6.0);
  const auto of_sixths = [&](double t) { return odd[static_cast<std::size_t>(std::lround(6 * t))]; };
  EXPECT_NEAR(driven(rows_of_force(sixths, of_sixths), "cubic", "repeat", 0.4, 0.2).second, 0.0, 1e-14);
}

/// What repeats has no beginning: wherever its record is cut, and however its times are counted, it is the same.
TEST(RecordedLoad, MayBeginAnywhereInItsPeriod) {
  struct Record {
    std::vector<double> times, loads;
  };
  const double period = 0.7;
  for (const Record& one : {Record{{0.0, 0.1, 0.25, 0.3, 0.42, 0.55, 0.61}, {0.4, -1.0, 2.0, 0.3, -0.8, 1.7, 0.9}},
                            Record{{0.0, 0.2, 0.45}, {0.4, -1.0, 2.0}}}) {
    const std::size_t n = one.times.size();
    const auto from = [&](std::size_t cut, double shift) {
      std::vector<double> rows;
      for (std::size_t i = 0; i <= n; ++i) {
        const std::size_t k = (cut + i) % n;
        rows.insert(rows.end(), {one.times[k] + (cut + i >= n ? period : 0.0) + shift, one.loads[k], 0, 0, 0, 0, 0});
      }
      return rows;
    };
    for (const char* between : {"cubic", "linear", "steps"}) {
      const auto [x, v] = driven(from(0, 0.0), between, "repeat", 1.9);
      for (const auto& [cut, shift] : {std::pair<std::size_t, double>(0, 2.1), {n / 2, 0.0}, {n / 2, -4.9}, {n - 1, 0.0}, {1, 7.0}}) {
        const auto [x_cut, v_cut] = driven(from(cut, shift), between, "repeat", 1.9);
        EXPECT_NEAR(v_cut, v, 1e-11) << between << " " << cut << " " << shift;  // steps at 1e-10 of polynomials
        EXPECT_NEAR(x_cut, x, 1e-11) << between << " " << cut << " " << shift;
      }
      EXPECT_NEAR(driven(from(0, 0.0), between, "repeat", 1.9, 1.4).second, v, 1e-11) << between;  // two periods before its start
    }
  }
}

/// What repeats is the same backwards in time too, however few its rows are: a sine in quarters of its period pushes as much on its way up
/// as down, h / 2 of its loads and h^2 / 12 of its slopes, 16 / 3 and 0 by five rows. Two rows to a period: slopes are zero.
TEST(RecordedLoad, HasNoDirectionOfTimeInAShortPeriod) {
  const std::vector<double> sine = rows_of_force({0.0, 0.25, 0.5, 0.75, 1.0}, [](double t) {
    return t == 0.25 ? 1.0 : t == 0.75 ? -1.0 : 0.0;
  });
  const auto pushed = [](const std::vector<double>& rows, double t) { return driven(rows, "cubic", "repeat", t).second; };
  const double quarter = 0.25 / 2.0 + 0.0625 / 12.0 * 16.0 / 3.0;
  EXPECT_NEAR(pushed(sine, 0.25), quarter, 1e-13);
  EXPECT_NEAR(pushed(sine, 0.5), 2.0 * quarter, 1e-13);
  EXPECT_NEAR(pushed(sine, 0.75), quarter, 1e-13);
  const std::vector<double> wave = rows_of_force({0.0, 0.5, 1.0}, [](double t) { return t == 0.5 ? -1.0 : 1.0; });
  EXPECT_NEAR(pushed(wave, 0.5), 0.0, 1e-13);
  EXPECT_NEAR(pushed(wave, 1.25), 0.5 * (0.5 - 0.25 + 0.0625), 1e-13);
}

/// Told in the midst of a run that it starts at another time it is at the row of that time.
TEST(RecordedLoad, TakesAnotherStart) {
  const auto spec = [](double start) {
    SystemSpec out = system({on(particle("mass", 1.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
    out.devices = {device("record", "recorded_load", {{"start", start}}, {{"at", "mass"}})};
    out.devices[0].params["between"].value = std::string("linear");
    out.devices[0].params["record"].value = rows_of_force({0.0, 0.1, 0.2}, [](double t) { return t == 0.1 ? 4.0 : 0.0; });
    return out;
  };
  Simulation sim(compiled(spec(0.0)), accurate());
  sim.every({1000, 1}, [&] { sim.adopt(compiled(spec(0.4))); }, {1, 2});
  sim.run(0.6);
  EXPECT_NEAR(sim.state().v[0], 0.4 + 0.2, 1e-12);  // a whole tooth of 4 N over 0.2 s, and the second half of another
  EXPECT_TRUE(sim.ledger().pass);
}

/// A record that began long ago is where it is: what is lost is the rounding of the time since then, not that of each row as often as it
/// came round.
TEST(RecordedLoad, KeepsItsPhaseOverManyTurns) {
  const double since = 1e7, period = 0.7, end = 0.5;
  const std::vector<double> teeth = rows_of_force({0.0, 0.3, period}, [](double t) { return t == 0.3 ? 3.0 : 0.0; });
  const auto momentum = [&](double t) {  // of the tooth, from its begin to t
    return t < 0.3 ? 5.0 * t * t : 0.45 + 3.0 * (t - 0.3) - 3.75 * (t - 0.3) * (t - 0.3);
  };
  const double from = std::fmod(since, period), to = from + end;
  const double pushed = to < period ? momentum(to) - momentum(from) : momentum(period) - momentum(from) + momentum(to - period);
  EXPECT_NEAR(driven(teeth, "linear", "repeat", end, -since).second, pushed, 3.0 * 2 * 2e-9);  // two roundings at 1e7 s under 3 N
}

TEST(RecordedLoad, RefusesWhatIsNoRecord) {
  const auto said = [](const std::vector<double>& rows, const char* outside, double start = 0.0) {
    SystemSpec spec = system({floating(1.0)});
    DeviceSpec d = with_rows(device("push", "recorded_load", {{"start", start}}, {{"at", "bus"}}), "record", rows);
    d.params["outside"].value = std::string(outside);
    spec.devices = {d};
    return refusal(spec);
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  const std::vector<double> two = {0, 1, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 0};
  EXPECT_EQ(said(two, "zero"), "it compiled");
  EXPECT_TRUE(has(said(two, "repeat"), "loads of the first"));
  EXPECT_TRUE(has(said({0, 1, 0, 0, 0, 0, 0}, "zero"), "two rows"));
  EXPECT_TRUE(has(said({0, 1, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0}, "zero"), "increase"));
  EXPECT_TRUE(has(said({0, 1, 0, 0, 0, 0, 0, 1e-9, 1, 0, 0, 0, 0, 0}, "repeat", 1e5), "length of a record"));
  EXPECT_EQ(said({0, 1, 0, 0, 0, 0, 0, 1e-9, 1, 0, 0, 0, 0, 0}, "zero", 1e300), "it compiled");
}

}  // namespace
}  // namespace cardan::test
