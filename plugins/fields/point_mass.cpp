// point_mass: gravity of a point attractor, U = -mu / r. As the gravity of a vehicle it is `central` by way of the table; as a field beside
// it, what an estimator on board may take gravity for.
#include <cmath>

#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

struct PointMass {
  static constexpr const char* type = "point_mass";
  static constexpr const char* summary = "gravity of a point attractor";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 3.0;  // [m] of the laws, whose centres are of order one
  struct Packed {
    double mu, centre[3];
  };
  static constexpr cardan_param_desc schema[] = {param::in_range(param::required("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter"),
                                                                 0.0, std::numeric_limits<double>::infinity(), CARDAN_ABOVE),
                                                 param::optional("centre", CARDAN_VECTOR, "m", "where it is, world axes")};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d c = params.vector("centre");
    p = {params.number("mu"), {c[0], c[1], c[2]}};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<PointMass, T>& at, T* out) noexcept {
    using std::sqrt;
    const Vec3<T> d = at.x - Vec3<T>{T(p.centre[0]), T(p.centre[1]), T(p.centre[2])};
    const T r2 = dot(d, d), r = sqrt(r2);
    const Vec3<T> a = (T(-p.mu) / (r2 * r)) * d;
    out[0] = a.x, out[1] = a.y, out[2] = a.z, out[3] = T(-p.mu) / r;
  }
};

}  // namespace
const cardan_field_family& point_mass_family() { return field_table<PointMass>(); }
}  // namespace cardan
