// dipole: the magnetic field of a dipole at rest: B = D / r^3 (3 (a . r) r - a), r the unit vector from its centre, D > 0 where B points
// along -a above the equator.
#include <cmath>

#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

struct Dipole {
  static constexpr const char* type = "dipole";
  static constexpr const char* summary = "the magnetic field of a dipole at rest";
  static constexpr std::uint32_t quantity = CARDAN_MAGNETIC;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 3.0;  // [m] of the laws, whose centres are of order one
  struct Packed {
    double strength, axis[3], centre[3];
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("strength", CARDAN_NUMBER, "T m^3", "mu_0 / (4 pi) times its moment; the default is that of Earth", -7.77e15),
      {"axis", CARDAN_UNIT_VECTOR, 0u, "1", "of the dipole, world axes", {0.0, 0.0, 1.0}, 0.0, 0.0, 0, nullptr, nullptr},
      param::optional("centre", CARDAN_VECTOR, "m", "where it is, world axes")};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d a = params.vector("axis"), c = params.vector("centre");
    p = {params.number("strength"), {a[0], a[1], a[2]}, {c[0], c[1], c[2]}};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<Dipole, T>& at, T* B) noexcept {
    using std::sqrt;
    const Vec3<T> d = at.x - Vec3<T>{T(p.centre[0]), T(p.centre[1]), T(p.centre[2])}, a{T(p.axis[0]), T(p.axis[1]), T(p.axis[2])};
    const T away = sqrt(dot(d, d));
    const Vec3<T> r = (T(1.0) / away) * d, field = (T(p.strength) / (away * away * away)) * (T(3.0) * dot(a, r) * r - a);
    B[0] = field.x, B[1] = field.y, B[2] = field.z;
  }
};

}  // namespace
const cardan_field_family& dipole_family() { return field_table<Dipole>(); }
}  // namespace cardan
