// co_rotating_wind: air that turns with its planet: v = omega x (x - centre).
#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

struct CoRotatingWind {
  static constexpr const char* type = "co_rotating_wind";
  static constexpr const char* summary = "the velocity of air that turns with its planet";
  static constexpr std::uint32_t quantity = CARDAN_WIND;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE;
  static constexpr double distance = 7e6;  // [m] of the laws
  struct Packed {
    double omega[3], centre[3];
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("rate", CARDAN_NUMBER, "rad/s", "of the planet; the default is Earth's", 7.292115e-5),
      {"axis", CARDAN_UNIT_VECTOR, 0u, "1", "of the planet, world axes", {0.0, 0.0, 1.0}, 0.0, 0.0, 0, nullptr, nullptr},
      param::optional("centre", CARDAN_VECTOR, "m", "of the planet, world axes")};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d w = params.number("rate") * params.vector("axis"), c = params.vector("centre");
    p = {{w[0], w[1], w[2]}, {c[0], c[1], c[2]}};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<CoRotatingWind, T>& at, T* v) noexcept {
    const Vec3<T> omega{T(p.omega[0]), T(p.omega[1]), T(p.omega[2])}, centre{T(p.centre[0]), T(p.centre[1]), T(p.centre[2])};
    const Vec3<T> wind = cross(omega, at.x - centre);
    v[0] = wind.x, v[1] = wind.y, v[2] = wind.z;
  }
};

}  // namespace
const cardan_field_family& co_rotating_wind_family() { return field_table<CoRotatingWind>(); }
}  // namespace cardan
