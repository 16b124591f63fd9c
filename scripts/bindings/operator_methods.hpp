#pragma once
// What the files that bind spatial operators, and what is asked of them, share.
#include <functional>
#include <new>
#include <utility>

#include "core/operators/closed_system.hpp"
#include "core/operators/compound_tree.hpp"
#include "core/operators/expression.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/sim/operating_state.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/matrix.hpp"
#include "scripts/lua/sandbox.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

using operators::Sort, operators::Space, operators::TreeOperators;

/// As the scene stands.
OperatingState present_state(const Scenario&);
/// The operators of a tree, or of a part of it, or of the tree of compound bodies that closed loops leave.
struct LuaOperators {
  std::shared_ptr<operators::SpatialOperators> letters;
  std::string of;  // "the whole tree", "the subtree of boom"
  std::shared_ptr<const OperatingState> at;
  std::shared_ptr<TreeOperators> tree = nullptr;                 // the same, where it is a tree
  std::shared_ptr<operators::CompoundTree> compounds = nullptr;  // ... or one of compound bodies
};
void push_tree(lua_State* L, std::shared_ptr<TreeOperators> tree, std::string of, std::shared_ptr<const OperatingState> at);
/// What can be asked of a tree or a part of it at a state; arguments from the second on.
using Study = int (*)(lua_State*, const TreeOperators&, const OperatingState&);
/// Refuses to look while a function of an event is evaluated.
void require_a_state(lua_State* L, const Scenario&, const char* what);
/// The whole tree where the scene is now.
std::shared_ptr<TreeOperators> tree_of_now(lua_State* L, Scenario&, const char* what);
/// Of the whole tree, now.
int study_of_now(lua_State* L, Scenario&, const char* what, Study study);
inline constexpr char kOperators[] = "cardan.operators";  // the type of the userdata that holds one
/// Argument 1.
LuaOperators& to_operators(lua_State* L);
Labels to_labels(operators::SpaceLabels l);
/// As to_vector, and finite: what is not a number would go on quietly.
Eigen::VectorXd finite_vector(lua_State* L, int index, Eigen::Index size, const char* what);

/// Texts of the table at `first`, or the arguments from there on.
std::vector<std::string> names_at(lua_State* L, int first, const char* what);
/// Indices into Model::nodes.
std::vector<int> node_indices(lua_State* L, const std::vector<std::string>& names, const Model&);
inline std::vector<int> nodes_at(lua_State* L, int first, const Model& m) { return node_indices(L, names_at(L, first, "nodes"), m); }
/// Velocity components of the model that a name stands for (core/model/components.hpp); C0208 if there are none.
std::vector<int> components_at(lua_State* L, const Model&, const std::string& name, const char* what);
/// 1 for these components of the tree.
std::vector<std::uint8_t> component_mask(lua_State* L, const operators::SpatialOperators&, const std::vector<std::string>& names,
                                         const char* what);

/// f(key, value), indices on the stack, for each entry of the table at `index` in the order of `pairs`: which fault is told first
/// does not depend on hashes.
template <class F>
void for_each_key(lua_State* L, int index, F&& f) {
  const int table = lua_absindex(L, index);
  const lua_Integer n = push_keys(L, table);
  const int keys = lua_gettop(L);
  for (lua_Integer i = 1; i <= n; ++i) {
    lua_rawgeti(L, keys, i);
    lua_pushvalue(L, -1);
    lua_rawget(L, table);
    f(keys + 1, keys + 2);
    lua_settop(L, keys);
  }
  lua_settop(L, keys - 1);
}

/// The value at the top, or a number, into the table below it.
inline void set(lua_State* L, const char* key) { lua_setfield(L, -2, key); }
inline void set_number(lua_State* L, const char* key, double x) {
  lua_pushnumber(L, x);
  lua_setfield(L, -2, key);
}

/// A C++ object as a userdata of `type`, whose __gc is collect<T>.
template <class T, class... Args>
void push_object(lua_State* L, const char* type, Args&&... args) {
  void* memory = lua_newuserdatauv(L, sizeof(T), 0);
  new (memory) T{std::forward<Args>(args)...};
  luaL_setmetatable(L, type);
}
template <class T>
int collect(lua_State* L) {
  static_cast<T*>(lua_touserdata(L, 1))->~T();
  return 0;
}

/// A method whose errors, which know no script, are given its line.
int at_script_line(lua_State* L, const std::function<int(lua_State*)>& function);
template <lua_CFunction kFunction>
int placed(lua_State* L) {
  return LuaHost::guarded(L, [](lua_State* l) { return at_script_line(l, kFunction); });
}
/// The same of one that takes at most so many arguments.
template <lua_CFunction kFunction, int kArguments>
int placed(lua_State* L) {
  return placed<limited<kFunction, kArguments>>(L);
}

/// The tree of argument 1, refused where it is one of compound bodies; with Y, which is made when it is first needed.
const std::shared_ptr<TreeOperators>& shared_tree_of(lua_State* L);
inline TreeOperators& tree_of(lua_State* L) { return *shared_tree_of(L); }
TreeOperators& tree_with_Y(lua_State* L);
/// A part of the tree of its own, at the same q, whose free components are those that are named.
std::shared_ptr<TreeOperators> articulated_for(lua_State* L, const TreeOperators& tree, const std::vector<std::string>& names,
                                               const char* what);
/// A finite vector over the velocity components of the tree.
Eigen::VectorXd hinge_vector(lua_State* L, int arg, const TreeOperators& tree, const char* what);

Labels hinge_labels(const TreeOperators& tree, operators::Sort sort);
/// Of what has no unit of its own: nu, shares, inertias of mixed kinds.
Labels names_alone(const TreeOperators& tree);
/// Of velocities, where labels of motion are those of accelerations.
Labels velocity_labels_of(const TreeOperators& tree);

/// Makes a type of userdata that holds a T.
template <class T>
void make_type(lua_State* L, const char* type, const std::vector<luaL_Reg>& methods, lua_CFunction text) {
  make_handle_type(L, type, methods, text);
  luaL_getmetatable(L, type);
  lua_pushcfunction(L, collect<T>);
  lua_setfield(L, -2, "__gc");
  lua_pop(L, 1);
}

// More methods of operators(), and the types of what they return; each in the file of its name.
const std::vector<luaL_Reg>& task_methods();          // compliance, task spaces, effective inertia
const std::vector<luaL_Reg>& momentum_methods();      // mass properties, momentum, inertia felt at hinges
const std::vector<luaL_Reg>& passive_methods();       // hybrid dynamics, components without actuator
const std::vector<luaL_Reg>& diagonalised_methods();  // log det M, diagonalised velocities
/// The task space of the table at index 2; of a closed system, whose tree this is then, where there is one.
int push_task(lua_State* L, std::shared_ptr<const TreeOperators> tree, std::shared_ptr<const operators::ClosedSystem> closed);
void make_task_type(lua_State* L);
void make_passive_type(lua_State* L);
void make_diagonalised_type(lua_State* L);
void make_closed_system_type(lua_State* L);
void make_operator_type(lua_State* L);  // operator.cpp: one operator, a formula of letters
int push_operator(lua_State* L, operators::Expression e);

}  // namespace cardan
