// encoder: of a hinge component, sampled: its coordinate in steps, and the rate by the difference of two readings. It counts on beyond a
// turn.
#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

struct Encoder {
  static constexpr const char* type = "encoder";
  static constexpr const char* summary = "coordinate of a hinge in steps, sampled, and its rate by difference";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_SENSOR;
  struct Packed {
    double bias, noise, step;
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("bias", CARDAN_NUMBER, "rad|m", "what it reads at 0"),
      param::not_negative(param::optional("noise", CARDAN_NUMBER, "rad|m", "standard deviation of a sample, before it is rounded")),
      param::not_negative(param::optional("step", CARDAN_NUMBER, "rad|m", "from one reading to the next; 0: none"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_COORDINATE, "a component of a hinge, with a coordinate"}};
  static constexpr cardan_port_desc ports[] = {
      {"position", CARDAN_PORT_OUT, "rad|m", 0.0, 0, "as read"},
      {"rate", CARDAN_PORT_OUT, "rad/s|m/s", 0.0, 0, "difference of the last two readings over the period", nullptr, 0, "valid"},
      {"valid", CARDAN_PORT_OUT, "1", 0.0, 0, "1: it has read twice, and so has a rate"}};
  static constexpr cardan_state_desc marks[] = {{"position", "rad|m", 0.0, 1.0, "held since the last sample"},
                                                {"rate", "rad/s|m/s", 0.0, 1.0, "held since the last sample"},
                                                {"valid", "1", 0.0, 1.0, "of the rate"},
                                                {"samples", "1", 0.0, 1.0, "taken so far"}};
  static constexpr std::uint32_t n_noise = 1;

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("bias"), params.number("noise"), params.number("step")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    give_held<3>(in, out);
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double period, const double* noise, double*, double* d) noexcept {
    const double read = to_steps(in.at[0].q + p.bias + p.noise * noise[0], p.step);
    d[2] = d[3] > 0.0 ? 1.0 : 0.0;
    d[1] = d[2] * (read - d[0]) / period;
    d[0] = read, d[3] += 1.0;
  }

  /// The start, or what it reads is counted from another zero: no difference to a reading before.
  static void event(const Packed&, const DeviceIn<double>&, std::uint32_t, int, double*, double* d) noexcept { d[2] = d[3] = 0.0; }
};

}  // namespace
const cardan_device_family& encoder_family() { return device_table<Encoder>(); }
}  // namespace cardan
