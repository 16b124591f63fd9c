// horizon_sensor: the direction to the centre of a planet from its horizon, sampled, in node axes; the Sun blinds it.
#include <numbers>

#include "core/abi/cardan_field.h"
#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

struct HorizonSensor {
  static constexpr const char* type = "horizon_sensor";
  static constexpr const char* summary = "direction to the centre of a planet, sampled, with noise; the Sun blinds it";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    double boresight[3], misalignment[3], centre[3], half_angle, noise, exclusion, farthest;
  };
  static constexpr cardan_param_desc schema[] = {
      param::along(param::optional("boresight", CARDAN_UNIT_VECTOR, "1", "middle of its field of view, node axes"), 0.0, 0.0, 1.0),
      param::in_range(
          param::required("half_angle", CARDAN_NUMBER, "rad", "from the boresight, within which the centre of the planet must be"), 0.0,
          std::numbers::pi, CARDAN_ABOVE),
      param::not_negative(param::optional("noise", CARDAN_NUMBER, "rad", "standard deviation about each axis across the direction")),
      param::optional("misalignment", CARDAN_VECTOR, "rad", "rotation vector from the node to the axes that it measures in"),
      param::in_range(
          param::optional("exclusion", CARDAN_NUMBER, "rad", "half-angle about the boresight in which the Sun blinds it; 0: none"), 0.0,
          std::numbers::pi),
      param::not_negative(param::optional("max_distance", CARDAN_NUMBER, "m", "from the centre, beyond which it finds no horizon; 0: any")),
      param::optional("centre", CARDAN_VECTOR, "m", "of the planet, world axes")};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE, "the node where it sits; it reads in node axes"},
      {"light", CARDAN_MOUNT_FIELD, std::uint32_t{CARDAN_LIGHT} | std::uint32_t{CARDAN_USE_OPTIONAL},
       "a field of light, of the Sun that blinds it; without, none does"}};
  static constexpr cardan_port_desc ports[] = {
      {"nadir_x", CARDAN_PORT_OUT, "1", 0.0, 0, "unit vector to the centre of the planet as read", "at", 0, "valid"},
      {"nadir_y", CARDAN_PORT_OUT, "1", 0.0, 0, "unit vector to the centre of the planet as read", "at", 0, "valid"},
      {"nadir_z", CARDAN_PORT_OUT, "1", 0.0, 0, "unit vector to the centre of the planet as read", "at", 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it is of the last sample; 0: of the last one that saw the horizon"}};
  static constexpr cardan_state_desc marks[] = {{"nadir_x", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"nadir_y", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"nadir_z", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"valid", "1", 0.0, 1.0, "of the last sample"}};
  static constexpr std::uint32_t n_noise = 3;

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* key) { return params.number(key); };
    const Eigen::Vector3d u = params.vector("boresight"), e = params.vector("misalignment"), c = params.vector("centre");
    p = {{u[0], u[1], u[2]}, {e[0], e[1], e[2]}, {c[0], c[1], c[2]}, n("half_angle"), n("noise"), n("exclusion"), n("max_distance")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<4>(in, out);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double, const double* noise, double*, double* d) noexcept {
    const MountMotion<double>& at = in.at[0];
    const Vec3<double> way = transpose_times(at.R_WN, Vec3<double>{p.centre[0], p.centre[1], p.centre[2]} - at.position);
    const Eigen::Quaterniond axes = turned(as_vector(p.misalignment));
    const Eigen::Vector3d boresight = as_vector(p.boresight), to = axes.conjugate() * Eigen::Vector3d(way.x, way.y, way.z),
                          light = axes.conjugate() * as_vector(in.at[1].field);
    const double distance = to.norm();
    const bool blinded = !light.isZero(0.0) && angle_between(boresight, -light) < p.exclusion;
    const bool seen = distance > 0.0 && !(p.farthest > 0.0 && distance > p.farthest) && angle_between(boresight, to) <= p.half_angle;
    d[3] = seen && !blinded ? 1.0 : 0.0;
    if (d[3] == 0.0) return;
    const Eigen::Vector3d nadir = to / distance, read = (turned(scatter(noise, nadir, p.noise, 0.0)) * nadir).normalized();
    for (int i = 0; i < 3; ++i) d[i] = read[i];
  }
};

}  // namespace
const cardan_device_family& horizon_sensor_family() { return device_table<HorizonSensor>(); }
}  // namespace cardan
