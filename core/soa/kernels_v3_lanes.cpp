// The sweeps for x86-64-v3, four states at a time. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Sweeps<Lanes<4>>& lanes_v3() {
  static constexpr Sweeps<Lanes<4>> set = make_sweeps<Lanes<4>>();
  return set;
}

}  // namespace cardan::soa
