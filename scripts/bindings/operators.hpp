#pragma once
// Spatial operators in scripts.
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// Makes the types of operators and their expressions.
void bind_operators(Scenario&);
/// Pushes the operators at the present state; argument 2 may name the last stage to compute ("position", "inertia").
int push_operators(lua_State* L, Scenario&);

}  // namespace cardan
