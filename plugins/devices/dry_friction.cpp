// dry_friction: Coulomb's law with stick that is located. While it sticks, its component stands still, whatever force that takes, up to the
// breakaway force; where the force passes it, it slides under the Coulomb force against the motion, until its rate is zero again.

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

struct DryFriction {
  static constexpr const char* type = "dry_friction";
  static constexpr const char* summary =
      "Coulomb friction of a hinge that sticks: it stands still until the force that holds it is too large";
  static constexpr unsigned facts = CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double coulomb, breakaway, viscous;
  };
  static constexpr cardan_param_desc schema[] = {
      param::not_negative(param::required("coulomb", CARDAN_NUMBER, "N m|N", "force while it slides")),
      param::not_negative(param::optional("breakaway", CARDAN_NUMBER, "N m|N", "most that holds it; less than coulomb: as coulomb")),
      param::not_negative(param::optional("viscous", CARDAN_NUMBER, "N m s/rad|N s/m", "force over rate, beside it"))};
  static constexpr cardan_mount_desc mounts[] = {
      {"at", CARDAN_MOUNT_HINGE, CARDAN_USE_VELOCITY | CARDAN_USE_LOAD | CARDAN_USE_HOLD, "the component"}};
  static constexpr cardan_port_desc ports[] = {{"force", CARDAN_PORT_OUT, "N m|N", 0.0, 0, "while it slides; 0 while it sticks"}};
  static constexpr cardan_state_desc marks[] = {{"sticks", "1", 0.0, 0.0, "1: it stands still"},
                                                {"direction", "1", 0.0, 0.0, "in which it slides or slid last: 1, -1"}};
  static constexpr std::uint32_t n_roots = 1;

  static bool pack(const Params& params, Packed& p) {
    p = {params.number("coulomb"), params.number("breakaway"), params.number("viscous")};
    if (p.breakaway < p.coulomb) p.breakaway = p.coulomb;
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    if (in.d[0] != 0.0) return;
    const T force = T(p.coulomb * in.d[1]) + T(p.viscous) * in.at[0].v;
    out.load[0].tau = -force;
    out.out[0] = -force;
    out.lost = force * in.at[0].v;
  }
  static double energy(const Packed&, const DeviceIn<double>&) noexcept { return 0.0; }
  static double holds(const Packed& p, const DeviceIn<double>&) noexcept { return p.breakaway; }

  /// A little above zero where sliding begins, so that what begins to slide the wrong way, as the load falls again, sticks as well.
  static void roots(const Packed&, const DeviceIn<double>& in, double* g) noexcept {
    g[0] = in.d[0] != 0.0 ? 1.0 : in.d[1] * in.at[0].v + 1e-14;
  }
  static void event(const Packed&, const DeviceIn<double>& in, std::uint32_t root, int direction, double*, double* d) noexcept {
    if (root > n_roots) {  // it breaks away
      d[0] = 0.0, d[1] = direction;
    } else if (root == n_roots) {  // the start
      const double v = in.at[0].v;
      d[0] = v == 0.0, d[1] = v > 0.0 ? 1.0 : v < 0.0 ? -1.0 : d[1];
    } else if (direction < 0) {
      d[0] = 1.0;
    }
  }
};

}  // namespace
const cardan_device_family& dry_friction_family() { return device_table<DryFriction>(); }
}  // namespace cardan
