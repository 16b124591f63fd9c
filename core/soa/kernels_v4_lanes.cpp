// The sweeps for x86-64-v4, eight states at a time. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Sweeps<Lanes<8>>& lanes_v4() {
  static constexpr Sweeps<Lanes<8>> set = make_sweeps<Lanes<8>>();
  return set;
}

}  // namespace cardan::soa
