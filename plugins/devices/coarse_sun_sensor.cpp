// coarse_sun_sensor: a photocell, sampled: its signal goes with the light that falls on it, 1 where the Sun of 1 au stands over it.
#include <numbers>

#include "core/abi/cardan_field.h"
#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

struct CoarseSunSensor {
  static constexpr const char* type = "coarse_sun_sensor";
  static constexpr const char* summary = "a photocell at a node, sampled: the cosine of the angle to the Sun, with noise";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  static constexpr double kSun = 1361.0;  // [W/m^2] at 1 au
  struct Packed {
    double normal[3], half_angle, scale, noise;
  };
  static constexpr cardan_param_desc schema[] = {
      param::along(param::optional("normal", CARDAN_UNIT_VECTOR, "1", "of the cell, node axes"), 0.0, 0.0, 1.0),
      param::in_range(
          param::optional("half_angle", CARDAN_NUMBER, "rad", "from the normal, beyond which it sees no light", 0.5 * std::numbers::pi),
          0.0, 0.5 * std::numbers::pi, CARDAN_ABOVE),
      param::positive(param::optional("scale", CARDAN_NUMBER, "1", "its signal under the Sun of 1361 W/m^2", 1.0)),
      param::not_negative(param::optional("noise", CARDAN_NUMBER, "1", "standard deviation of a sample, before it is cut at 0"))};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE, "the node where the cell is"},
                                                 {"light", CARDAN_MOUNT_FIELD, CARDAN_LIGHT, "a field of light"}};
  static constexpr cardan_port_desc ports[] = {{"signal", CARDAN_PORT_OUT, "1", 0.0, 0, "as read, never below 0"}};
  static constexpr cardan_state_desc marks[] = {{"signal", "1", 0.0, 1.0, "held since the last sample"}};
  static constexpr std::uint32_t n_noise = 1;

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d u = params.vector("normal");
    p = {{u[0], u[1], u[2]}, params.number("half_angle"), params.number("scale"), params.number("noise")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<1>(in, out);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double, const double* noise, double*, double* d) noexcept {
    const Eigen::Vector3d normal = as_vector(p.normal), light = as_vector(in.at[1].field);
    const bool seen = angle_between(normal, -light) <= p.half_angle;
    d[0] = std::fmax(0.0, (seen ? -p.scale / kSun * light.dot(normal) : 0.0) + p.noise * noise[0]);
  }
};

}  // namespace
const cardan_device_family& coarse_sun_sensor_family() { return device_table<CoarseSunSensor>(); }
}  // namespace cardan
