#pragma once
// Smooth functions of time that are too dear for a step: by a Chebyshev polynomial over each day.
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "plugins/astronomy/dates.hpp"

namespace cardan {

/// N numbers of `exact(which, time, out)` at a time. A day's polynomial is made when the day is first asked and kept for each thread: it
/// depends on the day alone, so numbers are the same whatever was asked before, and no step allocates. Twelve terms: to round-off of what
/// turns no faster than once in two days or so.
template <int N, void (*exact)(int, const Days&, double*)>
void daily(int which, const Days& when, double* out) {
  constexpr int kTerms = 12, kKept = 32;
  struct Day {
    int which = -1;
    double day = std::numeric_limits<double>::quiet_NaN();
    std::array<std::array<double, N>, kTerms> c;
  };
  thread_local std::array<Day, kKept> kept;
  const double carried = std::floor(when.part), day = when.whole + carried, x = 2.0 * (when.part - carried) - 1.0;
  Day& slot = kept[static_cast<std::size_t>(static_cast<long long>(std::floor(day)) + 3LL * which) % kKept];
  if (slot.which != which || slot.day != day) {
    const auto angle = [](int k) { return std::numbers::pi * (k + 0.5) / kTerms; };
    slot.which = which, slot.day = day, slot.c = {};
    for (int k = 0; k < kTerms; ++k) {
      double value[N];
      exact(which, {day, 0.5 * (1.0 + std::cos(angle(k)))}, value);
      for (int j = 0; j < kTerms; ++j)
        for (int i = 0; i < N; ++i) slot.c[j][i] += (j == 0 ? 1.0 : 2.0) / kTerms * value[i] * std::cos(j * angle(k));
    }
  }
  for (int i = 0; i < N; ++i) {  // Clenshaw
    double b1 = 0.0, b2 = 0.0;
    for (int j = kTerms - 1; j > 0; --j) {
      const double b = slot.c[j][i] + 2.0 * x * b1 - b2;
      b2 = b1, b1 = b;
    }
    out[i] = slot.c[0][i] + x * b1 - b2;
  }
}

}  // namespace cardan
