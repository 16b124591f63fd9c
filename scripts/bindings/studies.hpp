#pragma once
#include "scripts/bindings/operator_methods.hpp"

namespace cardan {

// Studies about a state, as methods of operators(): of a tree or of a part of it.
int system_modes_study(lua_State* L, const operators::TreeOperators&, const OperatingState&);  ///< system_modes{elastic = 10, rigid = 12}
int derivatives_study(lua_State* L, const operators::TreeOperators&,
                      const OperatingState&);  ///< derivatives(), or derivatives(body) in its parameters
int inverse_kinematics_study(lua_State* L, const operators::TreeOperators&,
                             const OperatingState&);  ///< inverse_kinematics{targets = {...}, ...}
int interbody_forces_study(lua_State* L, const operators::TreeOperators&, const OperatingState&);  ///< interbody_forces{v = , vdot = }

// The same about the present state, as methods of sim and of the vehicle.
int push_modes(lua_State* L, Scenario&);
int push_derivatives(lua_State* L, Scenario&);
int push_inverse_kinematics(lua_State* L, Scenario&);
int push_equilibrium(lua_State* L, Scenario&);
int push_closed_system(lua_State* L, Scenario&);

}  // namespace cardan
