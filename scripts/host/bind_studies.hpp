#pragma once
#include "scripts/host/scenario.hpp"

namespace cardan {

// Studies about the present state, as methods of sim and of the vehicle; arguments from the second on.
int push_modes(lua_State* L, Scenario&);               ///< system_modes{elastic = 10, rigid = 12}
int push_derivatives(lua_State* L, Scenario&);         ///< derivatives(), or derivatives(body) in its parameters
int push_inverse_kinematics(lua_State* L, Scenario&);  ///< inverse_kinematics{targets = {...}, ...}

}  // namespace cardan
