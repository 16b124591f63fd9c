// pulsed_thruster: pushes in bits that are over at once, as a pulsed plasma thruster does: one at each tick that it is told to fire at.
// What it burns weighs nothing.
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct PulsedThruster {
  static constexpr const char* type = "pulsed_thruster";
  static constexpr const char* summary = "impulse bits at a node, one at each tick that it fires at";
  static constexpr unsigned facts = 0;
  static constexpr unsigned role = CARDAN_ROLE_ACTUATOR;
  struct Packed {
    double direction[3];
    double bit, scatter;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("bit", CARDAN_NUMBER, "N s", "impulse of a pulse")),
      param::along(param::optional("direction", CARDAN_UNIT_VECTOR, "1", "in which it pushes, node axes"), 1, 0, 0),
      param::not_negative(param::optional("scatter", CARDAN_NUMBER, "1", "standard deviation of a bit from pulse to pulse, of its size"))};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_NODE, CARDAN_USE_IMPULSE, "the node where it pushes, in node axes"}};
  static constexpr cardan_port_desc ports[] = {{"fire", CARDAN_PORT_IN, "1", 0.0, 0, "how much of a bit the next tick gives: 0 to 1"},
                                               {"pulses", CARDAN_PORT_OUT, "1", 0.0, 0, "fired so far"},
                                               {"impulse", CARDAN_PORT_OUT, "N s", 0.0, 0, "given so far"}};
  static constexpr cardan_state_desc marks[] = {{"pulses", "1", 0.0, 1.0, "fired so far"},
                                                {"impulse", "N s", 0.0, 1.0, "given so far"},
                                                {"next", "1", 1.0, 1.0, "size of the next pulse, of a bit; the first is one"}};
  static constexpr std::uint32_t n_noise = 1;

  static bool pack(const Params& params, Packed& p) {
    const auto u = params.vector("direction");
    p = {{u.x(), u.y(), u.z()}, params.number("bit"), params.number("scatter")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed&, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    for (int i = 0; i < 2; ++i) out.out[i] = T(in.d[i]);
  }

  static double part(const DeviceIn<double>& in) noexcept { return std::fmin(std::fmax(in.in[0], 0.0), 1.0); }
  static double size(const Packed& p, const DeviceIn<double>& in) noexcept { return p.bit * part(in) * in.d[2]; }

  static void impulse(const Packed& p, const DeviceIn<double>& in, std::uint32_t, int, MountLoad<double>* load) noexcept {
    const double f = size(p, in);
    load[0].force = {f * p.direction[0], f * p.direction[1], f * p.direction[2]};
  }

  static void tick(const Packed& p, const DeviceIn<double>& in, double, const double* noise, double*, double* d) noexcept {
    if (part(in) == 0.0) return;
    d[0] += 1.0;
    d[1] += size(p, in);
    d[2] = std::fmax(1.0 + p.scatter * noise[0], 0.0);
  }
};

}  // namespace
const cardan_device_family& pulsed_thruster_family() { return device_table<PulsedThruster>(); }
}  // namespace cardan
