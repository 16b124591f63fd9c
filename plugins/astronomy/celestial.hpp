#pragma once
// Where the Sun, the Moon and the planets are. By ERFA's series: the Earth to some km (VSOP2000 shortened), the Moon to 8 km rms, 31 km at
// worst (Meeus 1998, after ELP-2000/82), the planets to 1e-5 rad (Simon et al. 1994, years 1000 to 3000, over which the Earth's is as near
// to it as that): for third bodies, light and eclipses, not for navigation. TDB is taken for TT, 2 ms at most. Axes of the GCRS.
#include <array>
#include <cmath>

#include "plugins/astronomy/dates.hpp"

namespace cardan {

enum class Celestial { sun, moon, mercury, venus, earth, mars, jupiter, saturn, uranus, neptune };
inline constexpr const char* kCelestialNames[] = {"sun",  "moon",    "mercury", "venus",  "earth",
                                                  "mars", "jupiter", "saturn",  "uranus", "neptune"};

/// GM [m^3/s^2] of DE440 (Park, Folkner, Williams, Boggs 2021), from Mars on with its moons.
double gravitational_parameter(Celestial body);

/// Whether it is a time for which the series are made: within a thousand Julian years of J2000, those of Simon et al.
inline bool celestial_is_known(const Days& tt) { return std::abs(tt.whole + tt.part) <= 365250.0; }
/// [m] from `origin`: by the series, and by their polynomials over the day.
std::array<double, 3> celestial_position(Celestial body, Celestial origin, const Days& tt);
std::array<double, 3> celestial_position_of_day(Celestial body, Celestial origin, const Days& tt);

}  // namespace cardan
