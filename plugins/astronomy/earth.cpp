#include "plugins/astronomy/earth.hpp"

#include <erfa.h>
#include <erfam.h>

#include <algorithm>

#include "plugins/astronomy/daily.hpp"

namespace cardan {
namespace {

void pole(int, const Days& tt, double* out) { eraXys06a(Days::kJ2000 + tt.whole, tt.part, out, out + 1, out + 2); }

}  // namespace

std::array<double, 3> intermediate_pole(const Days& tt) {
  std::array<double, 3> out{};
  pole(0, tt, out.data());
  return out;
}

std::array<double, 3> intermediate_pole_of_day(const Days& tt) {
  std::array<double, 3> out{};
  daily<3, pole>(0, tt, out.data());
  return out;
}

double earth_rotation_angle(const Days& ut1) { return eraEra00(Days::kJ2000 + ut1.whole, ut1.part); }

double mean_sidereal_time(const Days& ut1, const Days& tt) {
  return eraGmst06(Days::kJ2000 + ut1.whole, ut1.part, Days::kJ2000 + tt.whole, tt.part);
}
double apparent_sidereal_time(const Days& ut1, const Days& tt) {
  return eraGst06a(Days::kJ2000 + ut1.whole, ut1.part, Days::kJ2000 + tt.whole, tt.part);
}

std::array<double, 2> nutation(const Days& tt) {
  std::array<double, 2> out{};
  eraNut06a(Days::kJ2000 + tt.whole, tt.part, out.data(), out.data() + 1);
  return out;
}
double mean_obliquity(const Days& tt) { return eraObl06(Days::kJ2000 + tt.whole, tt.part); }

std::array<double, 9> bias_precession_nutation(const Days& tt) {
  double rows[3][3];
  eraPnm06a(Days::kJ2000 + tt.whole, tt.part, rows);
  std::array<double, 9> out{};
  std::copy_n(&rows[0][0], 9, out.begin());
  return out;
}

double tio_locator(const Days& tt) { return eraSp00(Days::kJ2000 + tt.whole, tt.part); }

std::array<double, 3> geodetic(const std::array<double, 3>& place) {
  double given[3] = {place[0], place[1], place[2]};
  std::array<double, 3> out{};
  eraGc2gd(ERFA_WGS84, given, out.data(), out.data() + 1, out.data() + 2);
  return out;
}
std::array<double, 3> place_of_geodetic(double longitude, double latitude, double height) {
  std::array<double, 3> out{};
  eraGd2gc(ERFA_WGS84, longitude, latitude, height, out.data());
  return out;
}

void move_pole(double x, double y, double s, double* columns) {
  double rows[3][3], moved[9];
  eraPom00(x, y, s, rows);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) moved[3 * i + j] = rows[i][0] * columns[j] + rows[i][1] * columns[3 + j] + rows[i][2] * columns[6 + j];
  std::copy_n(moved, 9, columns);
}

std::array<double, 9> earth_axes(const Days& tt, const Days& ut1, double x, double y, double dX, double dY) {
  const std::array<double, 3> cip = intermediate_pole_of_day(tt);
  double to_intermediate[3][3], rows[3][3];
  eraC2ixys(cip[0] + dX, cip[1] + dY, cip[2], to_intermediate);
  eraCr(to_intermediate, rows);
  eraRz(earth_rotation_angle(ut1), rows);
  std::array<double, 9> out{};
  std::copy_n(&rows[0][0], 9, out.begin());
  move_pole(x, y, tio_locator(tt), out.data());
  return out;
}

}  // namespace cardan
