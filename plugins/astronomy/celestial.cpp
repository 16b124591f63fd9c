#include "plugins/astronomy/celestial.hpp"

#include <erfa.h>

#include "plugins/astronomy/daily.hpp"

namespace cardan {
namespace {

constexpr double kAu = 149597870700.0;  // [m]

/// From the Sun.
void from_sun(int which, const Days& tt, double* out) {
  const auto body = static_cast<Celestial>(which);
  const double a = Days::kJ2000 + tt.whole, b = tt.part;
  double p[2][3] = {}, unused[2][3];
  if (body == Celestial::earth || body == Celestial::moon)
    eraEpv00(a, b, p, unused);
  else if (body != Celestial::sun)
    eraPlan94(a, b,
              body < Celestial::earth ? which - static_cast<int>(Celestial::mercury) + 1 : which - static_cast<int>(Celestial::earth) + 3,
              p);
  for (int i = 0; i < 3; ++i) out[i] = kAu * p[0][i];
}
void moon_from_earth(int, const Days& tt, double* out) {
  double p[2][3];
  eraMoon98(Days::kJ2000 + tt.whole, tt.part, p);
  for (int i = 0; i < 3; ++i) out[i] = kAu * p[0][i];
}

/// By `sun(which, out)` and `moon(out)`: without the detour by the Sun where the Moon and the Earth see each other.
template <class FromSun, class FromEarth>
std::array<double, 3> difference(Celestial body, Celestial origin, const FromSun& of, const FromEarth& moon) {
  std::array<double, 3> out{};
  if (body == origin) return out;
  double m[3] = {}, a[3] = {}, b[3] = {};
  if (body == Celestial::moon || origin == Celestial::moon) moon(m);
  const auto near = [](Celestial x) { return x == Celestial::moon || x == Celestial::earth; };
  if (!near(body) || !near(origin)) of(static_cast<int>(body), a), of(static_cast<int>(origin), b);
  for (int i = 0; i < 3; ++i) out[i] = (body == Celestial::moon ? m[i] : 0.0) - (origin == Celestial::moon ? m[i] : 0.0) + (a[i] - b[i]);
  return out;
}

}  // namespace

double gravitational_parameter(Celestial body) {
  static constexpr double kGm[] = {1.3271244004127942e20, 4.9028001184575496e12, 2.2031868551400003e13, 3.2485859200000000e14,
                                   3.9860043550702266e14, 4.2828375815756102e13, 1.2671276409999998e17, 3.7940584841799997e16,
                                   5.7945563999999985e15, 6.8365271005803989e15};
  return kGm[static_cast<int>(body)];
}

std::array<double, 3> celestial_position(Celestial body, Celestial origin, const Days& tt) {
  return difference(
      body, origin, [&](int which, double* out) { from_sun(which, tt, out); }, [&](double* out) { moon_from_earth(0, tt, out); });
}

std::array<double, 3> celestial_position_of_day(Celestial body, Celestial origin, const Days& tt) {
  return difference(
      body, origin, [&](int which, double* out) { daily<3, from_sun>(which, tt, out); },
      [&](double* out) { daily<3, moon_from_earth>(0, tt, out); });
}

}  // namespace cardan
