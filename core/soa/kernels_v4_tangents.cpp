// The sweeps of inverse dynamics for x86-64-v4, along eight directions at a time. Flags: core/CMakeLists.txt.
#include "core/soa/kernels.hpp"
#include "core/soa/kernels_tangents.hpp"
// what families give must be known before the sweeps that ask for it
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {

const Sweeps<Tangents>& tangents_v4() {
  static constexpr Sweeps<Tangents> set = make_inverse_sweeps<Tangents>();
  return set;
}

}  // namespace cardan::soa
