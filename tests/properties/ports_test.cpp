// What an input may be given beside one output of one device: a sum, what was some ticks ago, and a safe value when nobody speaks.
#include <gtest/gtest.h>

#include <cmath>

#include "core/abi/device_family.hpp"
#include "core/model/devices.hpp"
#include "core/operators/linear_model.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

struct Nothing {};

/// y = a + b, in the same evaluation.
struct Adder {
  static constexpr const char *type = "adder", *summary = "y = a + b";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"a", CARDAN_PORT_IN, "1", 0.0, 0, "input"},
                                               {"b", CARDAN_PORT_IN, "1", 0.0, 0, "input"},
                                               {"y", CARDAN_PORT_OUT, "1", 0.0, 3, "output"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = in.in[0] + in.in[1];
  }
};

/// y = x at its last tick, and how many there were.
struct Sampler {
  static constexpr const char *type = "sampler", *summary = "holds x";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"x", CARDAN_PORT_IN, "1", -1.0, 0, "input"},
                                               {"y", CARDAN_PORT_OUT, "1", 0.0, 0, "output"},
                                               {"n", CARDAN_PORT_OUT, "1", 0.0, 0, "ticks"}};
  static constexpr cardan_state_desc marks[] = {{"x", "1", 0.0, 1.0, "held"}, {"n", "1", 0.0, 1.0, "ticks"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.d[0]), out.out[1] = T(in.d[1]);
  }
  static void tick(const Packed&, const DeviceIn<double>& in, double, const double*, double*, double* d) noexcept {
    d[0] = in.in[0], d[1] += 1.0;
  }
};

/// y = t.
struct Clock {
  static constexpr const char *type = "clock", *summary = "y = t";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"y", CARDAN_PORT_OUT, "1", 0.0, 0, "time"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.t);
  }
};

/// s' = x.
struct Sum {
  static constexpr const char *type = "integral", *summary = "s' = x";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"x", CARDAN_PORT_IN, "1", 0.0, 0, "input"},
                                               {"s", CARDAN_PORT_OUT, "1", 0.0, 0, "integral"}};
  static constexpr cardan_state_desc states[] = {{"s", "1", 0.0, 1.0, "integral"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.zdot[0] = in.in[0], out.out[0] = in.z[0];
  }
};

/// x, which holds where a command says so.
struct Gauge {
  static constexpr const char *type = "gauge", *summary = "x, which may not hold";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"truth", CARDAN_PORT_IN, "1", 1.0, 0, "whether it holds"},
                                               {"x_1", CARDAN_PORT_OUT, "1", 0.0, 0, "time", nullptr, 0, "good"},
                                               {"x_2", CARDAN_PORT_OUT, "1", 0.0, 0, "twice that", nullptr, 0, "good"},
                                               {"good", CARDAN_PORT_OUT, "1", 0.0, 1, "whether they hold"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.t), out.out[1] = T(2.0 * in.t);
    out.out[2] = T(in.in[0] > T(0.5) ? 1.0 : 0.0);
  }
};

/// y = x_1 + x_2 where they hold, else -1.
struct Careful {
  static constexpr const char *type = "careful", *summary = "asks whether x holds";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"x_1", CARDAN_PORT_IN, "1", 0.0, 0, "input", nullptr, 0, "sure"},
                                               {"x_2", CARDAN_PORT_IN, "1", 0.0, 0, "input", nullptr, 0, "sure"},
                                               {"sure", CARDAN_PORT_IN, "1", 1.0, 0, "whether they hold"},
                                               {"y", CARDAN_PORT_OUT, "1", 0.0, 7, "output"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = in.in[2] > T(0.5) ? in.in[0] + in.in[1] : T(-1.0);
  }
};

/// y = 2 a - b, z = a + 5 b, and ticks that do nothing.
struct Weighed {
  static constexpr const char *type = "weighed", *summary = "y = 2 a - b";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"a", CARDAN_PORT_IN, "1", 0.0, 0, "input"},
                                               {"b", CARDAN_PORT_IN, "1", 0.0, 0, "input"},
                                               {"c", CARDAN_PORT_IN, "m", 0.0, 0, "unused"},
                                               {"y", CARDAN_PORT_OUT, "1", 0.0, 3, "output"},
                                               {"z", CARDAN_PORT_OUT, "1", 0.0, 3, "another"}};
  static constexpr cardan_state_desc marks[] = {{"n", "1", 0.0, 1.0, "ticks"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = 2.0 * in.in[0] - in.in[1], out.out[1] = in.in[0] + 5.0 * in.in[1];
  }
  static void tick(const Packed&, const DeviceIn<double>&, double, const double*, double*, double* d) noexcept { d[0] += 1.0; }
};

std::shared_ptr<const Model> with_own(std::vector<DeviceSpec> devices) {
  static const Registry types = [] {
    Registry all = registry();
    all.devices.add(device_table<Adder>()), all.devices.add(device_table<Sampler>());
    all.devices.add(device_table<Clock>()), all.devices.add(device_table<Sum>());
    all.devices.add(device_table<Gauge>()), all.devices.add(device_table<Careful>());
    all.devices.add(device_table<Weighed>());
    return all;
  }();
  SystemSpec spec = system({on(particle("mass", 2.0, {0, 0, 0}), "", "prismatic", {{1, 0, 0}})});
  spec.devices = std::move(devices);
  return compile(spec, types);
}
DeviceSpec block(const std::string& name, const std::string& type, double rate = 0.0, double offset = 0.0) {
  DeviceSpec d = device(name, type, {}, {});
  d.rate = rate, d.offset = offset;
  return d;
}
DeviceSpec::Input from(const std::string& source) { return {source, {}}; }
DeviceSpec::Input delayed(const std::string& source, int ticks) {
  DeviceSpec::Input input = from(source);
  input.delay = ticks;
  return input;
}
std::string why_refused(const std::vector<DeviceSpec>& devices) {
  try {
    Simulation sim(with_own(devices), {});
    sim.run(0.01);
  } catch (const InputError& e) {
    return e.what();
  }
  return "none";
}
int input(const Model& m, const std::string& name, int i = 0) {
  return m.devices.all[static_cast<std::size_t>(m.devices.find(name))].in + i;
}
int output(const Model& m, const std::string& name, int i = 0) {
  return m.devices.all[static_cast<std::size_t>(m.devices.find(name))].out + i;
}

TEST(Ports, AnInputMayBeASumOfOutputs) {
  DeviceSpec sum = block("sum", "integral"), one = block("one", "adder"), two = block("two", "adder");
  one.inputs["a"] = {2.0, {}}, two.inputs["a"] = {3.0, {}};
  sum.inputs["x"] = from("one.y + two.y + one.y");
  Simulation sim(with_own({sum, one, two}), {});
  sim.run(0.5);
  EXPECT_NEAR(sim.state().z[0], 0.5 * (2.0 + 3.0 + 2.0), 1e-12);
}

/// A chain of sums is a loop as one of single sources is.
TEST(Ports, ALoopThroughASumIsRefusedAndSaysWhatHelps) {
  DeviceSpec a = block("a", "adder"), b = block("b", "adder");
  a.inputs["a"] = from("b.y"), b.inputs["a"] = {1.0, {}}, b.inputs["b"] = from("b.y + a.y");
  const std::string told = why_refused({a, b});
  EXPECT_NE(told.find("C1003"), std::string::npos) << told;
  EXPECT_NE(told.find("`delay: 1`"), std::string::npos) << told;
}

/// y(k) = y(k-1) + 1: a loop with a delay of one tick counts; what it starts from is the fallback of the input.
TEST(Ports, ADelayBreaksALoop) {
  DeviceSpec adder = block("adder", "adder"), held = block("held", "sampler", 10.0);
  adder.inputs["a"] = {1.0, {}};
  adder.inputs["b"] = from("held.y");
  held.inputs["x"] = delayed("adder.y", 1);
  Simulation sim(with_own({adder, held}), {});
  const int y = output(sim.model(), "held"), in = input(sim.model(), "held");
  sim.run(0.05);
  EXPECT_EQ(sim.device_output(y), -1.0);  // at 0: the fallback
  EXPECT_EQ(sim.device_input(in), -1.0);
  sim.run(0.45);
  EXPECT_EQ(sim.device_output(y), 3.0);  // -1, 0, 1, 2, 3 at 0 ... 0.4
}

/// n ticks ago at the ticks of who takes it, exactly; of a latency in time the same, and of a sum.
TEST(Ports, GivesWhatWasSomeTicksAgo) {
  for (const auto& [in_time, of] : {std::pair{false, 1}, {true, 1}, {false, 2}}) {
    DeviceSpec held = block("held", "sampler", 20.0);
    held.inputs["x"] = delayed(of == 2 ? "clock.y + other.y" : "clock.y", 3);
    if (in_time) held.inputs["x"].delay = 0, held.inputs["x"].latency = 0.15;
    Simulation sim(with_own({block("clock", "clock"), block("other", "clock"), held}), {});
    std::vector<double> seen;
    sim.every({1, 20}, [&] { seen.push_back(sim.device_output(output(sim.model(), "held"))); });
    sim.run(0.52);
    ASSERT_EQ(seen.size(), 11u);  // a controller sees what was there before the devices with inputs tick
    for (std::size_t k = 1; k < seen.size(); ++k) EXPECT_EQ(seen[k], k < 4 ? -1.0 : of * (static_cast<double>(k - 4) / 20.0)) << k;
  }
}

/// Each of them, where the vehicle becomes another one meanwhile.
TEST(Ports, WhatIsUnderWayStaysSoWhereTheVehicleChanges) {
  DeviceSpec one = block("one", "sampler", 20.0), two = block("two", "sampler", 20.0);
  one.inputs["x"] = delayed("clock.y", 3), two.inputs["x"] = delayed("clock.y + other.y", 3);
  const std::shared_ptr<const Model> model = with_own({block("clock", "clock"), block("other", "clock"), one, two});
  Simulation sim(model, {});
  std::vector<double> of_one, of_two;
  sim.every({1, 20}, [&] {
    of_one.push_back(sim.device_output(output(sim.model(), "one"))), of_two.push_back(sim.device_output(output(sim.model(), "two")));
  });
  sim.every({1, 1}, [&] { sim.adopt(model); }, {3, 10});
  sim.run(0.52);
  ASSERT_EQ(of_two.size(), 11u);
  for (std::size_t k = 4; k < of_two.size(); ++k) {
    EXPECT_EQ(of_one[k], static_cast<double>(k - 4) / 20.0) << k;
    EXPECT_EQ(of_two[k], 2.0 * of_one[k]) << k;
  }
}

/// From a device that samples to one that is continuous: at the ticks of the giver, held between.
TEST(Ports, ADelayToAContinuousDeviceTicksWithWhoGives) {
  DeviceSpec held = block("held", "sampler", 10.0), sum = block("sum", "integral");
  held.inputs["x"] = from("clock.y");
  sum.inputs["x"] = delayed("held.y", 1);
  Simulation sim(with_own({block("clock", "clock"), held, sum}), {});
  sim.run(0.4);
  EXPECT_NEAR(sim.state().z[0], 0.1 * (0.0 + 0.0 + 0.1 + 0.2), 1e-12);
}

TEST(Ports, ADeviceMayTickLater) {
  DeviceSpec held = block("held", "sampler", 10.0, 0.007);
  held.inputs["x"] = from("clock.y");
  Simulation sim(with_own({block("clock", "clock"), held}), {});
  const int y = output(sim.model(), "held");
  sim.run(0.005);
  EXPECT_EQ(sim.device_output(y + 1), 0.0);
  sim.run(0.25);
  EXPECT_EQ(sim.device_output(y + 1), 3.0);  // at 7, 107, 207 ms
  EXPECT_EQ(sim.device_output(y), 0.207);
  EXPECT_NE(why_refused({block("held", "sampler", 10.0, 0.1234567891234)}).find("devices.held.offset"), std::string::npos);
}

/// A script that stops speaking: its last command counts for 0.25 s, then the safe one. What it says in time keeps it alive, at the very
/// instant too.
TEST(Ports, ASilentCommandBecomesSafe) {
  DeviceSpec sum = block("sum", "integral");
  sum.inputs["x"] = {1.0, {}};
  sum.inputs["x"].safe = -2.0, sum.inputs["x"].timeout = 0.25;
  Simulation quiet(with_own({sum}), {});
  quiet.run(1.0);
  EXPECT_NEAR(quiet.state().z[0], 0.25 - 2.0 * 0.75, 1e-9);
  Simulation alive(with_own({sum}), {});
  alive.every({1, 4}, [&] {
    if (alive.time() < 0.6) alive.set_device_input(0, 1.0);
  });
  alive.run(1.0);
  EXPECT_NEAR(alive.state().z[0], 0.75 - 2.0 * 0.25, 1e-9);
}

TEST(Ports, OptionsThatDoNotFitAreRefused) {
  const auto told = [](const auto& change) {
    DeviceSpec held = block("held", "sampler", 10.0);
    held.inputs["x"] = from("clock.y");
    change(held);
    return why_refused({block("clock", "clock"), held});
  };
  EXPECT_EQ(told([](DeviceSpec&) {}), "none");
  EXPECT_NE(told([](DeviceSpec& d) { d.inputs["x"].safe = 1.0, d.inputs["x"].timeout = 1.0; }).find("a connection, which is never silent"),
            std::string::npos);
  EXPECT_NE(told([](DeviceSpec& d) {
              d.inputs["x"] = {1.0, {}}, d.inputs["x"].delay = 1;
            }).find("a number that is commanded"),
            std::string::npos);
  EXPECT_NE(told([](DeviceSpec& d) { d.inputs["x"] = {1.0, {}}, d.inputs["x"].safe = 1.0; }).find("no `timeout`"), std::string::npos);
  EXPECT_NE(told([](DeviceSpec& d) { d.inputs["x"].delay = 1, d.inputs["x"].latency = 0.1; }).find("both"), std::string::npos);
  EXPECT_NE(told([](DeviceSpec& d) { d.inputs["x"].latency = -0.1; }).find("a time > 0"), std::string::npos);
  const std::string odd = told([](DeviceSpec& d) { d.inputs["x"].latency = 0.25; });
  EXPECT_NE(odd.find("a whole number of ticks of held, 0.1 s each"), std::string::npos) << odd;
  EXPECT_NE(odd.find("0.3 s, or another rate of held"), std::string::npos) << odd;
  DeviceSpec sum = block("sum", "integral");
  sum.inputs["x"] = delayed("clock.y", 1);
  EXPECT_NE(why_refused({block("clock", "clock"), sum}).find("none: both are continuous"), std::string::npos);
  DeviceSpec unit = block("unit", "integral"), motor = device("wheel", "momentum_wheel", {{"inertia", 0.1}}, {{"at", "mass"}});
  unit.inputs["x"] = from("clock.y + wheel.momentum");
  EXPECT_NE(why_refused({block("clock", "clock"), motor, unit}).find("wheel.momentum in"), std::string::npos);
}

/// The same bits as if the run had never stopped: what is under way in delays, and since when a command is silent.
TEST(Ports, AreInCheckpoints) {
  DeviceSpec adder = block("adder", "adder"), held = block("held", "sampler", 10.0, 0.03), sum = block("sum", "integral"), quiet = sum;
  adder.inputs["a"] = {1.0, {}};
  adder.inputs["b"] = from("held.y");
  held.inputs["x"] = delayed("adder.y", 2);
  sum.inputs["x"] = from("held.y");
  quiet.name = "quiet";
  quiet.inputs["x"] = {1.0, {}};
  quiet.inputs["x"].safe = 0.0, quiet.inputs["x"].timeout = 0.7;
  for (const double split : {0.0, 0.13, 0.4, 0.7, 0.75}) {
    const auto model = with_own({adder, held, sum, quiet});
    Simulation whole(model, {}), part(model, {});
    if (split > 0.0) whole.run(split);
    part.resume(whole.checkpoint());
    whole.run(1.5), part.run(1.5);
    EXPECT_TRUE(whole.state().z == part.state().z && whole.state().marks == part.state().marks) << split;
    EXPECT_EQ(whole.statistics().steps, part.statistics().steps) << split;
    EXPECT_NEAR(whole.state().z[model->devices.all[static_cast<std::size_t>(model->devices.find("quiet"))].z], 0.7, 1e-9) << split;
  }
}

/// With what is connected goes whether it holds, also through a delay, and who does not ask is told of.
TEST(Ports, TakeWithAnOutputWhetherItHolds) {
  DeviceSpec gauge = block("gauge", "gauge"), asks = block("asks", "careful"), never = block("never", "adder");
  asks.inputs["x_1"] = from("gauge.x_1"), asks.inputs["x_2"] = from("gauge.x_2");
  never.inputs["a"] = from("gauge.x_1"), never.inputs["b"] = from("gauge.x_2");
  Simulation sim(with_own({gauge, asks, never}), {});
  const Model& m = sim.model();
  sim.run(0.5), sim.observe();
  EXPECT_NEAR(sim.device_output(output(m, "asks")), 1.5, 1e-15);
  sim.set_device_input(input(m, "gauge"), 0.0);
  sim.run(0.6), sim.observe();
  EXPECT_EQ(sim.device_output(output(m, "asks")), -1.0);
  const Warnings found = unheeded_validity(m);
  ASSERT_EQ(found.all().size(), 1U);
  EXPECT_EQ(found.all()[0].what.code, Code::unheeded_validity);
  EXPECT_EQ(found.all()[0].what.at.key_path, "devices.never.inputs");

  // An own answer in place of that; and none where nothing is connected.
  asks.inputs["sure"] = {1.0, {}};
  Simulation told(with_own({gauge, asks}), {}), alone(with_own({block("asks", "careful")}), {});
  told.set_device_input(input(told.model(), "gauge"), 0.0);
  told.run(0.5), told.observe(), alone.run(0.1), alone.observe();
  EXPECT_NEAR(told.device_output(output(told.model(), "asks")), 1.5, 1e-15);
  EXPECT_EQ(alone.device_output(0), 0.0);
}

TEST(Ports, TakeWhetherAnOutputHoldsAsLateAsTheOutput) {
  DeviceSpec clock = block("clock", "sampler", 10.0), gauge = block("gauge", "gauge"), asks = block("asks", "careful"),
             held = block("held", "sampler", 10.0);
  held.inputs["x"] = from("asks.y");
  asks.inputs["x_1"] = delayed("gauge.x_1 + clock.n", 2);  // ticks of the clock
  Simulation sim(with_own({clock, gauge, asks, held}), {});
  const Model& m = sim.model();
  EXPECT_EQ(m.devices.delays.size(), 2U) << "of x_1, and of what says that it holds";
  sim.run(0.55);
  sim.set_device_input(input(m, "gauge"), 0.0);  // seen at 0.6, told at 0.8
  sim.run(0.75), sim.observe();
  EXPECT_GE(sim.device_output(output(m, "asks")), 0.0);
  sim.run(0.85), sim.observe();
  EXPECT_EQ(sim.device_output(output(m, "asks")), -1.0);
}

TEST(Ports, AreRefusedWhereTwoSayWhetherTheyHold) {
  DeviceSpec a = block("a", "gauge"), b = block("b", "gauge"), asks = block("asks", "careful");
  asks.inputs["x_1"] = from("a.x_1"), asks.inputs["x_2"] = from("b.x_2");
  const std::string told = why_refused({a, b, asks});
  EXPECT_NE(told.find("C1002"), std::string::npos) << told;
  EXPECT_NE(told.find("at: devices.asks.inputs.sure"), std::string::npos) << told;
  EXPECT_NE(told.find("a.good or b.good"), std::string::npos) << told;
  EXPECT_NE(told.find("give devices.asks.inputs.sure itself"), std::string::npos) << told;
}

/// The fault of an output, or of an input, of the device with this name.
PortFault fault_of(const Simulation& sim, const std::string& name, bool input, int place = 0) {
  return {.device = sim.model().devices.find(name), .input = input, .place = place};
}
double state_of(const Simulation& sim, const std::string& name) {
  return sim.state().z[sim.model().devices.all[static_cast<std::size_t>(sim.model().devices.find(name))].z];
}

/// Whoever reads it gets s x + b + d (t - t_0), or what it is stuck at, between two instants that are no ticks of anybody.
TEST(PortFaults, AreSeenByWhoeverReads) {
  for (const char* method : {"dopri5", "cvode_bdf", "between steps"}) {
    DeviceSpec one = block("one", "integral"), two = block("two", "integral"), told = block("told", "integral"),
               sum = block("sum", "integral");
    one.inputs["x"] = two.inputs["x"] = from("clock.y");
    told.inputs["x"] = {0.7, {}};
    sum.inputs["x"] = from("clock.y + other.y");
    SimulationOptions options;
    options.integrator.relative_tolerance = 1e-12, options.absolute_tolerance = 1e-12;
    options.between_steps = method == std::string("between steps");
    if (!options.between_steps) options.integrator.method = method;
    Simulation sim(with_own({block("clock", "clock"), block("other", "clock"), one, two, told, sum}), options);
    const double a = std::sqrt(0.2), b = std::sqrt(2.0);
    PortFault output = fault_of(sim, "clock", false), input = fault_of(sim, "two", true), command = fault_of(sim, "told", true);
    output.scale = 2.0, output.bias = 1.0, output.drift = -3.0, output.from = a, output.until = b;
    input.scale = -1.0, input.bias = 0.25, input.from = 0.3, input.until = 1.7;
    command.stuck = true, command.value = -2.0, command.from = 0.1, command.until = 0.6;
    for (const PortFault& f : {output, input, command}) sim.fault(f);
    sim.run(0.5), sim.observe();
    EXPECT_NEAR(sim.device_output(output.place + sim.model().devices.all[static_cast<std::size_t>(output.device)].out),
                2.0 * 0.5 + 1.0 - 3.0 * (0.5 - a), 1e-15);
    sim.run(2.0);
    // integral of t, and of what is wrong with it: (2 - 1) t + 1 - 3 (t - a) from a to b
    const auto wrong = [a](double t) { return 0.5 * t * t + t - 1.5 * (t - a) * (t - a); };
    const double sound = 2.0, off = wrong(b) - wrong(a);
    const double tolerance = method == std::string("cvode_bdf") ? 1e-8 : 1e-11;
    EXPECT_NEAR(state_of(sim, "one"), sound + off, tolerance) << method;
    EXPECT_NEAR(state_of(sim, "sum"), 2.0 * sound + off, tolerance) << method;
    // the input of `two` turns what came in, the fault of the output included
    const double within = 0.5 * (1.7 * 1.7 - 0.3 * 0.3) + off;
    EXPECT_NEAR(state_of(sim, "two"), sound + off - 2.0 * within + 0.25 * 1.4, tolerance) << method;
    EXPECT_NEAR(state_of(sim, "told"), 0.7 * 1.5 - 2.0 * 0.5, tolerance) << method;
    EXPECT_TRUE(sim.faults().empty());
  }
}

/// Stuck at what it is when the fault begins; another fault takes its place, and it may be mended before its time.
TEST(PortFaults, AreStuckReplacedAndMended) {
  Simulation sim(with_own({block("clock", "clock")}), {});
  PortFault f = fault_of(sim, "clock", false);
  f.stuck = true, f.from = 0.25, f.until = 9.0;
  sim.fault(f);
  sim.run(0.7);
  EXPECT_EQ(sim.device_output(0), 0.25);
  PortFault other = fault_of(sim, "clock", false);
  other.bias = 10.0, other.from = 0.7;
  sim.fault(other);
  other.bias = -10.0, other.from = 1.0, other.until = 1.5;
  sim.fault(other);
  sim.fault(fault_of(sim, "clock", false));  // nothing is wrong with it
  EXPECT_EQ(sim.faults().size(), 2U);
  EXPECT_EQ(sim.device_output(0), 10.7);
  sim.run(0.8);
  sim.mend(f.device, false, 0);
  EXPECT_EQ(sim.device_output(0), 0.8);
  sim.mend(f.device, false, 0);  // there is none
  sim.run(1.25);
  EXPECT_EQ(sim.device_output(0), -8.75);
  sim.run(1.75);
  EXPECT_EQ(sim.device_output(0), 1.75);
  EXPECT_TRUE(sim.faults().empty());
}

/// At an instant of the tick of a device a fault that begins or ends there has done so.
TEST(PortFaults, BeginAndEndBeforeTheTicksOfTheirInstant) {
  DeviceSpec held = block("held", "sampler", 10.0);
  held.inputs["x"] = from("clock.y");
  Simulation sim(with_own({block("clock", "clock"), held}), {});
  PortFault f = fault_of(sim, "clock", false);
  f.bias = 5.0, f.from = 0.2, f.until = 0.1 + 0.2;  // a rounding beyond 0.3
  sim.fault(f);
  std::vector<double> seen;
  sim.every({1, 10}, [&] { seen.push_back(sim.device_output(output(sim.model(), "held"))); });
  sim.run(0.65);
  const std::vector<double> ticks = {0.0, 0.1, 5.2, 0.3, 0.4, 0.5};  // seen one tick later, as controllers come before
  ASSERT_EQ(seen.size(), 7U);
  for (std::size_t k = 0; k < ticks.size(); ++k) EXPECT_NEAR(seen[k + 1], ticks[k], 1e-15) << k;
}

/// Noise has its standard deviation and is drawn by the seed and the name; a lost tick leaves what was before it.
TEST(PortFaults, AreDrawnAtTicks) {
  DeviceSpec held = block("held", "sampler", 1000.0), in = block("in", "sampler", 1000.0), lossy = block("lossy", "sampler", 1000.0);
  held.inputs["x"] = {3.0, {}};
  in.inputs["x"] = lossy.inputs["x"] = from("clock.y");
  struct Seen {
    std::vector<double> noise, in, out;
  };
  const auto run = [&](std::uint64_t seed) {
    SimulationOptions options;
    options.seed = seed;
    Simulation sim(with_own({block("clock", "clock"), held, in, lossy}), options);
    PortFault noise = fault_of(sim, "held", false), input = fault_of(sim, "in", true), output_lost = fault_of(sim, "lossy", false);
    noise.noise = 0.5, noise.bias = 1.0, input.drop = 0.3, output_lost.drop = 0.3;
    for (const PortFault& f : {noise, input, output_lost}) sim.fault(f);
    Seen seen;
    sim.every({1, 1000}, [&] {
      const Model& m = sim.model();
      seen.noise.push_back(sim.device_output(output(m, "held")) - 4.0), seen.in.push_back(sim.device_output(output(m, "in")));
      seen.out.push_back(sim.device_output(output(m, "lossy")));
    });
    sim.run(4.0005);
    return seen;
  };
  const Seen seen = run(1), again = run(1), other = run(2);
  EXPECT_EQ(seen.noise, again.noise);
  EXPECT_NE(seen.noise, other.noise);
  const auto n = static_cast<double>(seen.noise.size() - 1);
  double sum = 0.0, squares = 0.0, next = 0.0;
  for (std::size_t k = 1; k < seen.noise.size(); ++k) {
    sum += seen.noise[k], squares += seen.noise[k] * seen.noise[k];
    if (k > 1) next += seen.noise[k] * seen.noise[k - 1];
  }
  EXPECT_NEAR(sum / n, 0.0, 4.0 * 0.5 / std::sqrt(n));  // four standard deviations of each
  EXPECT_NEAR(squares / n, 0.25, 4.0 * 0.25 * std::sqrt(2.0 / n));
  EXPECT_NEAR(next / n, 0.0, 4.0 * 0.25 / std::sqrt(n));
  for (const std::vector<double>* all : {&seen.in, &seen.out}) {
    int lost = 0;
    for (std::size_t k = 2; k < all->size(); ++k) {  // what came at tick k - 1, as the controller sees it
      const double now = static_cast<double>(k - 1) / 1000.0;
      if ((*all)[k] != (*all)[k - 1])
        EXPECT_NEAR((*all)[k], now, 1e-12) << k;
      else
        ++lost;
    }
    EXPECT_NEAR(lost / n, 0.3, 4.0 * std::sqrt(0.3 * 0.7 / n));
  }
  EXPECT_NE(seen.in, seen.out);
}

/// What is lost is lost whatever noise it would have had.
TEST(PortFaults, AreLostWhateverTheirNoise) {
  DeviceSpec held = block("held", "sampler", 1000.0);
  held.inputs["x"] = {3.0, {}};
  Simulation sim(with_own({held}), {});
  PortFault f = fault_of(sim, "held", false);
  f.noise = 0.5, f.drop = 0.5;
  sim.fault(f);
  double sum = 0.0, before = 0.0;
  int came = 0;
  for (int k = 1; k < 4000; ++k) {
    sim.run((k + 0.5) / 1000.0);
    const double now = sim.device_output(output(sim.model(), "held")) - 3.0;
    if (now != before) sum += now, ++came;
    before = now;
  }
  EXPECT_NEAR(came / 4000.0, 0.5, 4.0 * 0.5 / std::sqrt(4000.0));
  EXPECT_NEAR(sum / came, 0.0, 4.0 * 0.5 / std::sqrt(came));  // four standard deviations
}

/// What was so many ticks ago, and until that comes through what was there when it began; whatever else is wrong comes after it.
TEST(PortFaults, AreLateByTicks) {
  for (const std::string method : {"dopri5", "between steps"}) {
    DeviceSpec held = block("held", "sampler", 10.0), fed = block("fed", "sampler", 10.0), second = block("second", "sampler", 10.0);
    held.inputs["x"] = fed.inputs["x"] = second.inputs["x"] = from("clock.y");
    SimulationOptions options;
    options.between_steps = method != "dopri5";
    Simulation sim(with_own({block("clock", "clock"), held, fed, second}), options);
    PortFault late = fault_of(sim, "held", false), told_late = fault_of(sim, "fed", true), other = fault_of(sim, "second", false);
    late.delay = 0.3, late.from = 0.25, late.until = 0.85;
    told_late.delay = 0.2;
    other.delay = 0.3, other.from = 0.2, other.scale = -2.0, other.bias = 1.0, other.drift = 0.5;
    for (const PortFault& f : {late, told_late, other}) sim.fault(f);
    std::vector<double> seen[3];
    sim.watch({1, 10}, [&] {
      const Model& m = sim.model();
      seen[0].push_back(sim.device_output(output(m, "held"))), seen[1].push_back(sim.device_output(output(m, "fed")));
      seen[2].push_back(sim.device_output(output(m, "second")));
    });
    sim.run(1.05);
    const std::vector<double> of_held = {0.0, 0.1, 0.2, 0.2, 0.2, 0.2, 0.3, 0.4, 0.8, 0.9},
                              of_fed = {0.0, 0.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5},
                              of_second = {0.0, 0.1, 0.1, 0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
    ASSERT_EQ(seen[0].size(), 11U);
    // Who looks at tick k comes before the devices of it, and sees what tick k - 1 left.
    for (std::size_t k = 0; k < of_held.size(); ++k) EXPECT_NEAR(seen[0][k + 1], of_held[k], 1e-15) << method << k;
    for (std::size_t k = 0; k < of_fed.size(); ++k) EXPECT_NEAR(seen[1][k + 1], of_fed[k], 1e-15) << method << k;
    for (std::size_t k = 0; k < of_second.size(); ++k) {
      const double t = 0.1 * static_cast<double>(k + 1);
      EXPECT_NEAR(seen[2][k + 1], k < 1 ? of_second[k] : -2.0 * of_second[k] + 1.0 + 0.5 * (t - 0.2), 1e-14) << method << k;
    }
  }
}

/// Two ports of a device exchange what they give or are told, until one of them is mended or has another fault.
TEST(PortFaults, AreSwapped) {
  for (const bool connected : {true, false}) {
    DeviceSpec a = block("a", "adder"), b = block("b", "adder"), weighed = block("weighed", "weighed", 10.0);
    a.inputs["a"] = {3.0, {}}, b.inputs["a"] = {7.0, {}};
    if (connected)
      weighed.inputs["a"] = from("a.y"), weighed.inputs["b"] = from("b.y");
    else
      weighed.inputs["a"] = {3.0, {}}, weighed.inputs["b"] = {7.0, {}};
    Simulation sim(with_own({a, b, weighed}), {});
    const int y = output(sim.model(), "weighed"), z = y + 1;
    const auto expect = [&](double t, double of_y, double of_z) {
      sim.run(t);
      EXPECT_EQ(sim.device_output(y), of_y) << t;
      EXPECT_EQ(sim.device_output(z), of_z) << t;
    };
    PortFault in = fault_of(sim, "weighed", true), out = fault_of(sim, "weighed", false);
    in.swap = 1, in.from = 1.0, in.until = 3.0;
    out.swap = 1, out.from = 2.0;
    sim.fault(in), sim.fault(out);
    EXPECT_EQ(sim.faults().size(), 4U);
    expect(0.5, -1.0, 38.0);
    expect(1.5, 11.0, 22.0);
    expect(2.5, 22.0, 11.0);
    expect(3.5, 38.0, -1.0);
    sim.mend(out.device, false, 1);  // one is both
    EXPECT_TRUE(sim.faults().empty());
    expect(4.0, -1.0, 38.0);
    out.from = 4.0;
    sim.fault(out);
    PortFault bias = fault_of(sim, "weighed", false, 1);
    bias.bias = 0.5, bias.from = 5.0, bias.until = 6.0;
    sim.fault(bias);
    expect(4.5, 38.0, -1.0);
    expect(5.5, -1.0, 38.5);
    expect(6.5, -1.0, 38.0);
    EXPECT_TRUE(sim.faults().empty());
  }
}

/// A direct way from input to output: the weights of what is swapped, and none through a delay, whose value is held.
TEST(PortFaults, AreInLinearModels) {
  const auto direct = [](const auto& change) -> Eigen::MatrixXd {
    Simulation sim(with_own({block("weighed", "weighed", 10.0)}), {});
    change(sim);
    operators::TreeOperators ops(sim.shared_model());
    ops.at(sim.state().q.data());
    const std::vector<double> tau = sim.applied_forces();
    return operators::linearize(ops, {.q = sim.state().q.data(), .v = sim.state().v.data(), .tau = tau.data(), .devices = sim.devices()},
                                {{"weighed:a", "weighed:b"}, {"weighed:y", "weighed:z"}})
        .D;
  };
  const auto with = [&](bool input, double delay, int swap) {
    return direct([&](Simulation& sim) {
      PortFault f = fault_of(sim, "weighed", input);
      f.delay = delay, f.swap = swap;
      sim.fault(f);
    });
  };
  const Eigen::Matrix2d sound{{2.0, -1.0}, {1.0, 5.0}}, columns{{-1.0, 2.0}, {5.0, 1.0}}, rows{{1.0, 5.0}, {2.0, -1.0}},
      first_column{{0.0, -1.0}, {0.0, 5.0}}, first_row{{0.0, 0.0}, {1.0, 5.0}};
  EXPECT_EQ(direct([](Simulation&) {}), sound);
  EXPECT_EQ(with(true, 0.0, 1), columns);
  EXPECT_EQ(with(false, 0.0, 1), rows);
  EXPECT_EQ(with(true, 0.2, -1), first_column);
  EXPECT_EQ(with(false, 0.2, -1), first_row);
}

/// The same bits as if the run had never stopped: before, while and after there is a fault.
TEST(PortFaults, AreInCheckpoints) {
  DeviceSpec held = block("held", "sampler", 10.0, 0.03), sum = block("sum", "integral");
  held.inputs["x"] = from("clock.y");
  sum.inputs["x"] = from("held.y");
  DeviceSpec late = block("late", "sampler", 20.0), of_late = block("of_late", "integral"), of_ticks = block("of_ticks", "integral");
  late.inputs["x"] = from("clock.y"), of_late.inputs["x"] = from("late.y"), of_ticks.inputs["x"] = from("late.n");
  const auto model = with_own({block("clock", "clock"), held, sum, late, of_late, of_ticks});
  const auto declare = [](Simulation& sim) {
    PortFault stuck = fault_of(sim, "clock", false), lost = fault_of(sim, "held", true), noise = fault_of(sim, "held", false),
              delay = fault_of(sim, "late", true), swap = fault_of(sim, "late", false);
    delay.delay = 0.35, delay.from = 0.1, delay.until = 1.25, swap.swap = 1, swap.from = 0.29, swap.until = 1.28;
    sim.fault(delay), sim.fault(swap);
    stuck.stuck = true, stuck.from = 0.21, stuck.until = 0.48;
    lost.drop = 0.5, lost.from = 0.1, lost.until = 1.2, noise.noise = 0.1, noise.scale = 2.0, noise.from = 0.4;
    for (const PortFault& f : {stuck, lost, noise}) sim.fault(f);
  };
  for (const double split : {0.0, 0.21, 0.3, 0.48, 0.73, 1.3}) {
    Simulation whole(model, {}), part(model, {});
    declare(whole);
    if (split > 0.0) whole.run(split);
    part.resume(whole.checkpoint());
    whole.run(1.5), part.run(1.5);
    EXPECT_TRUE(whole.state().z == part.state().z && whole.state().marks == part.state().marks) << split;
    EXPECT_EQ(whole.statistics().steps, part.statistics().steps) << split;
    EXPECT_EQ(part.faults().size(), 1U);
  }
}

/// Whatever a number of a checkpoint is, nothing reads beside the ports.
TEST(PortFaults, OfNoPortAreRefusedInCheckpoints) {
  const auto model = with_own({block("clock", "clock"), block("weighed", "weighed", 10.0)});
  Simulation sim(model, {});
  PortFault swap = fault_of(sim, "weighed", false), late = fault_of(sim, "weighed", true);
  swap.swap = 1, late.delay = 0.2;
  sim.fault(swap), sim.fault(late);
  sim.run(0.25);
  const Checkpoint good = sim.checkpoint();
  int refused = 0;
  for (std::size_t i = 0; i < good.at("commands").numbers.size(); ++i)
    for (const double odd : {-2.0, 99.0, 1e6}) {
      Checkpoint changed = good;
      changed["commands"].numbers[i] = odd;
      Simulation other(model, {});
      try {
        other.resume(changed);
        other.run(0.45);
      } catch (const CheckpointFault& fault) {
        refused += std::string(fault.what()).find("a fault of no port") != std::string::npos;
      } catch (const NumericsError&) {
      }
    }
  EXPECT_EQ(refused, 3 * (3 + 3 + 3)) << "of each of three faults its device, place, and swap";
}

TEST(PortFaults, ThatCannotBeAreRefused) {
  SystemSpec spec = system({on(rigid("bus", 20.0, {0, 0, 0}, diagonal({2, 3, 4})), "", "free")});
  spec.devices = {device("tank", "tank", {{"radius", 0.2}, {"density", 1000.0}, {"pressure", 20.0}, {"loaded", 2.0}}, {{"at", "bus"}}),
                  device("thruster", "thruster", {{"thrust", 1.0}, {"specific_impulse", 200.0}}, {{"at", "bus"}})};
  spec.devices[1].params["direction"].value = std::vector<double>{0.0, 0.0, 1.0};
  spec.devices[0].inputs["flow"] = from("thruster.flow"), spec.devices[1].inputs["supply"] = from("tank.supply");
  Simulation sim(compiled(spec), {});
  const auto told = [&sim](const PortFault& f) -> std::string {
    try {
      sim.fault(f);
    } catch (const InputError& e) {
      return e.what();
    }
    return "none";
  };
  const auto with = [&](const auto& change) {
    PortFault f = fault_of(sim, "thruster", true);
    change(f);
    return told(f);
  };
  const auto has = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_EQ(with([](PortFault& f) { f.scale = 0.5; }), "none");
  EXPECT_TRUE(has(with([](PortFault& f) { f.bias = std::nan(""); }), "fault of thruster.command.bias"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.noise = 0.1; }), "a device that samples"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.drop = 1.5; }), "a probability from 0 to 1"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.from = 2.0, f.until = 1.0; }), "after that at which it begins"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.from = -1.0; }), "a time [s] from now on, 0 s"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.stuck = true, f.bias = 1.0; }), "nothing beside it"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.place = 7; }), "C0301"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.delay = 0.1; }), "a device that samples: values are kept at its ticks"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.delay = -0.1; }), "a time >= 0 s"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.stuck = true, f.delay = 0.1; }), "nothing beside it"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.swap = 1, f.scale = 2.0; }), "nothing beside it: what is swapped"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.swap = 0; }), "another port"));
  EXPECT_TRUE(has(with([](PortFault& f) { f.swap = 9; }), "C0301"));
  EXPECT_TRUE(has(told(fault_of(sim, "thruster", false, 1)), "one through which mass flows"));
  EXPECT_TRUE(has(told(fault_of(sim, "tank", true)), "one through which mass flows"));
  EXPECT_EQ(told(fault_of(sim, "thruster", true, 1)), "none");
  DeviceSpec weighed = block("weighed", "weighed", 10.0);
  weighed.inputs["a"] = from("clock.y");
  Simulation ticks(with_own({block("clock", "clock"), weighed}), {});
  const auto of_weighed = [&](const auto& change) -> std::string {
    PortFault f = fault_of(ticks, "weighed", true);
    change(f);
    try {
      ticks.fault(f);
    } catch (const InputError& e) {
      return e.what();
    }
    return "none";
  };
  EXPECT_TRUE(has(of_weighed([](PortFault& f) { f.delay = 0.25; }), "a whole number of ticks of weighed, 0.1 s each, at most 1000000"));
  EXPECT_TRUE(has(of_weighed([](PortFault& f) { f.delay = 1e6; }), "a whole number of ticks of weighed"));
  EXPECT_TRUE(has(of_weighed([](PortFault& f) { f.swap = 2; }), "a port of the same unit"));
  EXPECT_TRUE(has(of_weighed([](PortFault& f) { f.swap = 1; }), "two inputs that are commanded, or two that are connected"));
}

}  // namespace
}  // namespace cardan::test
