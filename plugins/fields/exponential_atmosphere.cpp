// exponential_atmosphere: density of air about a sphere, rho = rho_0 exp(-(h - h_0) / H), h the height above the sphere.
#include <cmath>

#include "core/abi/field_family.hpp"

namespace cardan {
namespace {

struct ExponentialAtmosphere {
  static constexpr const char* type = "exponential_atmosphere";
  static constexpr const char* summary = "density of air that falls exponentially with the height above a sphere";
  static constexpr std::uint32_t quantity = CARDAN_DENSITY;
  static constexpr unsigned facts = CARDAN_FIELD_STEADY;
  static constexpr double distance = 7e6;  // [m] of the laws, at the fallbacks of the lengths
  struct Packed {
    double density, height, scale_height, radius, lowest, highest;
  };
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("density", CARDAN_NUMBER, "kg/m^3", "at `height`"), 0.0, std::numeric_limits<double>::infinity()),
      param::optional("height", CARDAN_NUMBER, "m", "of that density above the sphere", 400e3),
      param::in_range(param::optional("scale_height", CARDAN_NUMBER, "m", "over which it falls to 1/e", 58.515e3), 1e3, 1e6),
      param::in_range(
          param::optional("radius", CARDAN_NUMBER, "m", "of the sphere about the origin of the world; the default is Earth's", 6378.137e3),
          1e6, 1e8),
      param::optional("lowest", CARDAN_NUMBER, "m", "height below which it is not to be trusted"),
      param::in_range(param::optional("highest", CARDAN_NUMBER, "m", "height above which it is not to be trusted", 1e9), 0.0,
                      std::numeric_limits<double>::infinity())};
  static constexpr cardan_limit_desc limits[] = {{"lowest", 1, "below the lowest height of the atmosphere"},
                                                 {"highest", 1, "above the highest height of the atmosphere"}};

  static bool pack(const Params& params, Packed& p) {
    const auto n = [&](const char* name) { return params.number(name); };
    p = {n("density"), n("height"), n("scale_height"), n("radius"), n("lowest"), n("highest")};
    return p.lowest < p.highest || params.fail("highest", "a height above `lowest`");
  }
  template <class T>
  static T height(const Packed& p, const Vec3<T>& x) noexcept {
    using std::sqrt;
    return sqrt(dot(x, x)) - T(p.radius);
  }
  static int beyond(const Packed& p, const FieldPoint<ExponentialAtmosphere, double>& at) noexcept {
    const double h = height(p, at.x);
    return (h < p.lowest ? 1 : 0) | (h > p.highest ? 2 : 0);
  }
  template <class T>
  static void evaluate(const Packed& p, const FieldPoint<ExponentialAtmosphere, T>& at, T* density) noexcept {
    using std::exp;
    T h = height(p, at.x);
    if (h < T(p.lowest)) h = T(p.lowest);
    if (h > T(p.highest)) h = T(p.highest);
    density[0] = T(p.density) * exp(-(h - T(p.height)) / T(p.scale_height));
  }
};

}  // namespace
const cardan_field_family& exponential_atmosphere_family() { return field_table<ExponentialAtmosphere>(); }
}  // namespace cardan
