#pragma once
// A vehicle in orbit with a device of every kind on its hub, on a boom on a hinge and at the tip of a flexible panel: noise, ticks at
// several rates, connections that sum and that wait, propellant, fields, commands that grow silent.
#include "core/abi/device_family.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/modal_samples.hpp"

namespace cardan::test {

/// What stands between sensors and actuators: moment against a rate, duty with it.
struct RateLaw {
  static constexpr const char *type = "rate_law", *summary = "a moment against a rate";
  static constexpr unsigned facts = 0;
  struct Packed {};
  static constexpr cardan_port_desc ports[] = {{"rate", CARDAN_PORT_IN, "rad/s", 0.01, 0, "measured"},
                                               {"moment", CARDAN_PORT_OUT, "A m^2", 0.0, 0, "against it"},
                                               {"duty", CARDAN_PORT_OUT, "1", 0.0, 0, "part of a period"}};
  static constexpr cardan_state_desc marks[] = {{"rate", "rad/s", 0.0, 1.0, "as it was taken"}, {"sum", "rad", 0.0, 1.0, "of all"}};
  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    out.out[0] = T(-900.0 * in.d[0] - 3.0 * in.d[1]), out.out[1] = T(0.3 + 5.0 * in.d[0]);
  }
  static void tick(const Packed&, const DeviceIn<double>& in, double period, const double*, double*, double* d) noexcept {
    d[0] = in.in[0], d[1] += period * in.in[0];
  }
};

inline SystemSpec equipped_vehicle() {
  BodySpec bus = on(rigid("bus", 500.0, {0.02, 0, 0}, diagonal({200, 220, 180})), "", "free");
  bus.hinge.q = {1, 0, 0, 0, 7e6, 0, 0}, bus.hinge.v = {0.01, -0.02, 0.005, 0, 7546, 0};
  NodeSpec hook, wheel_x;
  hook.name = "hook", hook.position = {0.5, 0.5, 0};
  wheel_x.name = "wheel_x", wheel_x.position = {0.3, 0, 0};
  bus.nodes = {hook, wheel_x};
  BodySpec boom = on(rigid("boom", 20.0, {1, 0, 0}, diagonal({0.5, 7, 7})), "bus", "revolute", {{0, 0, 1}}, {0.5, 0, 0});
  NodeSpec tip;
  tip.name = "tip", tip.position = {2, 0, 0};
  boom.nodes = {tip}, boom.hinge.q = {0.35};
  BodySpec slider = on(particle("slider", 2.0, {0, 0, 0}), "bus", "prismatic", {{0, 1, 0}});
  BodySpec panel = on(BodySpec(), "bus", "revolute", {{0, 1, 0}}, {0, 0.4, 0});
  panel.name = "panel", panel.type = "modal_flexible", panel.modal = std::make_shared<const ModalData>(lumped());
  panel.hinge.v = {0.2};
  SystemSpec spec = system({bus, boom, slider, panel});
  spec.fields = {
      {"earth", "dipole", {}, false, {}}, {"air", "exponential_atmosphere", {}, true, {}}, {"pull", "point_mass", {}, false, {}}};
  spec.fields[1].params = {{"density", number(2e-12)}, {"lowest", number(1e5)}};
  spec.fields[2].params = {{"mu", number(3.986004415e14)}};
  spec.gravity.kind = GravitySpec::Kind::field, spec.gravity.fields = {"pull"};

  const auto add = [&](DeviceSpec d, const std::vector<std::pair<std::string, std::string>>& from = {}) -> DeviceSpec& {
    for (const auto& [input, source] : from) d.inputs[input] = {source, {}};
    spec.devices.push_back(std::move(d));
    return spec.devices.back();
  };
  const auto sampled = [&](DeviceSpec& d, double rate, double offset = 0.0) { d.rate = rate, d.offset = offset; };
  sampled(add(device("imu", "imu", {{"angle_random_walk", 1e-5}, {"gyro_wander", 5e-6}, {"gyro_step", 1e-6}}, {{"at", "bus.hook"}})), 100.0,
          0.007);
  sampled(add(device("counts", "integrating_imu", {{"gyro_step", 1e-6}, {"accelerometer_step", 1e-3}, {"angle_random_walk", 1e-5}},
                     {{"at", "panel.tip"}})),
          50.0);
  DeviceSpec& law = add(device("law", "rate_law", {}, {}), {{"rate", "imu.rate_z"}});
  sampled(law, 10.0);
  law.inputs["rate"].latency = 0.2;
  DeviceSpec& rods = add(device("rods", "magnetorquer", {{"max_moment", 30.0}}, {{"at", "panel.tip"}}), {{"moment_x", "law.moment"}});
  rods.inputs["moment_x"].delay = 1;
  rods.inputs["moment_y"] = {5.0, {}};
  rods.inputs["moment_y"].safe = 0.0, rods.inputs["moment_y"].timeout = 0.35;
  sampled(add(device("valve", "pulse_modulator", {{"minimum", 0.02}}, {}), {{"command", "law.duty"}}), 10.0);
  const auto thruster = [&](const std::string& name, double thrust, double rise, const std::string& node, const Eigen::Vector3d& u,
                            const std::string& command) -> DeviceSpec& {
    const DeviceSpec d =
        device(name, "thruster", {{"thrust", thrust}, {"specific_impulse", 60}, {"rise_time", rise}, {"fall_time", rise}}, {{"at", node}});
    return add(with_vector(d, "direction", u), {{"command", command}, {"supply", "tank.supply"}});
  };
  thruster("jet", 4.5, 0.02, "bus", {0, 0, 1}, "valve.open");
  thruster("puff", 0.7, 0.0, "boom.tip", {0, 1, 0}, "valve.open");
  thruster("drip", 0.1, 0.05, "panel.tip", {1, 0, 0}, "law.duty").inputs["command"].delay = 2;
  DeviceSpec& tank =
      add(device("tank", "tank", {{"radius", 0.4}, {"density", 1000}, {"residual", 1}, {"pressure", 20}, {"loaded", 100}}, {{"at", "bus"}}),
          {{"flow", "jet.flow + puff.flow + drip.flow"}});
  tank.params["fill"].value = std::string("settled");
  tank.initial["propellant"] = number(100.0);
  const auto motor = [&](const std::string& name, double voltage) -> DeviceSpec& {
    DeviceSpec& d = add(device(name, "dc_motor", {{"constant", 0.05}, {"resistance", 1.5}, {"inductance", 0.1}}, {{"at", "boom.rate"}}));
    d.inputs["voltage"] = {voltage, {}};
    return d;
  };
  motor("motor", 2.0).initial["current"] = number(0.1);
  motor("late", 1.0);
  add(device("blade", "tape_spring", {{"peak_moment", 4}, {"peak_angle", 0.05}, {"steady_moment", 0.3}, {"rest", 0.17}},
             {{"at", "boom.angle"}}));
  add(device("lift", "momentum_wheel", {{"inertia", 0.05}}, {{"at", "panel.tip"}}),
      {{"torque", "motor.torque + blade.moment + late.torque"}});
  DeviceSpec& wheel = add(device("wheel", "momentum_wheel", {{"inertia", 0.05}, {"max_torque", 0.2}}, {{"at", "bus.wheel_x"}}),
                          {{"torque", "motor.torque"}});
  wheel.initial["momentum"] = number(1.0);
  add(device("stay", "spring_damper", {{"stiffness", 50}, {"damping", 5}, {"rest", 1.2}}, {{"from", "bus.hook"}, {"to", "boom.tip"}}));
  add(device("bearing", "lugre_friction",
             {{"coulomb", 0.2},
              {"breakaway", 0.3},
              {"stiffness", 20},
              {"damping", 2},
              {"viscous", 0.1},
              {"stribeck_rate", 0.01},
              {"fading_rate", 1}},
             {{"at", "panel"}}));
  add(device("brake", "dry_friction", {{"coulomb", 0.002}, {"breakaway", 0.004}, {"viscous", 0.01}}, {{"at", "slider"}}));
  add(device("catch", "latch", {{"place", 0.5}, {"max_rate", 1.0}, {"stiffness", 100}, {"damping", 1}}, {{"at", "boom"}}));
  add(device("drag", "drag", {{"area", 3}}, {{"at", "bus.hook"}}));
  sampled(add(device("bits", "pulsed_thruster", {{"bit", 0.01}, {"scatter", 0.1}}, {{"at", "panel.tip"}}), {{"fire", "law.duty"}}), 5.0);
  return spec;
}

inline std::shared_ptr<const Model> equipped(const SystemSpec& spec = equipped_vehicle()) {
  static const Registry types = [] {
    Registry all = registry();
    all.devices.add(device_table<RateLaw>());
    return all;
  }();
  return compile(spec, types);
}

}  // namespace cardan::test
