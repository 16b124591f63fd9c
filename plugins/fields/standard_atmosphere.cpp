// standard_atmosphere: density of the U.S. Standard Atmosphere (NOAA, NASA, USAF 1976) to 86 km: by layers in which the temperature on
// molecular scale is linear in the geopotential height H, pressure from the balance with the weight of the air.
#include <cmath>

#include "plugins/fields/planet.hpp"

namespace cardan {
namespace {

struct StandardAtmosphere {
  static constexpr const char* type = "standard_atmosphere";
  static constexpr const char* summary = "density of the U.S. Standard Atmosphere of 1976, to 86 km above an ellipsoid";
  static constexpr std::uint32_t quantity = CARDAN_DENSITY;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY;
  static constexpr double distance = 6.4e6;  // [m] of the laws
  using Packed = Ellipsoid;
  static constexpr cardan_param_desc schema[] = {Ellipsoid::radius_desc, Ellipsoid::flattening_desc, TurningPlanet::axis_desc,
                                                 TurningPlanet::centre_desc};
  static constexpr double kLowest = -5e3, kHighest = 86e3;  // [m]
  static constexpr cardan_limit_desc limits[] = {{"lowest", 1, "5 km below the ellipsoid"}, {"highest", 1, "86 km above the ellipsoid"}};

  static constexpr double kGravity = 9.80665, kGas = 8.31432, kMolar = 28.9644e-3;  // [m/s^2], [J/(mol K)], [kg/mol]
  static constexpr double kEarth = 6356766.0;                                       // [m] of geopotential heights
  struct Layer {
    double base, temperature, lapse;  // [m] geopotential, [K], [K/m]
  };
  static constexpr Layer kLayers[] = {{0.0, 288.15, -6.5e-3}, {11e3, 216.65, 0.0},     {20e3, 216.65, 1e-3}, {32e3, 228.65, 2.8e-3},
                                      {47e3, 270.65, 0.0},    {51e3, 270.65, -2.8e-3}, {71e3, 214.65, -2e-3}};
  static constexpr double kPressure = 101325.0;  // [Pa] at the base of the first

  static bool pack(const Params& params, Packed& p) {
    p.pack(params);
    return true;
  }
  static int beyond(const Packed& p, const FieldPoint<StandardAtmosphere, double>& at) noexcept {
    const double h = p.height(at.x);
    return (h < kLowest ? 1 : 0) | (h > kHighest ? 2 : 0);
  }

  /// Pressure at H over that at the base of the layer, and the temperature there.
  template <class T>
  static T share(const Layer& layer, const T& H, T& temperature) noexcept {
    using std::exp, std::pow;
    constexpr double weight = kGravity * kMolar / kGas;
    temperature = T(layer.temperature) + T(layer.lapse) * (H - T(layer.base));
    if (layer.lapse == 0.0) return exp(T(-weight / layer.temperature) * (H - T(layer.base)));
    return pow(temperature / T(layer.temperature), -weight / layer.lapse);
  }
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<StandardAtmosphere, T>& at, T* density) noexcept {
    T h = p.height(at.x);
    if (h < T(kLowest)) h = T(kLowest);
    if (h > T(kHighest)) h = T(kHighest);
    const T H = T(kEarth) * h / (T(kEarth) + h);
    double below = kPressure;
    const Layer* layer = kLayers;
    for (const Layer* next = layer + 1; next != std::end(kLayers) && !(H < T(next->base)); layer = next++) {
      double there = 0.0;
      below *= share(*layer, next->base, there);
    }
    T temperature(0.0);
    const T pressure = T(below) * share(*layer, H, temperature);
    density[0] = T(kMolar / kGas) * pressure / temperature;
  }
};

}  // namespace
const cardan_field_family& standard_atmosphere_family() { return field_table<StandardAtmosphere>(); }
}  // namespace cardan
