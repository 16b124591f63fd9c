// star_tracker: the attitude of a node relative to world axes, sampled. Its axes are those of the node, turned by a misalignment; noise is
// a small rotation about them, of one size across the boresight and of another about it. Blinded by the Sun, or turned too fast, it goes on
// with the last attitude that it had.
#include <numbers>

#include "core/abi/cardan_field.h"
#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

struct StarTracker {
  static constexpr const char* type = "star_tracker";
  static constexpr const char* summary = "attitude of a node relative to the world, sampled, with noise; the Sun blinds it";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    double boresight[3], misalignment[3], across, about, exclusion, most_rate;
  };
  static constexpr cardan_param_desc schema[] = {
      param::along(param::optional("boresight", CARDAN_UNIT_VECTOR, "1", "along which it looks, node axes"), 0.0, 0.0, 1.0),
      param::not_negative(param::optional("cross_noise", CARDAN_NUMBER, "rad", "standard deviation about each axis across the boresight")),
      param::not_negative(param::optional("roll_noise", CARDAN_NUMBER, "rad", "standard deviation about the boresight")),
      param::optional("misalignment", CARDAN_VECTOR, "rad", "rotation vector from the node to the axes that it measures"),
      param::in_range(
          param::optional("exclusion", CARDAN_NUMBER, "rad", "half-angle about the boresight in which the Sun blinds it; 0: none"), 0.0,
          std::numbers::pi),
      param::not_negative(param::optional("rate_limit", CARDAN_NUMBER, "rad/s", "beyond which it finds no stars; 0: any"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_POSE | CARDAN_USE_VELOCITY, "the node whose attitude it tells"},
      {"light", CARDAN_MOUNT_FIELD, std::uint32_t{CARDAN_LIGHT} | std::uint32_t{CARDAN_USE_OPTIONAL},
       "a field of light, of the Sun that blinds it; without, none does"}};
  static constexpr cardan_port_desc ports[] = {
      {"attitude_1", CARDAN_PORT_OUT, "1", 0.0, 0, "w of the quaternion from node to world axes, as read", nullptr, 0, "valid"},
      {"attitude_2", CARDAN_PORT_OUT, "1", 0.0, 0, "x of it", nullptr, 0, "valid"},
      {"attitude_3", CARDAN_PORT_OUT, "1", 0.0, 0, "y of it", nullptr, 0, "valid"},
      {"attitude_4", CARDAN_PORT_OUT, "1", 0.0, 0, "z of it", nullptr, 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it is of the last sample; 0: of the last that was not blinded or too fast"}};
  static constexpr cardan_state_desc marks[] = {{"attitude_1", "1", 1.0, 1.0, "held since the last good sample"},
                                                {"attitude_2", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"attitude_3", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"attitude_4", "1", 0.0, 1.0, "held since the last good sample"},
                                                {"valid", "1", 0.0, 1.0, "of the last sample"}};
  static constexpr std::uint32_t n_noise = 3;

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* key) { return params.number(key); };
    const Eigen::Vector3d u = params.vector("boresight"), e = params.vector("misalignment");
    p = {{u[0], u[1], u[2]}, {e[0], e[1], e[2]}, n("cross_noise"), n("roll_noise"), n("exclusion"), n("rate_limit")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<5>(in, out);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double, const double* noise, double*, double* d) noexcept {
    const MountMotion<double>& at = in.at[0];
    const Eigen::Vector3d boresight = as_vector(p.boresight);
    const Eigen::Quaterniond axes = turned(as_vector(p.misalignment));
    const Eigen::Vector3d light = axes.conjugate() * as_vector(in.at[1].field);
    const bool blinded = !light.isZero(0.0) && angle_between(boresight, -light) < p.exclusion;
    const bool fast = p.most_rate > 0.0 && dot(at.omega, at.omega) > p.most_rate * p.most_rate;
    d[4] = blinded || fast ? 0.0 : 1.0;
    if (d[4] == 0.0) return;
    Eigen::Matrix3d R;
    R << at.R_WN.xx, at.R_WN.xy, at.R_WN.xz, at.R_WN.yx, at.R_WN.yy, at.R_WN.yz, at.R_WN.zx, at.R_WN.zy, at.R_WN.zz;
    const Eigen::Quaterniond q = (Eigen::Quaterniond(R) * axes * turned(scatter(noise, boresight, p.across, p.about))).normalized();
    // Of q and -q the one nearer to what it gave before; first the one with w >= 0.
    const double sign = q.w() * d[0] + q.x() * d[1] + q.y() * d[2] + q.z() * d[3] < 0.0 ? -1.0 : 1.0;
    d[0] = sign * q.w(), d[1] = sign * q.x(), d[2] = sign * q.y(), d[3] = sign * q.z();
  }
};

}  // namespace
const cardan_device_family& star_tracker_family() { return device_table<StarTracker>(); }
}  // namespace cardan
