// The sweeps for x86-64-v2: processors with SSE4.2. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Kernels& kernels_v2() {
  static constexpr Kernels set{"v2", make_sweeps<double>(), {}, {}};
  return set;
}

}  // namespace cardan::soa
