#pragma once
// NRLMSISE-00 asked by hand: all that it tells of the air at a place and a time.
#include <array>

namespace cardan {

/// A place and a time.
struct UpperAirAsked {
  int day = 1;                                             // of the year, from 1
  double seconds = 0.0, solar_time = 0.0;                  // of the day, UT; local apparent solar time [s]
  double altitude = 0.0, latitude = 0.0, longitude = 0.0;  // [m], geodetic [rad], to the east [rad]
  double f107 = 150.0, f107_average = 150.0;               // [1e-22 W/(m^2 Hz)], of the day before; over 81 days
  /// Of the day; with `history` also of these 3 h, of 3, 6, 9 h before, means of 12 to 33 and of 36 to 57 h before.
  std::array<double, 7> ap{};
  bool history = false;
};
struct UpperAir {
  std::array<double, 8> number;   // [1/m^3] of He, O, N2, O2, Ar, H, N, anomalous O
  double density, drag_density;   // [kg/m^3] without anomalous oxygen, and with it
  double temperature, exosphere;  // [K] there, and far above
  bool is_air;                    // false: the model fails for this activity of the Sun, and numbers mean nothing
};
/// From the ground to 1000 km (Picone, Hedin, Drob, Aikin 2002).
UpperAir upper_air(const UpperAirAsked& asked);

}  // namespace cardan
