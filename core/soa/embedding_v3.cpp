// Loops closed inside of the sweeps for x86-64-v3: processors with AVX2 and FMA. Flags: core/CMakeLists.txt.
#include "core/soa/embedding_sweeps.hpp"

namespace cardan::soa {

SweepEmbedded embedded_v3() { return embedding; }

}  // namespace cardan::soa
