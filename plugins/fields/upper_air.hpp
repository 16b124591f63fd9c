#pragma once
// NRLMSISE-00 asked by hand: all that it tells of the air at a place and a time.
#include <array>

namespace cardan {

struct UpperAirAsked {
  int day = 1;                                             // of the year, from 1
  double seconds = 0.0, solar_time = 0.0;                  // of the day, UT; local apparent solar time [s]
  double altitude = 0.0, latitude = 0.0, longitude = 0.0;  // [m], geodetic [rad], to the east [rad]
  double f107 = 150.0, f107_average = 150.0;               // [1e-22 W/(m^2 Hz)], of the day before; over 81 days
  std::array<double, 7> ap{};                              // of the day; with `history` as msis::Conditions has them
  bool history = false;
};
struct UpperAir {
  std::array<double, 8> number;   // [1/m^3] of He, O, N2, O2, Ar, H, N, anomalous O
  double density, drag_density;   // [kg/m^3] without anomalous oxygen, and with it
  double temperature, exosphere;  // [K] there, and far above
};
UpperAir upper_air(const UpperAirAsked& asked);

}  // namespace cardan
