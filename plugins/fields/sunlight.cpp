// sunlight: parallel light of a Sun that does not move; behind a sphere the part of its disc that is seen (Montenbruck and Gill, Satellite
// Orbits, section 3.4.2: two discs that overlap, in angles).
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

struct Sunlight {
  static constexpr const char* type = "sunlight";
  static constexpr const char* summary = "sunlight, with the umbra and penumbra of a sphere";
  static constexpr std::uint32_t quantity = CARDAN_LIGHT;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY;
  static constexpr double distance = 7e6;  // [m] of the laws
  struct Packed {
    double irradiance, to_sun[3], radius, disc, centre[3];
  };
  static constexpr double kAny = std::numeric_limits<double>::infinity();
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::optional("irradiance", CARDAN_NUMBER, "W/m^2", "in full light", 1361.0), 0.0, kAny),
      param::required("direction", CARDAN_UNIT_VECTOR, "1", "to the Sun, world axes"),
      param::in_range(param::optional("radius", CARDAN_NUMBER, "m", "of the sphere; the default is Earth's, 0: no shadow", 6378.137e3), 0.0,
                      kAny),
      param::in_range(param::optional("disc", CARDAN_NUMBER, "rad", "apparent radius of the Sun", 4.6524e-3), 1e-6, 0.5),
      param::optional("centre", CARDAN_VECTOR, "m", "of the sphere, world axes")};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d s = params.vector("direction"), c = params.vector("centre");
    p = {params.number("irradiance"), {s[0], s[1], s[2]}, params.number("radius"), params.number("disc"), {c[0], c[1], c[2]}};
    return true;
  }

  // Rounding may carry a cosine beyond 1, in the middle of the shadow for one.
  static double arc_cosine(double x) noexcept { return std::acos(std::clamp(x, -1.0, 1.0)); }
  static Tangent arc_cosine(const Tangent& x) noexcept {
    return {arc_cosine(x.x), std::abs(x.x) < 1.0 ? -x.d / std::sqrt(1.0 - x.x * x.x) : 0.0};
  }

  /// The part of the disc of the Sun, of apparent radius a, that a disc of radius b leaves at an angle c.
  template <class T>
  static T part_seen(double a, const T& b, const T& c) noexcept {
    using std::sqrt;
    if (!(c < T(a) + b)) return T(1.0);
    if (c < b - T(a)) return T(0.0);
    if (c < T(a) - b) return T(1.0) - b * b / T(a * a);
    const T x = (c * c + T(a * a) - b * b) / (T(2.0) * c), square = T(a * a) - x * x;
    const T y = square > T(0.0) ? sqrt(square) : T(0.0);  // where the discs touch rounding decides
    const T hidden = T(a * a) * arc_cosine(x / T(a)) + b * b * arc_cosine((c - x) / b) - c * y;
    return T(1.0) - hidden / T(std::numbers::pi * a * a);
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<Sunlight, T>& at, T* light) noexcept {
    using std::sqrt;
    const Vec3<T> d = at.x - Vec3<T>{T(p.centre[0]), T(p.centre[1]), T(p.centre[2])}, s{T(p.to_sun[0]), T(p.to_sun[1]), T(p.to_sun[2])};
    const T r = sqrt(dot(d, d));
    T seen(1.0);
    if (p.radius > 0.0 && !(r > T(p.radius)))
      seen = T(0.0);  // inside of the sphere
    else if (p.radius > 0.0) {
      const T sine = T(p.radius) / r, half_pi(0.5 * std::numbers::pi);
      seen = part_seen(p.disc, half_pi - arc_cosine(sine), arc_cosine(-dot(d, s) / r));
    }
    for (int i = 0; i < 3; ++i) light[i] = T(-p.irradiance * p.to_sun[i]) * seen;
  }
};

}  // namespace
const cardan_field_family& sunlight_family() { return field_table<Sunlight>(); }
}  // namespace cardan
