// zonal_harmonics: gravity of a planet that is oblate, alike all about its axis: U = -mu/r (1 - sum J_n (a/r)^n P_n(s)), s the sine of the
// latitude. With (n + 1) P_n + s P_n' = P_{n+1}' the pull of a term along the radius r^ and the axis k is
// mu J_n a^n / r^(n+2) (P_{n+1}' r^ - P_n' k).
#include <cmath>

#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

struct ZonalHarmonics {
  static constexpr const char* type = "zonal_harmonics";
  static constexpr const char* summary = "gravity of an oblate planet, J2 to J6 about its axis";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_STEADY | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 3.0;  // [m] of the laws, whose centres and radii are of order one
  static constexpr bool gradient_at_once = true;
  static constexpr int kLast = 6;
  struct Packed {
    double mu, radius, J[kLast + 1], axis[3], centre[3];
  };
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter"), 0.0,
                      std::numeric_limits<double>::infinity(), CARDAN_ABOVE),
      param::in_range(param::required("radius", CARDAN_NUMBER, "m", "that the harmonics refer to"), 0.0,
                      std::numeric_limits<double>::infinity(), CARDAN_ABOVE),
      param::required("J2", CARDAN_NUMBER, "1", "oblateness, not normalised: 1.08263e-3 of Earth"),
      param::optional("J3", CARDAN_NUMBER, "1", "as J2, of degree 3"),
      param::optional("J4", CARDAN_NUMBER, "1", "of degree 4"),
      param::optional("J5", CARDAN_NUMBER, "1", "of degree 5"),
      param::optional("J6", CARDAN_NUMBER, "1", "of degree 6"),
      {"axis", CARDAN_UNIT_VECTOR, 0u, "1", "of the planet, world axes", {0.0, 0.0, 1.0}, 0.0, 0.0, 0, nullptr, nullptr},
      param::optional("centre", CARDAN_VECTOR, "m", "where it is, world axes")};

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* name) { return params.number(name); };
    const Eigen::Vector3d a = params.vector("axis"), c = params.vector("centre");
    p = {n("mu"), n("radius"), {0.0, 0.0, n("J2"), n("J3"), n("J4"), n("J5"), n("J6")}, {a[0], a[1], a[2]}, {c[0], c[1], c[2]}};
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<ZonalHarmonics, T>& at, T* out) noexcept {
    using std::sqrt;
    const Vec3<T> d = at.x - Vec3<T>{T(p.centre[0]), T(p.centre[1]), T(p.centre[2])}, k{T(p.axis[0]), T(p.axis[1]), T(p.axis[2])};
    const T r = sqrt(dot(d, d)), near = T(p.radius) / r;
    const Vec3<T> up = (T(1.0) / r) * d;
    const T s = dot(up, k);
    T along(-1.0), across(0.0), potential(-1.0), power = near;  // of mu/r^2 and mu/r; (a/r)^n
    T before(1.0), P = s, slope_before(0.0), slope(1.0);        // P_{n-1}, P_n and their slopes
    for (int n = 1; n < kLast; ++n) {
      const T next = (T(2.0 * n + 1.0) * s * P - T(n) * before) / T(n + 1.0), next_slope = slope_before + T(2.0 * n + 1.0) * P;
      before = P, P = next, slope_before = slope, slope = next_slope;  // of n + 1
      const T slope_above = slope_before + T(2.0 * n + 3.0) * P;       // P'_{n+2}
      power = power * near;
      const T J = T(p.J[n + 1]) * power;
      along = along + J * slope_above, across = across - J * slope, potential = potential + J * P;
    }
    const Vec3<T> a = (T(p.mu) / (r * r)) * (along * up + across * k);
    out[0] = a.x, out[1] = a.y, out[2] = a.z, out[3] = T(p.mu) / r * potential;
  }
};

}  // namespace
const cardan_field_family& zonal_harmonics_family() { return field_table<ZonalHarmonics>(); }
}  // namespace cardan
