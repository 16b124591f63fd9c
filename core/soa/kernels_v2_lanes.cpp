// The sweeps for x86-64-v2, two states at a time. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Sweeps<Lanes<2>>& lanes_v2() {
  static constexpr Sweeps<Lanes<2>> set = make_sweeps<Lanes<2>>();
  return set;
}

}  // namespace cardan::soa
