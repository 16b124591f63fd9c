// thruster: a force along a direction of its node, c times its thrust for a command c, that rises and falls with time constants, times what
// the tank supplies. Flow F / (I g_0), g_0 = 9.80665 m/s^2: drawn from the tank that takes it, else told and not taken from any mass.

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct Thruster {
  static constexpr const char* type = "thruster";
  static constexpr const char* summary = "a force at a node that rises and falls with its valve; its flow is drawn from a tank, or told";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  struct Packed {
    double thrust, impulse, direction[3], rise, fall;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("thrust", CARDAN_NUMBER, "N", "when it is fully open")),
      param::positive(param::required("specific_impulse", CARDAN_NUMBER, "s", "thrust over the weight of the flow")),
      param::required("direction", CARDAN_UNIT_VECTOR, "1", "of the force on the vehicle, node axes"),
      param::not_negative(param::optional("rise_time", CARDAN_NUMBER, "s", "time constant of opening; both 0: at once")),
      param::not_negative(param::optional("fall_time", CARDAN_NUMBER, "s", "time constant of closing"))};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_LOAD | CARDAN_USE_OUTLET, "the node of the nozzle"}};
  static constexpr cardan_port_desc ports[] = {{"command", CARDAN_PORT_IN, "1", 0.0, 0, "0 closed, 1 open; cut to that range"},
                                               {"supply", CARDAN_PORT_IN, "1", 1.0, 0, "of a tank: pressure over that of the thrust"},
                                               {"thrust", CARDAN_PORT_OUT, "N", 0.0, 3, "force"},
                                               {"flow", CARDAN_PORT_OUT, "kg/s", 0.0, 3, "of propellant"}};
  static constexpr cardan_state_desc states[] = {{"level", "1", 0.0, 1.0, "how far it is open; as at the start where it opens at once"},
                                                 {"propellant", "kg", 0.0, 1.0, "used so far"}};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d u = params.vector("direction");
    p = {params.number("thrust"),
         params.number("specific_impulse"),
         {u[0], u[1], u[2]},
         params.number("rise_time"),
         params.number("fall_time")};
    if ((p.rise > 0.0) != (p.fall > 0.0)) return params.fail(p.rise > 0.0 ? "fall_time" : "rise_time", "a time > 0, as the other one is");
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const T command = in.in[0] > T(1.0) ? T(1.0) : in.in[0] < T(0.0) ? T(0.0) : in.in[0];
    const double time = command > in.z[0] ? p.rise : p.fall;
    const T level = time > 0.0 ? in.z[0] : command, force = T(p.thrust) * level * in.in[1], flow = force / T(p.impulse * 9.80665);
    out.zdot[0] = time > 0.0 ? (command - in.z[0]) / T(time) : T(0.0);
    out.zdot[1] = flow;
    out.load[0].force = {force * T(p.direction[0]), force * T(p.direction[1]), force * T(p.direction[2])};
    out.out[0] = force, out.out[1] = flow;
  }
};

}  // namespace
const cardan_device_family& thruster_family() { return device_table<Thruster>(); }
}  // namespace cardan
