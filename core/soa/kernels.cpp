// The sweeps in double.
#include "core/soa/sweeps_impl.hpp"

namespace cardan::soa {
template class Workspace<double>;
template struct Sweeps<double>;
}  // namespace cardan::soa
