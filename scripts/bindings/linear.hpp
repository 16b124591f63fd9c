#pragma once
// Linear models for scripts.
#include "core/operators/system_modes.hpp"
#include "scripts/bindings/operator_methods.hpp"

namespace cardan {

/// Pushes the table of `linearize{inputs = {...}, outputs = {...}}`, whose argument (or nothing) is at index 2. Forces, loads and given
/// motions are those of the state.
int linear_model(lua_State* L, const operators::TreeOperators&, const OperatingState&);
/// {{re, im, frequency, damping}, ...}
void push_poles(lua_State* L, const std::vector<operators::Pole>& all);
/// Of the scenario now.
int push_linear_model(lua_State* L, Scenario&);

}  // namespace cardan
