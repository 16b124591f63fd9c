// What contract 2.1 added to devices: frames of ports, required inputs, roles, hinge accelerations at ticks, codes in words.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/abi/device_family.hpp"
#include "core/sim/simulation.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"

namespace cardan::test {
namespace {

struct Nothing {};

/// Pushes along x of a node with what it is given.
struct Pusher {
  static constexpr const char *type = "pusher", *summary = "a force along x";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD, "a node"}};
  static constexpr cardan_port_desc ports[] = {{"force", CARDAN_PORT_IN, "m/s^2", 0.0, 0, "along x, per kg", "at", CARDAN_PORT_REQUIRED}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.load[0].force.x = in.in[0];
  }
};

/// A component of a hinge: its acceleration at the last tick. Refuses beyond 100.
struct Feeler {
  static constexpr const char *type = "feeler", *summary = "acceleration of a hinge";
  static constexpr unsigned facts = 0;
  using Packed = Nothing;
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_ACCELERATION, "a component"}};
  static constexpr cardan_port_desc ports[] = {{"y", CARDAN_PORT_OUT, "1", 0.0, 0, "as sampled"}};
  static constexpr cardan_state_desc marks[] = {{"y", "1", 0.0, 1.0, "held"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(in.d[0]);
  }
  static void tick(const Packed&, const DeviceIn<double>& in, double, const double*, double*, double* d) noexcept { d[0] = in.at[0].vdot; }
};

/// Notes in which order two of it tick.
struct Teller {
  static constexpr const char *type = "teller", *summary = "says that it ticks";
  static constexpr unsigned facts = 0, role = CARDAN_ROLE_SENSOR;
  using Packed = Nothing;
  static constexpr cardan_port_desc ports[] = {{"x", CARDAN_PORT_IN, "1", 0.0, 0, "input"}};
  static constexpr cardan_state_desc marks[] = {{"n", "1", 0.0, 1.0, "ticks"}};
  inline static std::vector<std::string> told;
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>&, DeviceOut<T>&) noexcept {}
  static void tick(const Packed&, const DeviceIn<double>&, double, const double*, double*, double*) noexcept { told.push_back("sensor"); }
};
struct LateTeller : Teller {
  static constexpr const char* type = "late_teller";
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  static constexpr cardan_port_desc ports[] = {{"y", CARDAN_PORT_OUT, "1", 0.0, 0, "nothing"}};
  static void tick(const Packed&, const DeviceIn<double>&, double, const double*, double*, double*) noexcept { told.push_back("actuator"); }
};

const Registry& own() {
  static const Registry all = [] {
    static cardan_device_family refusing = device_table<Feeler>();
    refusing.type = "refusing_feeler";
    refusing.tick = [](const cardan_device_args* a, double, const double*, double*, double*) { return a->mount[0].vdot > 1.0 ? 3 : 0; };
    refusing.explain = [](const void*, int code) { return code == 3 ? "faster than it can feel" : nullptr; };
    Registry r = registry();
    r.devices.add(device_table<Pusher>()), r.devices.add(device_table<Feeler>()), r.devices.add(refusing);
    r.devices.add(device_table<Teller>()), r.devices.add(device_table<LateTeller>());
    return r;
  }();
  return all;
}

NodeSpec node(const std::string& name, double angle) {
  NodeSpec n;
  n.name = name, n.position = {0.1, 0, 0};
  n.R_BN = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return n;
}

/// What is said of an accelerometer at one node that feeds a pusher at another.
std::string told(const std::string& reads, const std::string& pushes) {
  BodySpec bus = on(rigid("bus", 10.0, {0, 0, 0}, diagonal({2, 2, 3})), "", "free");
  bus.nodes = {node("hook", 0.0), node("ring", 0.0), node("turned", 0.5)};
  BodySpec arm = on(rigid("arm", 1.0, {0.5, 0, 0}, diagonal({0.1, 0.2, 0.2})), "bus", "revolute", {Eigen::Vector3d(0, 0, 1)});
  SystemSpec spec = system({bus, arm});
  DeviceSpec imu = device("imu", "imu", {}, {{"at", reads}});
  imu.rate = 10.0;
  DeviceSpec pusher = device("pusher", "pusher", {}, {{"at", pushes}});
  if (!pushes.empty()) pusher.inputs["force"] = {std::string("imu.force_x"), {}};
  if (pushes.empty()) pusher.mounts["at"] = {"bus", {}};
  spec.devices = {imu, pusher};
  try {
    compile(spec, own());
  } catch (const InputError& e) {
    return e.what();
  }
  return "it compiled";
}

TEST(PortsWithAFrame, AreConnectedWhereTheirAxesAreTheSame) {
  EXPECT_EQ(told("bus.hook", "bus.hook"), "it compiled");
  EXPECT_EQ(told("bus.hook", "bus.ring"), "it compiled");  // of one body, with the same orientation
  const std::string turned = told("bus.turned", "bus.hook"), other = told("bus.hook", "arm");
  EXPECT_NE(turned.find("error[C1002]"), std::string::npos) << turned;
  EXPECT_NE(turned.find("expected: an output in the axes of the node bus.hook\n  got:      imu.force_x in those of bus.turned"),
            std::string::npos)
      << turned;
  EXPECT_NE(other.find("got:      imu.force_x in those of bus.hook"), std::string::npos) << other;
}

TEST(PortsThatAreRequired, AreGivenInTheVehicle) {
  const std::string missing = told("bus.hook", "");
  EXPECT_NE(missing.find("error[C0105]"), std::string::npos) << missing;
  EXPECT_NE(missing.find("at: devices.pusher.inputs.force\n  expected: a number or a connection: along x, per kg"), std::string::npos)
      << missing;
}

/// A pendulum: its angle has the acceleration -m g l sin q / I at each tick.
SystemSpec pendulum(const std::string& type) {
  BodySpec bob = on(rigid("bob", 2.0, {0, -0.5, 0}, diagonal({0.1, 0.1, 0.1})), "", "revolute", {Eigen::Vector3d(0, 0, 1)});
  bob.hinge.q = {0.8};
  SystemSpec spec = system({bob}, uniform_gravity({0, -9.0, 0}));
  spec.devices = {device("feeler", type, {}, {{"at", "bob"}})};
  spec.devices[0].rate = 4.0;
  return spec;
}

TEST(HingeMounts, KnowTheirAccelerationAtTicks) {
  Simulation sim(compile(pendulum("feeler"), own()), accurate());
  const double I = 0.1 + 2.0 * 0.25;
  for (int k = 1; k < 5; ++k) {
    sim.run(0.25 * k);
    EXPECT_NEAR(sim.device_output(0), -2.0 * 9.0 * 0.5 * std::sin(sim.state().q[0]) / I, 1e-12) << k;
  }
}

TEST(Codes, AreExplainedInTheWordsOfTheDevice) {
  SystemSpec spec = pendulum("refusing_feeler");
  spec.bodies[0].hinge.q = {-0.8};
  Simulation sim(compile(spec, own()), accurate());
  try {
    sim.run(1.0);
    FAIL() << "it ran";
  } catch (const NumericsError& e) {
    EXPECT_NE(std::string(e.what()).find("device feeler (refusing_feeler): tick: faster than it can feel"), std::string::npos) << e.what();
  }
}

/// Sensors tick before controllers, inputs or not, actuators after them.
TEST(Roles, TellWhenADeviceTicks) {
  SystemSpec spec = pendulum("feeler");
  spec.devices = {device("a", "late_teller", {}, {}), device("b", "teller", {}, {})};
  for (DeviceSpec& d : spec.devices) d.rate = 10.0;
  Simulation sim(compile(spec, own()), accurate());
  sim.every({1, 10}, [] { Teller::told.push_back("controller"); });
  Teller::told.clear();
  sim.run(0.05);
  EXPECT_EQ(Teller::told, (std::vector<std::string>{"sensor", "controller", "actuator"}));
}

}  // namespace
}  // namespace cardan::test
