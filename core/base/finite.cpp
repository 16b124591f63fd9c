#include "core/base/finite.hpp"

#include "core/base/clones.hpp"

namespace cardan {

CARDAN_CLONES("default", "avx2")
bool all_finite(const double* values, int n) {
  std::uint64_t found[8] = {};  // independent of each other: none waits for the one before
  int i = 0;
  for (; i + 8 <= n; i += 8)
    for (int j = 0; j < 8; ++j) found[j] |= not_finite_bit(values[i + j]);
  for (; i < n; ++i) found[0] |= not_finite_bit(values[i]);
  for (int j = 1; j < 8; ++j) found[0] |= found[j];
  return found[0] >> 63 == 0;
}

}  // namespace cardan
