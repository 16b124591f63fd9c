// momentum_wheel: a rotor by its spin momentum alone. h = J (W + u w): of the rotor about its axis u, W its rate in its bearings, w that of
// the node. h' = T - b W, moment on the node -(h' u + w x h u). Exact for a balanced rotor whose mass and transverse inertia, but not J,
// are part of the body that carries it [Hughes 1986, Spacecraft Attitude Dynamics, gyrostats].

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct MomentumWheel {
  static constexpr const char* type = "momentum_wheel";
  static constexpr const char* summary =
      "a reaction wheel by its spin momentum alone: its axial inertia is not part of the body that carries it";
  static constexpr unsigned facts = CARDAN_FACT_ENERGY;
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  struct Packed {
    double axis[3], inertia, max_torque, max_rate, viscous;
  };
  static constexpr cardan_param_desc schema[] = {
      param::along(param::optional("axis", CARDAN_UNIT_VECTOR, "1", "of the spin, node axes"), 0, 0, 1),
      param::positive(param::required("inertia", CARDAN_NUMBER, "kg m^2", "of the rotor about its axis")),
      param::not_negative(param::optional("max_torque", CARDAN_NUMBER, "N m", "of the motor; commands beyond are cut. 0: any")),
      param::not_negative(
          param::optional("max_rate", CARDAN_NUMBER, "rad/s",
                          "up to which the motor drives it, over the last hundredth ever less; it brakes at any rate. 0: any")),
      param::not_negative(param::optional("viscous", CARDAN_NUMBER, "N m s/rad", "friction of its bearings"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY | CARDAN_USE_LOAD, "the node that carries it"}};
  static constexpr cardan_port_desc ports[] = {{"torque", CARDAN_PORT_IN, "N m", 0.0, 0, "of the motor on the rotor"},
                                               {"momentum", CARDAN_PORT_OUT, "N m s", 0.0, 0, "of the rotor about its axis"},
                                               {"rate", CARDAN_PORT_OUT, "rad/s", 0.0, 0, "of the rotor in its bearings"}};
  static constexpr cardan_state_desc states[] = {{"momentum", "N m s", 0.0, 1.0, "of the rotor about its axis, seen from outside"}};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d u = params.vector("axis");
    p = {{u[0], u[1], u[2]}, params.number("inertia"), params.number("max_torque"), params.number("max_rate"), params.number("viscous")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const Vec3<T> u{T(p.axis[0]), T(p.axis[1]), T(p.axis[2])};
    const T h = in.z[0], rate = h / T(p.inertia) - dot(u, in.at[0].omega);
    T motor = in.in[0];
    if (p.max_torque > 0.0) motor = motor > T(p.max_torque) ? T(p.max_torque) : motor < T(-p.max_torque) ? T(-p.max_torque) : motor;
    if (p.max_rate > 0.0 && motor * rate > T(0.0)) {
      const T left = T(100.0) - (rate > T(0.0) ? rate : T(-rate)) * T(100.0 / p.max_rate);
      motor = left > T(1.0) ? motor : left > T(0.0) ? T(left * motor) : T(0.0);
    }
    const T torque = motor - T(p.viscous) * rate;
    out.zdot[0] = torque;
    out.load[0].moment = -(torque * u + cross(in.at[0].omega, h * u));
    out.out[0] = h, out.out[1] = rate;
    out.delivered = motor * rate, out.lost = T(p.viscous) * rate * rate;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept { return 0.5 * in.z[0] * in.z[0] / p.inertia; }
  static void momentum(const Packed& p, const DeviceIn<double>& in, Vec3<double>* h) noexcept {
    h[0] = in.z[0] * Vec3<double>{p.axis[0], p.axis[1], p.axis[2]};
  }
};

}  // namespace
const cardan_device_family& momentum_wheel_family() { return device_table<MomentumWheel>(); }
}  // namespace cardan
