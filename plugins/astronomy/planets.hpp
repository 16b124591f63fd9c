#pragma once
// How the Sun, the planets and the Moon stand and turn, by the report of the IAU's working group on cartographic coordinates of 2015
// (Archinal et al. 2018): right ascension and declination of the north pole, and the angle W of the prime meridian from the node of
// the equator on that of the ICRF. The Earth has better: earth.hpp.
#include <array>

#include "plugins/astronomy/celestial.hpp"

namespace cardan {

/// Right ascension and declination of the pole, W [rad].
std::array<double, 3> pole_and_meridian(Celestial body, const Days& tt);

/// The axes of the body, columns in those of the ICRF, one after the other: along the prime meridian, east of it, along the pole; what
/// changes slowly by its polynomials over the day. Of the Moon the mean axes, of which the first points to the mean Earth.
std::array<double, 9> planet_axes(Celestial body, const Days& tt);

/// The principal axes of the Moon, in which gravity has its coefficients: 68 and 79 arcseconds from the mean ones about the third and the
/// second, as DE440 has them.
std::array<double, 9> principal_axes_of_moon(const Days& tt);

/// W goes at this rate in the mean [rad/s].
double rotation_rate(Celestial body);

}  // namespace cardan
