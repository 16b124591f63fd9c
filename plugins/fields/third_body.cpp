// third_body: what a far body pulls more on what is at a place than on the origin of the world, which falls with it.
#include "plugins/fields/celestial_place.hpp"

namespace cardan {
namespace {

struct ThirdBody {
  static constexpr const char* type = "third_body";
  static constexpr const char* summary = "the pull of a celestial body less that on the origin of the world";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 7e6;  // [m] of the laws
  static constexpr bool gradient_at_once = true;
  struct Packed {
    CelestialPlace place;
    double mu;
  };
  struct Prepared {
    double d[3];
  };
  static constexpr cardan_param_desc schema[] = {
      CelestialPlace::body_desc, CelestialPlace::epoch_desc, CelestialPlace::origin_desc,
      param::in_range(param::optional("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter; 0: that of the body in DE440"), 0.0,
                      std::numeric_limits<double>::infinity())};
  static constexpr cardan_limit_desc limits[] = {CelestialPlace::dates_limit};

  static bool pack(const Params& params, Packed& p) {
    if (!p.place.pack(params)) return false;
    p.mu = params.number("mu");
    if (p.mu == 0.0) p.mu = gravitational_parameter(static_cast<Celestial>(p.place.body));
    return true;
  }
  static int prepare(const Packed& p, double t, Prepared& out) {
    const Vec3<double> d = p.place.at(t);
    out = {{d.x, d.y, d.z}};
    return p.place.is_known(t) ? 0 : 1;
  }

  // Both pulls nearly cancel. With q = x . (x - 2 d) / d^2, |x - d|^2 = d^2 (1 + q), their difference is never taken (Battin 1987, 8.4),
  // nor that of the potentials, -mu (1/|x - d| - 1/d - x . d / d^3). s = |x - d| / d is not by q, which is near to -1 near the body.
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<ThirdBody, T>& at, T* out) noexcept {
    using std::sqrt;
    const Vec3<T> d{T(at.prepared->d[0]), T(at.prepared->d[1]), T(at.prepared->d[2])};
    const T d2 = dot(d, d), far = sqrt(d2), w = dot(at.x, at.x) / d2, q = w - T(2.0) * dot(at.x, d) / d2;
    const Vec3<T> to = d - at.x;
    const T s2 = dot(to, to) / d2, s = sqrt(s2), s3 = s2 * s, f = q * (T(3.0) + q * (T(3.0) + q)) / (T(1.0) + s3);  // f = s^3 - 1
    const T k = T(-p.mu) / (d2 * far * s3);
    const Vec3<T> a = k * (at.x + f * d);
    out[0] = a.x, out[1] = a.y, out[2] = a.z;
    out[3] = T(-0.5 * p.mu) / far * (q * q * (s + T(2.0)) / (s * (T(1.0) + s) * (T(1.0) + s)) - w);
  }
};

}  // namespace
const cardan_field_family& third_body_family() { return field_table<ThirdBody>(); }
}  // namespace cardan
