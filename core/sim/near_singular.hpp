#pragma once
// Closed loops near a posture in which a row holds nothing (docs/mathematics/loops.md, 7).
#include <algorithm>

#include "core/dynamics/observe.hpp"
#include "core/sim/balances.hpp"

namespace cardan {

/// Of the direction of motion, relative: what rounding of closed loops is there.
inline double rounded_direction(double pivot) { return std::min(4e-14 / (pivot * pivot), 1e-4); }

/// A scaled pivot below is in the limits of balances.
inline constexpr double kInBalances = 3e-2;

/// What momentum and energy may be off by there: a state that is closed to some of its tolerance is off by that over the smallest pivot in
/// its direction of motion, and by rounding. Zero elsewhere.
inline Balances::Integrals off_near_singular(double pivot, double relative, const Momentum& p, const Energy& e) {
  constexpr double kTolerances = 10.0;  // as many before a method that keeps its states as they are starts anew
  Balances::Integrals off = Balances::Integrals::Zero();
  if (!(pivot < kInBalances)) return off;
  const double part = kTolerances * relative / pivot + rounded_direction(pivot);
  off[0] = part * p.linear_magnitude, off[3] = part * p.angular_magnitude, off[6] = 2.0 * part * e.magnitude;
  return off;
}

}  // namespace cardan
