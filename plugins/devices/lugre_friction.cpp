// lugre_friction on a hinge component: bristles that bend by z before they slip [Canudas de Wit, Olsson, Astrom & Lischinsky 1995, IEEE
// Trans. Automatic Control 40], with bending damping that fades with the rate [Olsson 1996].
#include <cmath>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct LugreFriction {
  static constexpr const char* type = "lugre_friction";
  static constexpr const char* summary = "friction of bristles that bend before they slip (LuGre), on a component of a hinge";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_ROUGH;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double coulomb, breakaway, stribeck_rate, stiffness, damping, viscous, fading_rate;
  };
  static constexpr cardan_param_desc schema[] = {
      param::positive(param::required("coulomb", CARDAN_NUMBER, "N m|N", "force of slow sliding")),
      param::not_negative(param::optional("breakaway", CARDAN_NUMBER, "N m|N", "force that starts to slide; 0: coulomb")),
      param::positive(
          param::optional("stribeck_rate", CARDAN_NUMBER, "rad/s|m/s", "rate that takes the force from breakaway to coulomb", 0.001)),
      param::positive(param::required("stiffness", CARDAN_NUMBER, "N m/rad|N/m", "of the bristles")),
      param::not_negative(param::optional("damping", CARDAN_NUMBER, "N m s/rad|N s/m", "of their bending")),
      param::not_negative(param::optional("viscous", CARDAN_NUMBER, "N m s/rad|N s/m", "in proportion to the rate")),
      param::not_negative(
          param::optional("fading_rate", CARDAN_NUMBER, "rad/s|m/s", "rate over which the damping of bending fades; 0: it stays"))};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_HINGE, CARDAN_USE_LOAD, "a component of a hinge"}};
  static constexpr cardan_port_desc ports[] = {{"force", CARDAN_PORT_OUT, "N m|N", 0.0, 0, "against the motion"}};
  static constexpr cardan_state_desc states[] = {{"bending", "rad|m", 0.0, 1.0, "of the bristles"}};

  static bool pack(const Params& params, Packed& p) {
    p.coulomb = params.number("coulomb");
    p.breakaway = params.number("breakaway");
    if (p.breakaway == 0.0) p.breakaway = p.coulomb;
    p.stribeck_rate = params.number("stribeck_rate"), p.stiffness = params.number("stiffness"), p.damping = params.number("damping");
    p.viscous = params.number("viscous"), p.fading_rate = params.number("fading_rate");
    if (!(p.breakaway >= p.coulomb)) return params.fail("breakaway", "a force that is at least `coulomb`");
    return true;
  }
  static void nominal(const Packed& p, double* sizes) { sizes[0] = p.breakaway / p.stiffness; }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::abs, std::exp;
    const T v = in.at[0].v, z = in.z[0], s = v * T(1.0 / p.stribeck_rate);
    constexpr double kNothing = 700.0;  // exp(-700) = 1e-304; libm is slow where it underflows, as it does in all fast sliding
    T g = T(p.coulomb);
    if (s * s < T(kNothing)) g = g + T(p.breakaway - p.coulomb) * exp(-(s * s));
    const T zdot = v - T(p.stiffness) * abs(v) / g * z;
    T damping = T(p.damping);
    if (p.fading_rate > 0.0) damping = damping * exp(-(v * v / T(p.fading_rate * p.fading_rate)));
    const T force = T(p.stiffness) * z + damping * zdot + T(p.viscous) * v;
    out.zdot[0] = zdot;
    out.load[0].tau = -force;
    out.out[0] = force;
    out.lost = force * v - T(p.stiffness) * z * zdot;
  }
  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept { return 0.5 * p.stiffness * in.z[0] * in.z[0]; }
};

}  // namespace
const cardan_device_family& lugre_friction_family() { return device_table<LugreFriction>(); }
}  // namespace cardan
