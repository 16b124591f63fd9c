// co_rotating_wind: air that turns with its planet, and winds on it: v = omega x d + (east + east_shear h) e + (north + north_shear h) n at
// d from the centre and the height h; e along axis x d, n along d x e.
#include "plugins/fields/planet.hpp"

namespace cardan {
namespace {

struct CoRotatingWind {
  static constexpr const char* type = "co_rotating_wind";
  static constexpr const char* summary = "the velocity of air that turns with its planet, and of a steady wind on it";
  static constexpr std::uint32_t quantity = CARDAN_WIND;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY;
  static constexpr double distance = 7e6;  // [m] of the laws
  struct Packed {
    Ellipsoid planet;
    double omega[3], east, north, east_shear, north_shear, blows;
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("rate", CARDAN_NUMBER, "rad/s", "of the planet; the default is Earth's", 7.292115e-5),
      {"axis", CARDAN_UNIT_VECTOR, 0u, "1", "of the planet, world axes", {0.0, 0.0, 1.0}, 0.0, 0.0, 0, nullptr, nullptr},
      param::optional("centre", CARDAN_VECTOR, "m", "of the planet, world axes"),
      param::optional("east", CARDAN_NUMBER, "m/s", "of a wind towards the east, at the height 0"),
      param::optional("north", CARDAN_NUMBER, "m/s", "of a wind towards the north, along the sphere, at the height 0"),
      param::optional("east_shear", CARDAN_NUMBER, "1/s", "what it gains towards the east with the height"),
      param::optional("north_shear", CARDAN_NUMBER, "1/s", "what it gains towards the north with the height"),
      Ellipsoid::radius_desc,
      Ellipsoid::flattening_desc};

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d w = params.number("rate") * params.vector("axis");
    for (int i = 0; i < 3; ++i) p.omega[i] = w[i];
    p.east = params.number("east"), p.north = params.number("north");
    p.east_shear = params.number("east_shear"), p.north_shear = params.number("north_shear");
    if (p.east_shear != 0.0 || p.north_shear != 0.0)
      p.planet.pack(params);
    else
      p.planet.place(params);
    p.blows = p.east != 0.0 || p.north != 0.0 || p.east_shear != 0.0 || p.north_shear != 0.0;
    return true;
  }

  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<CoRotatingWind, T>& at, T* v) noexcept {
    using std::sqrt;
    const auto vec = [](const double(&a)[3]) { return Vec3<T>{T(a[0]), T(a[1]), T(a[2])}; };
    const Vec3<T> d = at.x - vec(p.planet.centre);
    Vec3<T> wind = cross(vec(p.omega), d);
    if (p.blows != 0.0) {
      const Vec3<T> eastwards = cross(vec(p.planet.axis), d);
      if (const T out2 = dot(eastwards, eastwards); out2 > T(0.0)) {  // over a pole there is no east
        const T h = p.planet.height(at.x);
        const Vec3<T> e = (T(1.0) / sqrt(out2)) * eastwards, n = (T(1.0) / sqrt(dot(d, d))) * cross(d, e);
        wind = wind + (T(p.east) + T(p.east_shear) * h) * e + (T(p.north) + T(p.north_shear) * h) * n;
      }
    }
    v[0] = wind.x, v[1] = wind.y, v[2] = wind.z;
  }
};

}  // namespace
const cardan_field_family& co_rotating_wind_family() { return field_table<CoRotatingWind>(); }
}  // namespace cardan
