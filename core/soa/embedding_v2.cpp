// Loops closed inside of the sweeps for x86-64-v2: every x86-64 processor of today. Flags: core/CMakeLists.txt.
#include "core/soa/embedding_sweeps.hpp"

namespace cardan::soa {

SweepEmbedded embedded_v2() { return embedding; }

}  // namespace cardan::soa
