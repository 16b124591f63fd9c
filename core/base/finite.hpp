#pragma once
// NaN and infinity in arrays.
#include <bit>
#include <cmath>
#include <cstdint>

namespace cardan {

/// Integer operations alone, which compilers vectorise: adding one to an exponent of ones carries into the sign.
inline bool all_finite(const double* values, int n) {
  constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000, one = 0x0010'0000'0000'0000;
  std::uint64_t carry = 0;
  for (int i = 0; i < n; ++i) carry |= (std::bit_cast<std::uint64_t>(values[i]) & exponent) + one;
  return carry >> 63 == 0;
}

/// Index of the first value that is NaN or infinite, -1 if all are finite.
inline int first_not_finite(const double* values, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(values[i])) return i;
  return -1;
}

}  // namespace cardan
