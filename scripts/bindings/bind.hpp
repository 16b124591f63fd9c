#pragma once
// What the files that bind share: each makes the functions and types that scripts see of one thing.
#include <initializer_list>
#include <string>
#include <vector>

#include "scripts/mission/scenario.hpp"

namespace cardan {

void bind_parameters(Scenario&);
void bind_vehicle(Scenario&);  // plugin, vehicle
void bind_mission(Scenario&);  // mission
void bind_initial(Scenario&);
void bind_declarations(Scenario&);   // controller, phase, event, check, figure, signals, stop
void bind_script_device(Scenario&);  // device
void bind_astronomy(Scenario&);      // astro
void bind_control(Scenario&);        // control
void bind_sequences(Scenario&);      // sequence, wait, at, wait_until
void bind_handles(Scenario&);        // bodies, hinges, modes, nodes, loads

/// A function of a module, and how many arguments it hears at the most.
struct ModuleFunction {
  const char* name;
  lua_CFunction function;
  int arguments;
};
/// Makes "module.name" of each.
void bind_module(Scenario&, const char* module, std::initializer_list<ModuleFunction>);

/// Pushes the handle of the vehicle.
void push_vehicle(lua_State* L, Scenario&);
/// Makes the metatable of a type of userdata without uservalues; a method that does not exist is answered with those that do.
void make_handle_type(lua_State* L, const char* type, const std::vector<luaL_Reg>& methods, lua_CFunction text);

/// "bus, wing"; "none"
std::string listed(const std::vector<std::string>& names);
/// The argument at `index`: a finite number of seconds, or a text with a unit: "5 min".
double seconds_at(lua_State* L, int index, const char* what);
/// Refuses a declaration during the run, or before `vehicle` where it needs one.
void expect_setup(lua_State* L, const Scenario&, const char* what, bool needs_vehicle);

}  // namespace cardan
