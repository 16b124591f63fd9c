#pragma once
// What a script asks the vehicle and its parts for. A handle is a userdata with an index; its methods are plain C functions that read or
// set numbers: no allocation, no lookup of names. Each kind has a file with its methods.
#include <Eigen/Core>
#include <string>
#include <vector>

#include "scripts/bindings/bind.hpp"

namespace cardan {

enum class Kind : int { vehicle, body, hinge, modes, node, load, device, loop, sequence };

struct Handle {
  Kind kind;
  int index;  // user body, node, slot, device, loop of the description, or sequence
  Scenario* scenario;
  const UserBody& user() const { return scenario->present().user[static_cast<std::size_t>(index)]; }
  const Sequences::Sequence& sequence() const { return scenario->sequences.all()[static_cast<std::size_t>(index)]; }
};

/// The handle at argument 1, on which a method was called; refused if it is of another kind.
Handle& handle_of(lua_State* L, Kind kind);
template <Kind kKind>
Handle& self(lua_State* L) {
  return handle_of(L, kKind);
}
void push_handle(lua_State* L, Kind kind, int index, Scenario& s);
/// Whether the value at `index` is one, of any kind.
bool is_handle(lua_State* L, int index);

const std::vector<luaL_Reg>& vehicle_methods();   // vehicle.cpp
const std::vector<luaL_Reg>& body_methods();      // body.cpp
const std::vector<luaL_Reg>& hinge_methods();     // hinge.cpp
const std::vector<luaL_Reg>& modes_methods();     // modes.cpp
const std::vector<luaL_Reg>& node_methods();      // node.cpp
const std::vector<luaL_Reg>& load_methods();      // node.cpp
const std::vector<luaL_Reg>& device_methods();    // device.cpp
const std::vector<luaL_Reg>& loop_methods();      // loop.cpp
const std::vector<luaL_Reg>& sequence_methods();  // sequence.cpp

/// Event functions are evaluated at trial states, where coordinates, rates and states of devices alone are known: refuses anything else.
[[noreturn]] void refuse_at_trial(lua_State* L, const std::string& what);
/// The same for `what` if an event function runs.
void expect_state(lua_State* L, const Scenario& s, const char* what);
/// A number that is to be set; one that is not finite ends the run, whatever the script does about it.
double command(lua_State* L, int arg, Scenario& s, const char* what, const std::string& name);
int push3(lua_State* L, const Eigen::Vector3d& x);
/// w, x, y, z with w >= 0.
int push_quaternion(lua_State* L, const Eigen::Matrix3d& R);

}  // namespace cardan
