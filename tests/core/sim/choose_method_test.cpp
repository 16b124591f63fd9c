// What `method = "auto"` makes of a vehicle.
#include "core/sim/choose_method.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/sim/device_corners.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/modal_samples.hpp"

namespace cardan::test {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

SystemSpec bus_with_boom(double stiffness = 0.0, double damping = 0.0) {
  const BodySpec bus = on(rigid("bus", 40.0, {0.02, -0.01, 0.05}, diagonal({8.0, 6.0, 9.0})), "", "free_body");
  BodySpec boom = on(BodySpec(), "bus", "locked", {}, {0.5, 0, 0});
  boom.name = "boom", boom.type = "modal_flexible", boom.level = 1;
  boom.modal = std::make_shared<const ModalData>(beam());
  BodySpec arm = on(rigid("arm", 3.0, {0.0, 0.0, 0.5}, diagonal({0.4, 0.5, 0.1})), "bus", "revolute", {{0, 1, 0}});
  SpringDamper spring;
  spring.stiffness = stiffness, spring.damping = damping;
  if (stiffness > 0.0 || damping > 0.0) arm.hinge.springs = {spring};
  return stiffness > 0.0 || damping > 0.0 ? system({bus, arm}) : system({bus, boom});
}
SystemSpec rigid_bus() { return system({on(rigid("bus", 40.0, {0, 0, 0}, diagonal({8.0, 6.0, 9.0})), "", "free")}); }

IntegratorOptions asked(double relative) {
  IntegratorOptions o;
  o.method = "auto", o.relative_tolerance = relative;
  return o;
}

TEST(ChooseMethod, TakesModesInClosedFormWhereTheySwingBetweenTicks) {
  const MethodChoice c = choose_method(compiled(bus_with_boom()), 1.0, asked(1e-7));
  EXPECT_EQ(c.options.method, "exponential");
  EXPECT_NE(c.why.find("boom"), std::string::npos) << c.why;
  EXPECT_NE(c.why.find("Hz"), std::string::npos) << c.why;
  EXPECT_NE(c.why.find("where the error sets its steps, dopri5 and multirate are tried beside it"), std::string::npos) << c.why;
}

TEST(ChooseMethod, KeepsExplicitMethodsWhereTheyAreSlowBesideTheTicks) {
  const MethodChoice c = choose_method(compiled(bus_with_boom()), 1e-4, asked(1e-7));
  EXPECT_EQ(c.options.method, "dopri5");
  EXPECT_NE(c.why.find("commands may change each 0.0001 s"), std::string::npos) << c.why;
}

TEST(ChooseMethod, TakesOrderEightForFineTolerancesOnLongStretches) {
  EXPECT_EQ(choose_method(compiled(rigid_bus()), kNever, asked(1e-9)).options.method, "dop853");
  EXPECT_EQ(choose_method(compiled(rigid_bus()), kNever, asked(1e-5)).options.method, "dopri5");
  EXPECT_EQ(choose_method(compiled(rigid_bus()), 0.1, asked(1e-9)).options.method, "dopri5");
  // A swing of 80 rad/s: more than a step of order 5 between two ticks, or less.
  EXPECT_EQ(choose_method(compiled(bus_with_boom()), 0.01, asked(1e-9)).options.method, "dop853");
  EXPECT_EQ(choose_method(compiled(bus_with_boom()), 0.003, asked(1e-9)).options.method, "dopri5");
  EXPECT_EQ(choose_method(compiled(bus_with_boom()), 0.01, asked(1e-6)).options.method, "dopri5");
  for (const double interval : {1.0, 0.1})
    EXPECT_EQ(choose_method(compiled(bus_with_boom()), interval, asked(1e-13)).options.method, "dop853") << interval;
}

TEST(ChooseMethod, TakesWhatIsStiffImplicitlyWhereItIsNotTakenInClosedForm) {
  SystemSpec spec = bus_with_boom(0.0, 5e4);
  EXPECT_EQ(choose_method(compiled(spec), 1.0, asked(1e-7)).options.method, "exponential");
  spec.bodies[0].hinge.prescribed = {0};
  const MethodChoice c = choose_method(compiled(spec), 1.0, asked(1e-7));
  EXPECT_EQ(c.options.method, "cvode_bdf");
  EXPECT_EQ(c.why.substr(c.why.find("stiff")), "stiff, and exponential does not take the given motion of bus, a free_body hinge");
}

/// A drive of so many steps in a second on a hinge of the bus, beside its boom.
SystemSpec with_stepper(double rate, double microsteps) {
  SystemSpec spec = bus_with_boom();
  spec.bodies.push_back(on(rigid("dish", 3.0, {0.0, 0.0, 0.1}, diagonal({0.4, 0.5, 0.1})), "bus", "revolute", {{0, 0, 1}}));
  spec.devices = {device("drive", "stepper", {{"step", 0.02}, {"holding_torque", 0.02}, {"microsteps", microsteps}}, {{"at", "dish"}})};
  spec.devices[0].inputs["rate"] = {rate, {}};
  return spec;
}

/// The field of a stepper is a spring that is no part of the linear one: a stiff one holds exponential to steps of its own.
TEST(ChooseMethod, KeepsFromClosedFormsWhereDevicesSwingAsFast) {
  const double step = 0.02, inertia = 0.1;  // about the axis of the dish, on a bus that is heavier
  for (const double torque : {0.02, 2.0}) {
    SystemSpec spec = with_stepper(0.0, 1);
    spec.devices[0].params["holding_torque"] = {torque, {}};
    const auto model = compiled(spec);
    const FastestMotion swing = swing_of_devices(*model, 0.0, model->initial_state());
    const double alone = std::sqrt(torque * std::numbers::pi / (2.0 * step) / inertia);
    EXPECT_EQ(swing.what, "what devices push with at dish.rate");
    EXPECT_NEAR(swing.rate / alone, 1.0, 0.02) << torque;  // the bus, of 9 kg m^2, gives way
    const MethodChoice c = choose_method(compiled(spec), 1.0, asked(1e-7));
    EXPECT_EQ(c.options.method, torque < 1.0 ? "exponential" : "dopri5") << c.why;
    EXPECT_EQ(c.why.find("what devices push with at dish.rate swings at ") != std::string::npos, torque > 1.0) << c.why;
  }
}

/// What a run by dopri5 tells whose dish turns on the field of its stepper, 126 rad/s, beside a boom of 82.
std::string told_with_damping(double damping, double seconds) {
  SystemSpec spec = with_stepper(0.0, 1);
  spec.devices[0].params["holding_torque"] = {20.0, {}}, spec.devices[0].params["damping"] = {damping, {}};
  spec.bodies.back().hinge.v = {1.0};
  SimulationOptions options;
  options.integrator.method = "dopri5", options.integrator.relative_tolerance = 1e-3;
  Simulation sim(compiled(spec), options);
  sim.run(seconds);
  return render(sim.warnings());
}

/// W0401 of a run names what is fastest, be it a device.
TEST(ChooseMethod, TellsOfDevicesWhereStabilitySetsTheSteps) {
  const std::string told = told_with_damping(50.0, 60.0);
  EXPECT_NE(told.find("stability and not accuracy sets the steps of dopri5"), std::string::npos) << told;
  EXPECT_NE(told.find("; fastest is what devices push with at dish.rate, 126 1/s"), std::string::npos) << told;
}

/// Where what a device damps sets the steps, its swing is not told as the reason.
TEST(ChooseMethod, TellsNoSwingThatIsFarTooSlowForTheSteps) {
  const std::string told = told_with_damping(5e3, 1.0);
  EXPECT_NE(told.find(" s; no mode, spring or damper is that fast: look at friction, contacts and states of devices"), std::string::npos)
      << told;
}

TEST(ChooseMethod, CountsTheStepsThatDevicesEndByThemselves) {
  for (const double rate : {100.0, -100.0}) {
    const MethodChoice c = choose_method(compiled(with_stepper(rate, 16)), 1.0, asked(1e-7));
    EXPECT_EQ(c.options.method, "dopri5");
    EXPECT_NE(c.why.find("devices end steps each 0.000625 s"), std::string::npos) << c.why;
  }
  for (const auto& [rate, microsteps] : {std::pair(0.0, 16.0), std::pair(100.0, 0.0), std::pair(0.5, 1.0)})
    EXPECT_EQ(choose_method(compiled(with_stepper(rate, microsteps)), 1.0, asked(1e-7)).options.method, "exponential") << rate;
}

/// A mission may command what the vehicle file does not say: counted by the largest rate that is taken, or told.
TEST(ChooseMethod, CountsTheStepsThatAMissionMayCommand) {
  SystemSpec spec = with_stepper(0.0, 16);
  const MethodChoice any = choose_method(compiled(spec), 1.0, asked(1e-7));
  EXPECT_EQ(any.options.method, "exponential");
  EXPECT_NE(any.why.find("a stepper without `rate_limit`"), std::string::npos) << any.why;
  for (const double limit : {200.0, 0.05}) {
    spec.devices[0].params["rate_limit"] = {limit, {}};
    const MethodChoice c = choose_method(compiled(spec), 1.0, asked(1e-7));
    EXPECT_EQ(c.options.method, limit > 1.0 ? "dopri5" : "exponential") << c.why;
    EXPECT_EQ(c.why.find("devices end steps each 0.00031") != std::string::npos, limit > 1.0) << c.why;
    EXPECT_EQ(c.why.find("rate_limit"), std::string::npos) << c.why;
  }
}

TEST(ChooseMethod, CountsTheRowsOfARecord) {
  for (const double apart : {1e-3, 10.0}) {
    SystemSpec spec = bus_with_boom();
    DeviceSpec record = device("record", "recorded_load", {}, {{"at", "bus"}});
    std::vector<double> rows;
    for (int i = 0; i < 5000; ++i) rows.insert(rows.end(), {i * apart, 1e-3 * (i % 7), 0, 0, 0, 0, 0});
    record.params["record"].value = rows;
    spec.devices = {record};
    const MethodChoice c = choose_method(compiled(spec), 1.0, asked(1e-7));
    EXPECT_EQ(c.options.method, apart < 1.0 ? "dopri5" : "exponential") << c.why;
    EXPECT_EQ(c.why.find("devices end steps each 0.001 s") != std::string::npos, apart < 1.0) << c.why;
  }
}

/// A string that may go taut is looked at with all hinges as they are: one whose motion is given, or that friction may hold, has an
/// acceleration there.
TEST(ChooseMethod, LooksAtDevicesBesideHingesThatAreGivenOrHeld) {
  for (const bool held : {false, true}) {
    SystemSpec spec = bus_with_boom();
    spec.bodies[1].hinge = on(BodySpec(), "bus", "revolute", {{0, 1, 0}}).hinge;
    if (!held) spec.bodies[1].hinge.prescribed = {0};
    spec.devices = {device("string", "cable", {{"stiffness", 20.0}, {"length", 1.5}}, {{"from", "bus"}, {"to", "boom"}})};
    if (held) spec.devices.push_back(device("brake", "dry_friction", {{"coulomb", 0.4}}, {{"at", "boom"}}));
    const auto model = compiled(spec);
    EXPECT_EQ(device_corners(*model, 1.0).interval, kNever) << held;
    EXPECT_EQ(swing_of_devices(*model, 0.0, model->initial_state()).rate, 0.0) << held;  // slack
  }
}

/// A run that exponential begins would end where the mission closes a loop.
TEST(ChooseMethod, KeepsFromClosedFormsWhereLoopsMayClose) {
  SystemSpec spec = bus_with_boom();
  LoopSpec dock;
  dock.name = "dock", dock.type = "distance", dock.length = 1.0, dock.open = true, dock.to.body = "boom";
  spec.loops = {dock};
  const MethodChoice c = choose_method(compiled(spec), 1.0, asked(1e-7));
  EXPECT_EQ(c.options.method, "dopri5");
  EXPECT_NE(c.why.find("exponential does not take loops that a mission may close"), std::string::npos) << c.why;
}

TEST(ChooseMethod, TakesTheStepThatIsGiven) {
  IntegratorOptions o = asked(1e-9);
  o.fixed_step = 0.01;
  EXPECT_EQ(choose_method(compiled(rigid_bus()), 0.1, o).options.method, "rk4");
}

TEST(ChooseMethod, IsDoneByASimulationWithTheTicksItHas) {
  SimulationOptions options;
  options.integrator = asked(1e-7);
  Simulation sim(compiled(bus_with_boom()), options);
  sim.every({1, 2}, [] {});
  sim.run(1.0);
  EXPECT_EQ(sim.integrator_name(), "exponential");
  EXPECT_NE(sim.why_integrator().find("commands may change each 0.5 s"), std::string::npos) << sim.why_integrator();
}

}  // namespace
}  // namespace cardan::test
