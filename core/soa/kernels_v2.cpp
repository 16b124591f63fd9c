// The sweeps for x86-64-v2: processors with SSE4.2. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Sweeps<double>& sweeps_v2() {
  static constexpr Sweeps<double> set = make_sweeps<double>();
  return set;
}

}  // namespace cardan::soa
