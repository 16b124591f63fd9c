// imu: three gyros and three accelerometers at a node, sampled: what they read at that instant, in node axes. The deviation of a sample is
// N / sqrt(period).
#include "plugins/devices/inertial_sensor.hpp"

namespace cardan {
namespace {

struct Imu {
  static constexpr const char* type = "imu";
  static constexpr const char* summary = "gyros and accelerometers at a node, sampled, with noise";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    InertialSensor gyro, accelerometer;
  };
  static constexpr auto schema =
      InertialSensor::schema("rad/s", "m/s^2", "of their converter; 0: none", "beyond which they read its end; 0: any");
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_NODE, CARDAN_USE_VELOCITY | CARDAN_USE_ACCELERATION, "the node where it sits; it reads in node axes"}};
  static constexpr cardan_port_desc ports[] = {
      {"rate_x", CARDAN_PORT_OUT, "rad/s", 0.0, 0, "angular velocity as read", "at", 0, "valid"},
      {"rate_y", CARDAN_PORT_OUT, "rad/s", 0.0, 0, "angular velocity as read", "at", 0, "valid"},
      {"rate_z", CARDAN_PORT_OUT, "rad/s", 0.0, 0, "angular velocity as read", "at", 0, "valid"},
      {"force_x", CARDAN_PORT_OUT, "m/s^2", 0.0, 0, "specific force as read: acceleration less gravity", "at", 0, "valid"},
      {"force_y", CARDAN_PORT_OUT, "m/s^2", 0.0, 0, "specific force as read: acceleration less gravity", "at", 0, "valid"},
      {"force_z", CARDAN_PORT_OUT, "m/s^2", 0.0, 0, "specific force as read: acceleration less gravity", "at", 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it has sampled, and nothing was beyond its range"}};
  static constexpr cardan_state_desc marks[] = {{"rate_x", "rad/s", 0.0, 1.0, "held since the last sample"},
                                                {"rate_y", "rad/s", 0.0, 1.0, "held since the last sample"},
                                                {"rate_z", "rad/s", 0.0, 1.0, "held since the last sample"},
                                                {"force_x", "m/s^2", 0.0, 1.0, "held since the last sample"},
                                                {"force_y", "m/s^2", 0.0, 1.0, "held since the last sample"},
                                                {"force_z", "m/s^2", 0.0, 1.0, "held since the last sample"},
                                                {"gyro_bias_x", "rad/s", 0.0, 1.0, "that has wandered"},
                                                {"gyro_bias_y", "rad/s", 0.0, 1.0, "that has wandered"},
                                                {"gyro_bias_z", "rad/s", 0.0, 1.0, "that has wandered"},
                                                {"force_bias_x", "m/s^2", 0.0, 1.0, "that has wandered"},
                                                {"force_bias_y", "m/s^2", 0.0, 1.0, "that has wandered"},
                                                {"force_bias_z", "m/s^2", 0.0, 1.0, "that has wandered"},
                                                {"samples", "1", 0.0, 1.0, "taken so far"},
                                                {"valid", "1", 0.0, 1.0, "of the last sample"}};
  static constexpr std::uint32_t n_noise = 12;

  static bool pack(const Params& params, Packed& p) {
    p = {InertialSensor::gyro(params), InertialSensor::accelerometer(params)};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<6>(in, out);
    out.out[6] = T(in.d[13]);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double period, const double* noise, double*, double* d) noexcept {
    const MountMotion<double>& at = in.at[0];
    const double truth[6] = {at.omega.x, at.omega.y, at.omega.z, at.specific_force.x, at.specific_force.y, at.specific_force.z};
    const bool first = d[12] == 0.0;
    bool within = true;
    for (int i = 0; i < 6; ++i) {
      const InertialSensor& s = i < 3 ? p.gyro : p.accelerometer;
      d[6 + i] = s.wandered(d[6 + i], period, first, noise[6 + i]);
      const int axis = i % 3;
      const double seen = s.component(axis, truth + i - axis) + s.bias[axis];
      const double read = to_steps(seen + d[6 + i] + s.noise / std::sqrt(period) * noise[i], s.step);
      d[i] = to_range(read, s.range);
      within = within && d[i] == read;
    }
    d[12] += 1.0, d[13] = within ? 1.0 : 0.0;
  }
};

}  // namespace
const cardan_device_family& imu_family() { return device_table<Imu>(); }
}  // namespace cardan
