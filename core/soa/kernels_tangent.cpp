// The sweeps on numbers that carry their derivative (tangent.hpp).
#include "core/soa/kernels_tangent.hpp"

#include "core/soa/tangent_leaves.hpp"
// what families give must be known before the sweeps that ask for it
#include "core/soa/sweeps_impl.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {

template class Workspace<Tangent>;

template <>
const Sweeps<Tangent>& sweeps<Tangent>() {
  static constexpr Sweeps<Tangent> set = make_sweeps<Tangent>();
  return set;
}

}  // namespace cardan::soa
