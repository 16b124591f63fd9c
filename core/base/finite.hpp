#pragma once
// NaN and infinity in arrays.
#include <bit>
#include <cmath>
#include <cstdint>

namespace cardan {

/// Integer operations alone, which compilers vectorise: adding one to an exponent of ones carries into the sign.
inline bool all_finite(const double* values, int n) {
  constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000, one = 0x0010'0000'0000'0000;
  const auto carried = [values](int i) { return (std::bit_cast<std::uint64_t>(values[i]) & exponent) + one; };
  std::uint64_t carry[8] = {};  // independent of each other: none waits for the one before
  int i = 0;
  for (; i + 8 <= n; i += 8)
    for (int j = 0; j < 8; ++j) carry[j] |= carried(i + j);
  for (; i < n; ++i) carry[0] |= carried(i);
  for (int j = 1; j < 8; ++j) carry[0] |= carry[j];
  return carry[0] >> 63 == 0;
}

/// Index of the first value that is NaN or infinite, -1 if all are finite.
inline int first_not_finite(const double* values, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(values[i])) return i;
  return -1;
}

}  // namespace cardan
