// magnetometer: three axes at a node in a magnetic field, sampled, in node axes.
#include "core/abi/cardan_field.h"
#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

struct Magnetometer {
  static constexpr const char* type = "magnetometer";
  static constexpr const char* summary = "magnetic field at a node, sampled, with noise";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    double bias[3], scale[3], noise, step, range;
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("bias", CARDAN_VECTOR, "T", "of the three axes"),
      param::along(param::optional("scale", CARDAN_VECTOR, "1", "factors of the three axes"), 1.0, 1.0, 1.0),
      param::not_negative(param::optional("noise", CARDAN_NUMBER, "T", "standard deviation of a sample of each axis")),
      param::not_negative(param::optional("step", CARDAN_NUMBER, "T", "of its converter; 0: none")),
      param::not_negative(param::optional("range", CARDAN_NUMBER, "T", "beyond which an axis reads its end; 0: any"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE, "the node where it sits; it reads in node axes"},
      {"field", CARDAN_MOUNT_FIELD, CARDAN_MAGNETIC, "a magnetic field"}};
  static constexpr cardan_port_desc ports[] = {
      {"field_x", CARDAN_PORT_OUT, "T", 0.0, 0, "flux density as read", "at", 0, "valid"},
      {"field_y", CARDAN_PORT_OUT, "T", 0.0, 0, "flux density as read", "at", 0, "valid"},
      {"field_z", CARDAN_PORT_OUT, "T", 0.0, 0, "flux density as read", "at", 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it has sampled, and nothing was beyond its range"}};
  static constexpr cardan_state_desc marks[] = {{"field_x", "T", 0.0, 1.0, "held since the last sample"},
                                                {"field_y", "T", 0.0, 1.0, "held since the last sample"},
                                                {"field_z", "T", 0.0, 1.0, "held since the last sample"},
                                                {"valid", "1", 0.0, 1.0, "of the last sample"}};
  static constexpr std::uint32_t n_noise = 3;

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* key) { return params.number(key); };
    const Eigen::Vector3d b = params.vector("bias"), s = params.vector("scale");
    p = {{b[0], b[1], b[2]}, {s[0], s[1], s[2]}, n("noise"), n("step"), n("range")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<4>(in, out);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double, const double* noise, double*, double* d) noexcept {
    d[3] = 1.0;
    for (int i = 0; i < 3; ++i) {
      const double read = to_steps(p.scale[i] * in.at[1].field[i] + p.bias[i] + p.noise * noise[i], p.step);
      d[i] = to_range(read, p.range);
      if (d[i] != read) d[3] = 0.0;
    }
  }
};

}  // namespace
const cardan_device_family& magnetometer_family() { return device_table<Magnetometer>(); }
}  // namespace cardan
