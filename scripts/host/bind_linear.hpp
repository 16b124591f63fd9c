#pragma once
// The linear model of a scenario at its present state, for scripts.
#include "scripts/host/scenario.hpp"

namespace cardan {

/// Pushes the table of `linearize{inputs = {...}, outputs = {...}}`, whose argument (or nothing) is at index 2. Forces, loads and given
/// motions are those of now.
int push_linear_model(lua_State* L, Scenario&);

}  // namespace cardan
