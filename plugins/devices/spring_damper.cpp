// spring_damper: along the line between two nodes, l long: f = k (l - l_0) + c l', pulling both towards each other.
#include "plugins/devices/line.hpp"

namespace cardan {
namespace {

struct SpringDamper {
  static constexpr const char* type = "spring_damper";
  static constexpr const char* summary = "a spring and a damper along the line between two nodes";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double stiffness, rest, damping;
  };
  static constexpr cardan_param_desc schema[] = {
      param::not_negative(param::required("stiffness", CARDAN_NUMBER, "N/m", "of the spring")),
      param::not_negative(param::optional("rest", CARDAN_NUMBER, "m", "length at which the spring is without force")),
      param::not_negative(param::optional("damping", CARDAN_NUMBER, "N s/m", "of the damper"))};
  static constexpr const auto& mounts = kLineMounts;
  static constexpr cardan_port_desc ports[] = {{"length", CARDAN_PORT_OUT, "m", 0.0, 0, "between the nodes"},
                                               {"tension", CARDAN_PORT_OUT, "N", 0.0, 0, "that pulls them towards each other"}};

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("stiffness"), params.number("rest"), params.number("damping")};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const NodeLine<T> l = line_between(in);
    const T tension = T(p.stiffness) * (l.length - T(p.rest)) + T(p.damping) * l.rate;
    pull_along(l, tension, in, out);
    out.out[0] = l.length, out.out[1] = tension;
    out.lost = T(p.damping) * l.rate * l.rate;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const double stretch = line_between(in).length - p.rest;
    return 0.5 * p.stiffness * stretch * stretch;
  }
};

}  // namespace
const cardan_device_family& spring_damper_family() { return device_table<SpringDamper>(); }
}  // namespace cardan
