// planet_attitude: how a planet stands and turns.
#include "plugins/fields/planet.hpp"

namespace cardan {
namespace {

struct PlanetAttitude {
  static constexpr const char* type = "planet_attitude";
  static constexpr const char* summary = "how a planet stands and turns: a quaternion w >= 0, x, y, z from its axes to those of the world";
  static constexpr std::uint32_t quantity = CARDAN_ATTITUDE;
  static constexpr unsigned facts = 0;
  using Packed = PlanetTurn;
  using Prepared = PlanetAxes;
  static constexpr cardan_param_desc schema[] = {PlanetTurn::rate_desc,   PlanetTurn::axis_desc,   PlanetTurn::meridian_desc,
                                                 PlanetTurn::epoch_desc,  PlanetTurn::dut1_desc,   PlanetTurn::orientation_desc,
                                                 PlanetTurn::pole_x_desc, PlanetTurn::pole_y_desc, PlanetTurn::bulletin_desc};
  static constexpr cardan_limit_desc limits[] = {PlanetTurn::bulletin_limit};
  static bool pack(const Params& params, Packed& p) { return p.pack(params); }
  static int prepare(const Packed& p, double t, Prepared& out) noexcept {
    out = PlanetAxes::at(p, t);
    return p.is_known(t) ? 0 : 1;
  }
  template <class T>  // of time alone
  static void evaluate(const Packed&, const FieldPoint<PlanetAttitude, T>& at, T* out) noexcept {
    const Eigen::Quaterniond q(Eigen::Map<const Eigen::Matrix3d>(at.prepared->columns).eval());
    const double sign = q.w() < 0.0 ? -1.0 : 1.0;
    out[0] = T(sign * q.w()), out[1] = T(sign * q.x()), out[2] = T(sign * q.y()), out[3] = T(sign * q.z());
  }
};

}  // namespace
const cardan_field_family& planet_attitude_family() { return field_table<PlanetAttitude>(); }
}  // namespace cardan
