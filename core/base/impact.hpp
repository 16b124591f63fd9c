#pragma once
// What an impact loses.
#include <cmath>

namespace cardan {

/// a v of a force k d^n (1 + a d') [Hunt & Crossley 1975, J. Applied Mechanics 42] by which what comes at v alone leaves at e v, of any k
/// and n: a v (1 + e) = ln((1 + a v) / (1 - e a v)), by bisection in 0 < a v < 1 / e. e: above 0 to 1.
inline double dissipation_times_speed(double e) {
  if (e >= 1.0) return 0.0;
  double low = 0.0, high = 1.0 / e;
  for (int i = 0; i < 100; ++i) {
    const double x = 0.5 * (low + high);
    (x * (1.0 + e) > std::log1p(x) - std::log1p(-e * x) ? low : high) = x;
  }
  return 0.5 * (low + high);
}

}  // namespace cardan
