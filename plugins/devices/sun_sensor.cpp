// sun_sensor: the direction to the Sun in its axes, those of the node turned by a misalignment, sampled. In shadow, or with the Sun out of
// view, it goes on with the last direction that it had.
#include <numbers>

#include "core/abi/cardan_field.h"
#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

struct SunSensor {
  static constexpr const char* type = "sun_sensor";
  static constexpr const char* summary = "direction to the Sun from a node, sampled, with noise";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    double boresight[3], misalignment[3], half_angle, noise, threshold;
  };
  static constexpr cardan_param_desc schema[] = {
      param::along(param::optional("boresight", CARDAN_UNIT_VECTOR, "1", "middle of its field of view, node axes"), 0.0, 0.0, 1.0),
      param::in_range(param::required("half_angle", CARDAN_NUMBER, "rad", "of its field of view, from the boresight to the edge"), 0.0,
                      std::numbers::pi, CARDAN_ABOVE),
      param::not_negative(param::optional("noise", CARDAN_NUMBER, "rad", "standard deviation about each axis across the direction")),
      param::optional("misalignment", CARDAN_VECTOR, "rad", "rotation vector from the node to the axes that it measures in"),
      param::not_negative(param::optional("threshold", CARDAN_NUMBER, "W/m^2", "irradiance up to which it sees no Sun"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE, "the node where it sits; it reads in node axes"},
      {"light", CARDAN_MOUNT_FIELD, CARDAN_LIGHT, "a field of light, that of the Sun"}};
  static constexpr cardan_port_desc ports[] = {
      {"direction_x", CARDAN_PORT_OUT, "1", 0.0, 0, "unit vector to the Sun as read", "at", 0, "valid"},
      {"direction_y", CARDAN_PORT_OUT, "1", 0.0, 0, "unit vector to the Sun as read", "at", 0, "valid"},
      {"direction_z", CARDAN_PORT_OUT, "1", 0.0, 0, "unit vector to the Sun as read", "at", 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it is of the last sample; 0: of the last that saw the Sun"}};
  static constexpr cardan_state_desc marks[] = {{"direction_x", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"direction_y", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"direction_z", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"valid", "1", 0.0, 1.0, "of the last sample"}};
  static constexpr std::uint32_t n_noise = 3;

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* key) { return params.number(key); };
    const Eigen::Vector3d u = params.vector("boresight"), e = params.vector("misalignment");
    p = {{u[0], u[1], u[2]}, {e[0], e[1], e[2]}, n("half_angle"), n("noise"), n("threshold")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<4>(in, out);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double, const double* noise, double*, double* d) noexcept {
    const Eigen::Vector3d light = turned(as_vector(p.misalignment)).conjugate() * as_vector(in.at[1].field);
    d[3] = light.norm() > p.threshold && angle_between(as_vector(p.boresight), -light) <= p.half_angle ? 1.0 : 0.0;
    if (d[3] == 0.0) return;
    const Eigen::Vector3d sun = -light.normalized(), read = (turned(scatter(noise, sun, p.noise, 0.0)) * sun).normalized();
    for (int i = 0; i < 3; ++i) d[i] = read[i];
  }
};

}  // namespace
const cardan_device_family& sun_sensor_family() { return device_table<SunSensor>(); }
}  // namespace cardan
