// The sweeps for x86-64-v3: processors with AVX2 and FMA. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Kernels& kernels_v3() {
  static constexpr Kernels set{"v3", make_sweeps<double>(), make_sweeps<Lanes<4>>(), {}};
  return set;
}

}  // namespace cardan::soa
