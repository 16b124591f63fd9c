// integrating_imu: three rate-integrating gyros and three integrating accelerometers at a node: what each has added up since the sample
// before, in the axes of the node as they turn: delta-theta, the integral of omega, and delta-v, that of the specific force. Coning and
// sculling are left in them, as they are in such instruments [Savage 1998]. Truth is integrated with the motion, so that it has its
// tolerance at any rate of sampling.
#include "plugins/devices/inertial_sensor.hpp"

namespace cardan {
namespace {

constexpr const char *kOmega = "integral of the angular velocity", *kForce = "integral of the specific force",
                     *kHeld = "held since the last sample", *kLeft = "less than a count, for the next",
                     *kLast = "true integral at the last sample", *kWanders = "that has wandered";
constexpr cardan_port_desc count(const char* name, const char* unit, const char* meaning) {
  return {name, CARDAN_PORT_OUT, unit, 0.0, 0, meaning, "at"};
}
constexpr cardan_state_desc angle(const char* name, const char* meaning) { return {name, "rad", 0.0, 1.0, meaning}; }
constexpr cardan_state_desc speed(const char* name, const char* meaning) { return {name, "m/s", 0.0, 1.0, meaning}; }
constexpr cardan_state_desc rate_bias(const char* name) { return {name, "rad/s", 0.0, 1.0, kWanders}; }
constexpr cardan_state_desc force_bias(const char* name) { return {name, "m/s^2", 0.0, 1.0, kWanders}; }

struct IntegratingImu {
  static constexpr const char* type = "integrating_imu";
  static constexpr const char* summary = "integrating gyros and accelerometers at a node: delta-theta and delta-v, with noise";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    InertialSensor gyro, accelerometer;
  };
  static constexpr auto schema =
      InertialSensor::schema("rad", "m/s", "of one count, what is left is kept; 0: none", "beyond which they count no faster; 0: any");
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY | CARDAN_USE_ACCELERATION, "the node where it sits; it counts in node axes"}};
  static constexpr cardan_port_desc ports[] = {count("angle_x", "rad", kOmega),    count("angle_y", "rad", kOmega),
                                               count("angle_z", "rad", kOmega),    count("velocity_x", "m/s", kForce),
                                               count("velocity_y", "m/s", kForce), count("velocity_z", "m/s", kForce)};
  static constexpr cardan_state_desc states[] = {angle("angle_x", kOmega),    angle("angle_y", kOmega),    angle("angle_z", kOmega),
                                                 speed("velocity_x", kForce), speed("velocity_y", kForce), speed("velocity_z", kForce)};
  // Six each: what it gives, what was left over of a count, the true integral at the last sample, the bias that has wandered.
  static constexpr int kGiven = 0, kRest = 6, kBefore = 12, kBias = 18, kSamples = 24;
  static constexpr cardan_state_desc marks[] = {angle("angle_x", kHeld),
                                                angle("angle_y", kHeld),
                                                angle("angle_z", kHeld),
                                                speed("velocity_x", kHeld),
                                                speed("velocity_y", kHeld),
                                                speed("velocity_z", kHeld),
                                                angle("angle_rest_x", kLeft),
                                                angle("angle_rest_y", kLeft),
                                                angle("angle_rest_z", kLeft),
                                                speed("velocity_rest_x", kLeft),
                                                speed("velocity_rest_y", kLeft),
                                                speed("velocity_rest_z", kLeft),
                                                angle("angle_before_x", kLast),
                                                angle("angle_before_y", kLast),
                                                angle("angle_before_z", kLast),
                                                speed("velocity_before_x", kLast),
                                                speed("velocity_before_y", kLast),
                                                speed("velocity_before_z", kLast),
                                                rate_bias("gyro_bias_x"),
                                                rate_bias("gyro_bias_y"),
                                                rate_bias("gyro_bias_z"),
                                                force_bias("force_bias_x"),
                                                force_bias("force_bias_y"),
                                                force_bias("force_bias_z"),
                                                {"samples", "1", 0.0, 1.0, "taken so far"}};
  static constexpr std::uint32_t n_noise = 12;

  static bool pack(const Params& params, Packed& p) {
    p = {InertialSensor::gyro(params), InertialSensor::accelerometer(params)};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<6>(in, out);
  }

  template <class T>
  static void follow(const Packed&, const DeviceIn<T>& in, T* zdot) noexcept {
    const MountMotion<T>& at = in.at[0];
    const Vec3<T>&w = at.omega, &f = at.specific_force;
    zdot[0] = w.x, zdot[1] = w.y, zdot[2] = w.z, zdot[3] = f.x, zdot[4] = f.y, zdot[5] = f.z;
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double period, const double* noise, double*, double* d) noexcept {
    const bool first = d[kSamples] == 0.0;
    double grown[6];
    for (int i = 0; i < 6; ++i) grown[i] = in.z[i] - d[kBefore + i];
    for (int i = 0; i < 6; ++i) {
      const InertialSensor& s = i < 3 ? p.gyro : p.accelerometer;
      d[kBias + i] = s.wandered(d[kBias + i], period, first, noise[6 + i]);
      const int axis = i % 3;
      const double seen = s.component(axis, grown + i - axis);
      const double counted = seen + (s.bias[axis] + d[kBias + i]) * period + s.noise * std::sqrt(period) * noise[i];
      const double x = first ? 0.0 : d[kRest + i] + to_range(counted, s.range * period);
      d[kGiven + i] = to_steps(x, s.step);
      d[kRest + i] = x - d[kGiven + i];
      d[kBefore + i] = in.z[i];
    }
    d[kSamples] += 1.0;
  }
};

}  // namespace
const cardan_device_family& integrating_imu_family() { return device_table<IntegratingImu>(); }
}  // namespace cardan
