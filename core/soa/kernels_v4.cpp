// The sweeps for x86-64-v4: processors with AVX-512. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Kernels& kernels_v4() {
  static constexpr Kernels set{"v4", make_sweeps<double>(), {}, make_sweeps<Lanes<8>>()};
  return set;
}

}  // namespace cardan::soa
