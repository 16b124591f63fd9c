// dc_motor: a motor with brushes on a hinge component, behind a gear: L i' = U - R i - K n w, torque n K i. Without current it turns
// freely; shorted (U = 0) it brakes.

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct DcMotor {
  static constexpr const char* type = "dc_motor";
  static constexpr const char* summary = "a motor with brushes and a gear on a component of a hinge, driven by a voltage";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY;
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  struct Packed {
    double constant, resistance, inductance, gear;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("constant", CARDAN_NUMBER, "N m/A", "torque over current, and voltage over rate")),
      param::positive(param::required("resistance", CARDAN_NUMBER, "ohm", "of the winding")),
      param::positive(param::required("inductance", CARDAN_NUMBER, "H", "of the winding")),
      param::positive(param::optional("gear", CARDAN_NUMBER, "1", "turns of the motor for one of the hinge", 1.0))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_TURN, "a component of a hinge that turns"}};
  static constexpr cardan_port_desc ports[] = {{"voltage", CARDAN_PORT_IN, "V", 0.0, 0, "at its terminals"},
                                               {"torque", CARDAN_PORT_OUT, "N m", 0.0, 0, "on the hinge"}};
  static constexpr cardan_state_desc states[] = {{"current", "A", 0.0, 1.0, "in the winding"}};

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("constant"), params.number("resistance"), params.number("inductance"), params.number("gear")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const T i = in.z[0], k = T(p.gear * p.constant);
    out.zdot[0] = (in.in[0] - T(p.resistance) * i - k * in.at[0].v) / T(p.inductance);
    out.load[0].tau = k * i;
    out.out[0] = k * i;
    out.delivered = in.in[0] * i, out.lost = T(p.resistance) * i * i;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept { return 0.5 * p.inductance * in.z[0] * in.z[0]; }
};

}  // namespace
const cardan_device_family& dc_motor_family() { return device_table<DcMotor>(); }
}  // namespace cardan
