// latch: catches a hinge component that passes an angle (or a place) slowly enough, and then holds it by a spring and a damper.
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct Latch {
  static constexpr const char* type = "latch";
  static constexpr const char* summary = "catches a hinge that passes a place slowly enough and holds it by a spring and a damper";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double place, largest_rate, stiffness, damping;
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("place", CARDAN_NUMBER, "rad|m", "where it catches"),
      param::positive(param::required("max_rate", CARDAN_NUMBER, "rad/s|m/s", "it catches what passes no faster")),
      param::positive(param::required("stiffness", CARDAN_NUMBER, "N m/rad|N/m", "of what it holds by")),
      param::not_negative(param::optional("damping", CARDAN_NUMBER, "N m s/rad|N s/m", "of what it holds by"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD | CARDAN_USE_COORDINATE, "a component of a hinge, with a coordinate"}};
  static constexpr cardan_port_desc ports[] = {{"force", CARDAN_PORT_OUT, "N m|N", 0.0, 0, "on the hinge"}};
  static constexpr cardan_state_desc marks[] = {{"closed", "1", 0.0, 1.0, "1: it holds"},
                                                {"missed", "1", 0.0, 1.0, "how often its place was passed too fast"}};
  static constexpr std::uint32_t n_roots = 1;

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("place"), params.number("max_rate"), params.number("stiffness"), params.number("damping")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const T closed(in.d[0]), v = in.at[0].v, force = -closed * (T(p.stiffness) * (in.at[0].q - T(p.place)) + T(p.damping) * v);
    out.load[0].tau = force;
    out.out[0] = force;
    out.lost = closed * T(p.damping) * v * v;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const double depth = in.at[0].q - p.place;
    return 0.5 * in.d[0] * p.stiffness * depth * depth;
  }
  /// Once it holds nothing happens at its place any more.
  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept { g[0] = in.d[0] != 0.0 ? 1.0 : in.at[0].q - p.place; }
  static void event(const Packed& p, const DeviceIn<double>& in, unsigned root, int, double*, double* d) noexcept {
    if (root == 0) d[std::abs(in.at[0].v) <= p.largest_rate ? 0 : 1] += 1.0;
  }
};

}  // namespace
const cardan_device_family& latch_family() { return device_table<Latch>(); }
}  // namespace cardan
