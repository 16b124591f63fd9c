#pragma once
// How the Earth stands: IAU 2006 precession, IAU 2000A nutation adjusted to it, the Earth rotation angle, polar motion
// (IERS Conventions 2010, chapter 5). World axes are those of the GCRS.
#include <array>

#include "plugins/astronomy/dates.hpp"

namespace cardan {

/// The celestial intermediate pole X, Y and the CIO locator s [rad] at a time of TT: by the series, 0.1 ms, and by its polynomial over the
/// day, to round-off of s and 1e-16 of X and Y.
std::array<double, 3> intermediate_pole(const Days& tt);
std::array<double, 3> intermediate_pole_of_day(const Days& tt);

/// The angle by which the Earth has turned at a time of UT1 [rad] (Capitaine, Guinot, McCarthy 2000).
double earth_rotation_angle(const Days& ut1);

/// The same by the equinox: Greenwich mean and apparent sidereal time [rad], IAU 2006 and 2000A.
double mean_sidereal_time(const Days& ut1, const Days& tt);
double apparent_sidereal_time(const Days& ut1, const Days& tt);

/// Nutation in longitude and obliquity [rad], IAU 2000A adjusted to the precession of 2006; mean obliquity of the ecliptic [rad].
std::array<double, 2> nutation(const Days& tt);
double mean_obliquity(const Days& tt);

/// Bias, precession and nutation: from the GCRS to the true equator and equinox of date, row after row.
std::array<double, 9> bias_precession_nutation(const Days& tt);

/// The TIO locator s' [rad].
double tio_locator(const Days& tt);

/// On the ellipsoid WGS 84: longitude east and geodetic latitude [rad], height [m], of a place in the axes of the Earth [m]; and back.
std::array<double, 3> geodetic(const std::array<double, 3>& place);
std::array<double, 3> place_of_geodetic(double longitude, double latitude, double height);

/// Polar motion x, y and the locator s' [rad]: from axes that have the axis of rotation for their third to those of the crust, columns.
void move_pole(double x, double y, double s, double* columns);

/// The axes of the Earth (ITRS), columns in those of the GCRS, one after the other; x, y: polar motion; dX, dY: what observation adds to
/// the celestial pole [rad].
std::array<double, 9> earth_axes(const Days& tt, const Days& ut1, double x, double y, double dX = 0.0, double dY = 0.0);

}  // namespace cardan
