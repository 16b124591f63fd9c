// harris_priester: density of the upper air at a mean activity of the Sun, with its bulge behind the Sun: rows of the least and the largest
// density at heights, between which both fall exponentially (Harris and Priester 1962, as in Montenbruck and Gill, Satellite
// Orbits, 3.5.2).
#include <cmath>

#include "plugins/fields/celestial_place.hpp"

namespace cardan {
namespace {

struct HarrisPriester {
  static constexpr const char* type = "harris_priester";
  static constexpr const char* summary =
      "density of the Earth's air from 100 to 1000 km by Harris and Priester, with a bulge behind the Sun";
  static constexpr std::uint32_t quantity = CARDAN_DENSITY;
  static constexpr unsigned facts = 0u;
  static constexpr double distance = 6.7e6;  // [m] of the laws
  struct Row {
    double height, least, most;  // [m], [kg/m^3]
  };
  static constexpr Row kRows[] = {
      {100e3, 4.974e-7, 4.974e-7},   {120e3, 2.49e-8, 2.49e-8},     {130e3, 8.377e-9, 8.71e-9},    {140e3, 3.899e-9, 4.059e-9},
      {150e3, 2.122e-9, 2.215e-9},   {160e3, 1.263e-9, 1.344e-9},   {170e3, 8.008e-10, 8.758e-10}, {180e3, 5.283e-10, 6.01e-10},
      {190e3, 3.617e-10, 4.297e-10}, {200e3, 2.557e-10, 3.162e-10}, {210e3, 1.839e-10, 2.396e-10}, {220e3, 1.341e-10, 1.853e-10},
      {230e3, 9.949e-11, 1.455e-10}, {240e3, 7.488e-11, 1.157e-10}, {250e3, 5.709e-11, 9.308e-11}, {260e3, 4.403e-11, 7.555e-11},
      {270e3, 3.43e-11, 6.182e-11},  {280e3, 2.697e-11, 5.095e-11}, {290e3, 2.139e-11, 4.226e-11}, {300e3, 1.708e-11, 3.526e-11},
      {320e3, 1.099e-11, 2.511e-11}, {340e3, 7.214e-12, 1.819e-11}, {360e3, 4.824e-12, 1.337e-11}, {380e3, 3.274e-12, 9.955e-12},
      {400e3, 2.249e-12, 7.492e-12}, {420e3, 1.558e-12, 5.684e-12}, {440e3, 1.091e-12, 4.355e-12}, {460e3, 7.701e-13, 3.362e-12},
      {480e3, 5.474e-13, 2.612e-12}, {500e3, 3.916e-13, 2.042e-12}, {520e3, 2.819e-13, 1.605e-12}, {540e3, 2.042e-13, 1.267e-12},
      {560e3, 1.488e-13, 1.005e-12}, {580e3, 1.092e-13, 7.997e-13}, {600e3, 8.07e-14, 6.39e-13},   {620e3, 6.012e-14, 5.123e-13},
      {640e3, 4.519e-14, 4.121e-13}, {660e3, 3.43e-14, 3.325e-13},  {680e3, 2.632e-14, 2.691e-13}, {700e3, 2.043e-14, 2.185e-13},
      {720e3, 1.607e-14, 1.779e-13}, {740e3, 1.281e-14, 1.452e-13}, {760e3, 1.036e-14, 1.19e-13},  {780e3, 8.496e-15, 9.776e-14},
      {800e3, 7.069e-15, 8.059e-14}, {840e3, 4.68e-15, 5.741e-14},  {880e3, 3.2e-15, 4.21e-14},    {920e3, 2.21e-15, 3.13e-14},
      {960e3, 1.56e-15, 2.36e-14},   {1000e3, 1.15e-15, 1.81e-14}};
  struct Packed {
    Ellipsoid planet;
    SunPlace sun;
    double axis[3], lag, half_exponent;
  };
  struct Prepared {
    double bulge[3];  // direction to it
  };
  static constexpr cardan_param_desc schema[] = {
      SunPlace::direction_desc,
      SunPlace::epoch_desc,
      CelestialPlace::origin_desc,
      param::in_range(
          param::optional("exponent", CARDAN_NUMBER, "1",
                          "of the cosine of half the angle from the bulge: 2 for orbits of low inclination, 6 for polar ones", 4.0),
          2.0, 6.0),
      param::in_range(param::optional("lag", CARDAN_NUMBER, "rad", "of the bulge behind the Sun, about `axis`; the default is 30 deg",
                                      0.5235987755982988),
                      0.0, 1.0),
      Ellipsoid::radius_desc,
      Ellipsoid::flattening_desc,
      TurningPlanet::axis_desc,
      TurningPlanet::centre_desc};
  static constexpr cardan_limit_desc limits[] = {
      {"lowest", 1, "100 km above the ellipsoid"}, {"highest", 1, "1000 km above the ellipsoid"}, CelestialPlace::dates_limit};
  static constexpr double kLowest = 100e3, kHighest = 1000e3;  // [m]

  static bool pack(const Params& params, Packed& p) {
    p.planet.pack(params);
    const Eigen::Vector3d axis = params.vector("axis");
    p.axis[0] = axis.x(), p.axis[1] = axis.y(), p.axis[2] = axis.z();
    p.lag = params.number("lag"), p.half_exponent = 0.5 * params.number("exponent");
    if (!p.sun.pack(params)) return false;
    return p.sun.place.origin != static_cast<int>(Celestial::sun) || p.sun.moves == 0 ||
           params.fail("origin", "another than the Sun, which heats the air");
  }
  static int prepare(const Packed& p, double t, Prepared& out) noexcept {
    Eigen::Vector3d sun(p.sun.direction);
    if (p.sun.moves != 0) {
      const Vec3<double> place = p.sun.place.at(t);
      sun = Eigen::Vector3d(place.x, place.y, place.z).normalized();
    }
    Eigen::Map<Eigen::Vector3d>{out.bulge} = Eigen::AngleAxisd(p.lag, Eigen::Vector3d(p.axis)) * sun;
    return p.sun.is_known(t) ? 0 : 4;
  }
  static int beyond(const Packed& p, const FieldPoint<HarrisPriester, double>& at) noexcept {
    const double h = p.planet.height(at.x);
    return (h < kLowest ? 1 : 0) | (h > kHighest ? 2 : 0);
  }
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<HarrisPriester, T>& at, T* density) noexcept {
    using std::exp, std::pow, std::sqrt;
    T h = p.planet.height(at.x);
    if (h < T(kLowest)) h = T(kLowest);
    if (h > T(kHighest)) h = T(kHighest);
    const Row* low = kRows;
    while (low + 2 < std::end(kRows) && !(h < T(low[1].height))) ++low;
    const T part = (h - T(low->height)) / T(low[1].height - low->height);
    const auto between = [&](double from, double to) { return T(from) * exp(part * T(std::log(to / from))); };
    const T least = between(low->least, low[1].least), most = between(low->most, low[1].most);
    const double* c = p.planet.centre;
    const Vec3<T> d = at.x - Vec3<T>{T(c[0]), T(c[1]), T(c[2])},
                  bulge{T(at.prepared->bulge[0]), T(at.prepared->bulge[1]), T(at.prepared->bulge[2])};
    const T r = sqrt(dot(d, d));
    T square = r > T(0.0) ? T(0.5) * (T(1.0) + dot(d, bulge) / r) : T(0.5);  // of the cosine of half the angle
    if (!(square > T(0.0))) square = T(0.0);                                 // by rounding
    density[0] = least + (most - least) * pow(square, p.half_exponent);
  }
};

}  // namespace
const cardan_field_family& harris_priester_family() { return field_table<HarrisPriester>(); }
}  // namespace cardan
