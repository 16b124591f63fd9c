// Loops closed inside of the sweeps for x86-64-v4: processors with AVX-512. Flags: core/CMakeLists.txt.
#include "core/soa/embedding_sweeps.hpp"

namespace cardan::soa {

SweepEmbedded embedded_v4() { return embedding; }

}  // namespace cardan::soa
