// The sweeps for x86-64-v4: processors with AVX-512. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Sweeps<double>& sweeps_v4() {
  static constexpr Sweeps<double> set = make_sweeps<double>();
  return set;
}

}  // namespace cardan::soa
