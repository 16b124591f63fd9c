#pragma once
#include "scripts/bindings/handle.hpp"

namespace cardan {

/// Methods of a vehicle whose hinges and closures become others in the run.
const std::vector<luaL_Reg>& topology_methods();

}  // namespace cardan
