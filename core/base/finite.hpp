#pragma once
// NaN and infinity in arrays.
#include <bit>
#include <cmath>
#include <cstdint>

namespace cardan {

/// Its top bit is set if x is NaN or infinite; of several numbers they are gathered by |. Integer operations alone, of which none waits for
/// another and which compilers vectorise: adding one to an exponent of ones carries into the sign.
inline std::uint64_t not_finite_bit(double x) {
  constexpr std::uint64_t exponent = 0x7ff0'0000'0000'0000, one = 0x0010'0000'0000'0000;
  return (std::bit_cast<std::uint64_t>(x) & exponent) + one;
}

/// With AVX2 where the processor has it.
bool all_finite(const double* values, int n);

/// Index of the first value that is NaN or infinite, -1 if all are finite.
inline int first_not_finite(const double* values, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(values[i])) return i;
  return -1;
}

}  // namespace cardan
