// sunlight: parallel light of a Sun that does not move, or light of the Sun where the ephemerides have it; behind a sphere the part of its
// disc that is seen (Montenbruck and Gill, Satellite Orbits, section 3.4.2: two discs that overlap, in angles).
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "plugins/fields/celestial_place.hpp"

namespace cardan {
namespace {

struct Sunlight {
  static constexpr const char* type = "sunlight";
  static constexpr const char* summary = "sunlight, with the umbra and penumbra of a sphere";
  static constexpr std::uint32_t quantity = CARDAN_LIGHT;
  static constexpr unsigned facts = 0;
  static constexpr double distance = 7e6;                                // [m] of the laws
  static constexpr double kAu = 149597870700.0, kSunRadius = 695700e3;   // [m] (IAU 2012, 2015)
  static constexpr double kEarthRadius = 6378.137e3, kDisc = 4.6524e-3;  // defaults [m], [rad]
  static constexpr double kHalfPi = 0.5 * std::numbers::pi;
  struct Packed {
    double irradiance, radius, disc, centre[3];
    SunPlace sun;
  };
  struct Prepared {
    double sun[3];  // [m], of one that moves
  };
  static constexpr double kAny = std::numeric_limits<double>::infinity();
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::optional("irradiance", CARDAN_NUMBER, "W/m^2", "in full light, 1 au from the Sun with `epoch`", 1361.0), 0.0,
                      kAny),
      SunPlace::direction_desc,
      SunPlace::epoch_desc,
      CelestialPlace::origin_desc,
      param::in_range(param::optional("radius", CARDAN_NUMBER, "m", "of the sphere; the default is Earth's, 0: no shadow", kEarthRadius),
                      0.0, kAny),
      param::in_range(param::optional("disc", CARDAN_NUMBER, "rad", "apparent radius of a Sun that does not move", kDisc), 1e-6, 0.5),
      param::optional("centre", CARDAN_VECTOR, "m", "of the sphere, world axes")};
  static constexpr cardan_limit_desc limits[] = {CelestialPlace::dates_limit};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d c = params.vector("centre");
    p = {params.number("irradiance"), params.number("radius"), params.number("disc"), {c[0], c[1], c[2]}, {}};
    if (!p.sun.pack(params)) return false;
    if (p.sun.moves == 0) return true;
    if (params.number("disc") != kDisc) return params.fail("disc", "none: that of the Sun goes by its distance, from `epoch` on");
    const int origin = params.choice("origin");
    if (origin == static_cast<int>(Celestial::sun) && p.radius > 0.0 && c.isZero(0.0))
      return params.fail("radius", "0, for no shadow: the Sun is at the origin");
    if (origin != static_cast<int>(Celestial::earth) && p.radius == kEarthRadius && c.isZero(0.0))
      return params.fail("radius", "that of the body at the origin, 1737.4 km of the Moon; 0: no shadow", "6378.137 km, that of Earth");
    return true;
  }

  // Rounding may carry a cosine beyond 1, in the middle of the shadow for one.
  static double arc_cosine(double x) noexcept { return std::acos(std::clamp(x, -1.0, 1.0)); }
  static Tangent arc_cosine(const Tangent& x) noexcept {
    return {arc_cosine(x.x), std::abs(x.x) < 1.0 ? -x.d / std::sqrt(1.0 - x.x * x.x) : 0.0};
  }

  static double arc_tangent(double y, double x) noexcept { return std::atan2(y, x); }
  static Tangent arc_tangent(const Tangent& y, const Tangent& x) noexcept {
    return {std::atan2(y.x, x.x), (x.x * y.d - y.x * x.d) / (x.x * x.x + y.x * y.x)};
  }
  /// z - sin z, z >= 0: twice the segment of a disc of radius 1 whose ends are z apart. Small ones by the series: of a disc that is far
  /// larger than the other nothing would be left of the difference.
  template <class T>
  static T less_sine(const T& z) noexcept {
    using std::sin;
    if (!(z < T(0.5))) return z - sin(z);
    T sum(1.0);
    for (int k = 8; k > 1; --k) sum = T(1.0) - z * z / T(2.0 * k * (2 * k + 1)) * sum;
    return z * z * z / T(6.0) * sum;
  }

  /// Angles at which a point sees things: the radii of both discs, and from one to the other.
  template <class T>
  struct Discs {
    T sun, sphere, apart;
  };
  /// Where the Sun is from a point, what it sends there, its disc.
  template <class T>
  struct Sun {
    Vec3<T> towards;
    T irradiance, disc;
  };
  template <class T>
  static Sun<T> sun_at(const Packed& p, const FieldPoint<Sunlight, T>& at) noexcept {
    using std::sqrt;
    if (p.sun.moves == 0) return {{T(p.sun.direction[0]), T(p.sun.direction[1]), T(p.sun.direction[2])}, T(p.irradiance), T(p.disc)};
    const Prepared& now = *at.prepared;
    const Vec3<T> s = Vec3<T>{T(now.sun[0]), T(now.sun[1]), T(now.sun[2])} - at.x;
    const T square = dot(s, s), near = T(1.0) / sqrt(square);
    return {near * s, T(p.irradiance * kAu * kAu) / square, T(kHalfPi) - arc_cosine(T(kSunRadius) * near)};
  }
  /// Outside of the sphere, whose centre is r away along -d.
  template <class T>
  static Discs<T> discs(const Packed& p, const Sun<T>& sun, const Vec3<T>& d, const T& r) noexcept {
    const T sine = T(p.radius) / r;
    return {sun.disc, T(kHalfPi) - arc_cosine(sine), arc_cosine(-dot(d, sun.towards) / r)};
  }

  /// The part of the disc of the Sun, of apparent radius a, that a disc of radius b leaves at an angle c.
  template <class T>
  static T part_seen(const T& a, const T& b, const T& c) noexcept {
    using std::sqrt;
    if (!(c < a + b)) return T(1.0);
    if (c < b - a) return T(0.0);
    if (c < a - b) return T(1.0) - b * b / (a * a);
    const T square = (a + b - c) * (a + b + c) * (c + a - b) * (c + b - a);  // Heron; where the discs touch rounding decides
    const T chord = square > T(0.0) ? sqrt(square) : T(0.0);
    const T of_sun = arc_tangent(chord, (c - b) * (c + b) + a * a), of_sphere = arc_tangent(chord, (c - a) * (c + a) + b * b);
    return T(1.0) - (less_sine(T(2.0) * of_sun) + b * b / (a * a) * less_sine(T(2.0) * of_sphere)) / T(2.0 * std::numbers::pi);
  }

  static int prepare(const Packed& p, double t, Prepared& out) {
    out = {};
    if (p.sun.moves == 0) return 0;
    const Vec3<double> d = p.sun.place.at(t);
    out = {{d.x, d.y, d.z}};
    return p.sun.is_known(t) ? 0 : 1;
  }

  /// Of the penumbra, 0 without a sphere: positive where the whole disc of the Sun is seen; positive where some of it is, or some all
  /// around.
  static std::uint32_t n_edges(const Packed& p) noexcept { return p.radius > 0.0 ? 2 : 0; }
  static void edges(const Packed& p, const FieldPoint<Sunlight, double>& at, double* g) noexcept {
    const Vec3<double> d = at.x - Vec3<double>{p.centre[0], p.centre[1], p.centre[2]};
    const double r = std::sqrt(dot(d, d));
    g[0] = g[1] = -1.0;  // inside of the sphere
    if (n_edges(p) == 0 || !(r > p.radius)) return;
    const Discs<double> c = discs(p, sun_at(p, at), d, r);
    g[0] = c.apart - (c.sun + c.sphere), g[1] = c.apart - std::abs(c.sun - c.sphere);
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<Sunlight, T>& at, T* light) noexcept {
    using std::sqrt;
    const Sun<T> sun = sun_at(p, at);
    const Vec3<T> d = at.x - Vec3<T>{T(p.centre[0]), T(p.centre[1]), T(p.centre[2])};
    const T r = sqrt(dot(d, d));
    T seen(1.0);
    if (p.radius > 0.0 && !(r > T(p.radius)))
      seen = T(0.0);  // inside of the sphere
    else if (p.radius > 0.0) {
      const Discs<T> c = discs(p, sun, d, r);
      seen = part_seen(c.sun, c.sphere, c.apart);
    }
    const Vec3<T> goes = -(sun.irradiance * seen) * sun.towards;
    light[0] = goes.x, light[1] = goes.y, light[2] = goes.z;
  }
};

}  // namespace
const cardan_field_family& sunlight_family() { return field_table<Sunlight>(); }
}  // namespace cardan
