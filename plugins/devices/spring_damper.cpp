// spring_damper: along the line between two nodes, l long: f = k (l - l_0) + c l', pulling both towards each other.
#include <cmath>

#include "core/abi/device_family.hpp"

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
  static constexpr auto kUse = CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD;
  static constexpr cardan_mount_desc mounts[] = {{"from", CARDAN_MOUNT_NODE, kUse, "a node: one end"},
                                                 {"to", CARDAN_MOUNT_NODE, kUse, "a node: the other end"}};
  static constexpr cardan_port_desc ports[] = {{"length", CARDAN_PORT_OUT, "m", 0.0, 0, "between the nodes"},
                                               {"tension", CARDAN_PORT_OUT, "N", 0.0, 0, "that pulls them towards each other"}};

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("stiffness"), params.number("rest"), params.number("damping")};
    return true;
  }

  template <class T>
  struct Line {
    Vec3<T> u;  // unit vector from -> to, world axes; 0 where the nodes are at one point
    T length, rate;
  };
  template <class T>
  static Line<T> line(const DeviceIn<T>& in) noexcept {
    using std::sqrt;
    const Vec3<T> d = in.at[1].position - in.at[0].position;
    const T length = sqrt(dot(d, d));
    const Vec3<T> u = length > T(0.0) ? (T(1.0) / length) * d : Vec3<T>{};
    return {u, length, dot(u, in.at[1].R_WN * in.at[1].velocity - in.at[0].R_WN * in.at[0].velocity)};
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const Line<T> l = line(in);
    const T tension = T(p.stiffness) * (l.length - T(p.rest)) + T(p.damping) * l.rate;
    const Vec3<T> pull = tension * l.u;
    out.load[0].force = transpose_times(in.at[0].R_WN, pull);
    out.load[1].force = transpose_times(in.at[1].R_WN, -pull);
    out.out[0] = l.length, out.out[1] = tension;
    out.lost = T(p.damping) * l.rate * l.rate;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const double stretch = line(in).length - p.rest;
    return 0.5 * p.stiffness * stretch * stretch;
  }
};

}  // namespace
const cardan_device_family& spring_damper_family() { return device_table<SpringDamper>(); }
}  // namespace cardan
