// Spatial operators in scripts: sim:operators() gives the letters at the present state, and they compose as on paper:
//   local s = sim:operators()
//   local tau = s.H * s.phi * s.M * s.phi:star() * s.H:star() * vdot
// Expressions are matrix-free values (core/operators/expression.hpp); vectors and matrices are those of scripts/lua/matrix.hpp.
#include "scripts/bindings/operators.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/units.hpp"
#include "core/operators/expression.hpp"
#include "scripts/bindings/linear.hpp"
#include "scripts/bindings/operator_methods.hpp"
#include "scripts/bindings/studies.hpp"

namespace cardan {
namespace {

using operators::Expression;

int sweep_body(lua_State* L, int arg, const Model& m, const char* what) {
  std::vector<std::string> names;
  for (const UserBody& u : m.user) names.push_back(u.name);
  const std::string name = lua_type(L, arg) == LUA_TSTRING ? lua_tostring(L, arg) : "";
  const int body = m.find_body(name);
  if (name.empty() || body < 0)
    refuse(L, Code::unknown_body, what, fmt::format("a body of the vehicle: {}", fmt::join(names, ", ")), describe_value(L, arg),
           did_you_mean(name, names));
  const int k = m.user[static_cast<std::size_t>(body)].sweep;
  if (k == 0) refuse(L, Code::unknown_body, what, "a body that can move", in_quotes(name) + ", fixed to the world");
  return k;
}

/// Letters and methods, sorted.
std::vector<std::string> known_names(lua_State* L, int methods) {
  std::vector<std::string> known = {"I"};
  for (const Expression::Named& f : Expression::named()) known.emplace_back(f.name);
  for (const operators::KindFacts& f : operators::kKinds) known.emplace_back(f.name);
  for (lua_pushnil(L); lua_next(L, methods); lua_pop(L, 1)) known.emplace_back(lua_tostring(L, -2));
  std::sort(known.begin(), known.end());
  return known;
}

int operators_index(lua_State* L) {
  LuaOperators& o = to_operators(L);
  if (lua_type(L, 2) == LUA_TSTRING) {
    const std::string_view name = lua_tostring(L, 2);
    for (std::size_t k = 0; k < std::size(operators::kKinds); ++k)
      if (operators::kKinds[k].name == name) return push_operator(L, Expression::leaf(o.tree, static_cast<operators::Kind>(k)));
    if (name == "I") return push_operator(L, Expression::unit(o.tree));
    for (const Expression::Named& f : Expression::named())
      if (f.name == name) return push_operator(L, f.of(o.tree));
    lua_pushvalue(L, 2);
    if (lua_rawget(L, lua_upvalueindex(1)) != LUA_TNIL) return 1;
    lua_pop(L, 1);
  }
  const std::vector<std::string> known = known_names(L, lua_upvalueindex(1));
  refuse(L, Code::unknown_name, "operators", fmt::format("one of {}", fmt::join(known, ", ")), describe_value(L, 2),
         lua_type(L, 2) == LUA_TSTRING ? did_you_mean(lua_tostring(L, 2), known) : "");
}

int operators_text(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  lua_pushstring(L, fmt::format("operators of {}: {} bodies, hinge space {}, body space {}, {} nodes", o.of, o.tree->bodies().size(),
                                o.tree->size(Space::hinge), o.tree->size(Space::body), o.tree->nodes().size())
                        .c_str());
  return 1;
}

int push_part(lua_State* L, const LuaOperators& o, const std::vector<int>& bodies, std::string of) {
  auto part = std::make_shared<TreeOperators>(o.tree->subgraph(bodies));
  part->articulate();
  push_object<LuaOperators>(L, kOperators, std::move(part), std::move(of), o.at);
  return 1;
}
int subtree(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const std::vector<int> bodies = o.tree->subtree(sweep_body(L, 2, o.tree->model(), "subtree"));
  return push_part(L, o, bodies, fmt::format("the subtree of {}", lua_tostring(L, 2)));
}
int path(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const Model& m = o.tree->model();
  const std::vector<int> bodies = o.tree->path(sweep_body(L, 2, m, "path"), sweep_body(L, 3, m, "path"));
  return push_part(L, o, bodies, fmt::format("the path from {} to {}", lua_tostring(L, 2), lua_tostring(L, 3)));
}
int subgraph(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  const std::vector<std::string> names = names_at(L, 2, "subgraph");
  std::vector<int> bodies;
  for (const std::string& name : names) {
    lua_pushstring(L, name.c_str());
    bodies.push_back(sweep_body(L, lua_gettop(L), o.tree->model(), "subgraph"));
    lua_pop(L, 1);
  }
  if (bodies.empty()) refuse(L, Code::lua_argument, "subgraph", "the names of bodies", "none");
  return push_part(L, o, bodies, fmt::format("{}", fmt::join(names, ", ")));
}

/// s:nodes("bus.tip", ...) -> B of these nodes
int nodes(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  return push_operator(L, Expression::nodes(o.tree, nodes_at(L, 2, o.tree->model())));
}

/// s:articulate{free = {"arm.angle", ...}, W = vector}: P, D, G anew.
int articulate(lua_State* L) {
  LuaOperators& o = to_operators(L);
  const int n = o.tree->size(Space::hinge);
  Eigen::VectorXd W;
  std::vector<std::uint8_t> free;
  if (!lua_isnoneornil(L, 2)) {
    if (lua_type(L, 2) != LUA_TTABLE) refuse(L, Code::lua_argument, "articulate", "a table {free = ..., W = ...}", describe_value(L, 2));
    for_each_key(L, 2, [&](int key_at, int value) {
      const std::string key = lua_type(L, key_at) == LUA_TSTRING ? lua_tostring(L, key_at) : "";
      if (key == "W")
        W = finite_vector(L, value, n, "W of articulate");
      else if (key == "free")
        free = component_mask(L, *o.tree, names_at(L, value, "free of articulate"), "free of articulate");
      else
        refuse(L, Code::lua_argument, "articulate", "free, W", describe_value(L, key_at));
    });
  }
  o.tree->articulate({.W = W.size() > 0 ? W.data() : nullptr, .free = free});
  return 0;
}
int operational_space(lua_State* L) {
  to_operators(L).tree->operational_space();
  return 0;
}
/// s:along(u): dH, dE_phi, dM where q moves by N(q) u; u: a vector over v, or the name of a component (of several: their sum).
int along(lua_State* L) {
  LuaOperators& o = to_operators(L);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(o.tree->model().nv);
  if (lua_type(L, 2) == LUA_TSTRING) {
    const std::vector<std::uint8_t> one = component_mask(L, *o.tree, {lua_tostring(L, 2)}, "along");
    for (int v = 0; v < o.tree->model().nv; ++v)
      if (const int place = o.tree->place_of_velocity(v); place >= 0 && one[static_cast<std::size_t>(place)]) u[v] = 1.0;
  } else
    u = finite_vector(L, 2, u.size(), "the direction of along");
  o.tree->along(u.data());
  return 0;
}
int log_det(lua_State* L) {
  lua_pushnumber(L, to_operators(L).tree->log_det());
  return 1;
}
/// Of argument 2.
Space space_at(lua_State* L, const char* what, const char* fallback) {
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : fallback;
  if (name != "hinge" && name != "body" && name != "node")
    refuse(L, Code::lua_argument, what, "\"hinge\", \"body\" or \"node\"", describe_value(L, 2));
  return name == "hinge" ? Space::hinge : name == "body" ? Space::body : Space::node;
}
int size(lua_State* L) {
  lua_pushinteger(L, tree_of(L).size(space_at(L, "size", "")));
  return 1;
}
/// Names of the numbers of a space, in order.
int names(lua_State* L) {
  const operators::SpaceLabels l = tree_of(L).labels(space_at(L, "names", "hinge"), Sort::motion);
  lua_createtable(L, static_cast<int>(l.names.size()), 0);
  for (std::size_t i = 0; i < l.names.size(); ++i) {
    lua_pushstring(L, l.names[i].c_str());
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
  return 1;
}

template <Study kStudy>
int study_of_operators(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  return kStudy(L, *o.tree, *o.at);
}

const std::vector<luaL_Reg> kOperatorsMethods = {{"subtree", placed<subtree>},
                                                 {"path", placed<path>},
                                                 {"subgraph", placed<subgraph>},
                                                 {"nodes", placed<nodes>},
                                                 {"along", placed<along>},
                                                 {"articulate", placed<articulate>},
                                                 {"operational_space", placed<operational_space>},
                                                 {"log_det", placed<log_det>},
                                                 {"size", placed<size>},
                                                 {"names", placed<names>},
                                                 {"linearize", placed<study_of_operators<linear_model>>},
                                                 {"derivatives", placed<study_of_operators<derivatives_study>>},
                                                 {"system_modes", placed<study_of_operators<system_modes_study>>},
                                                 {"inverse_kinematics", placed<study_of_operators<inverse_kinematics_study>>},
                                                 {"interbody_forces", placed<study_of_operators<interbody_forces_study>>}};

}  // namespace

int push_operators(lua_State* L, Scenario& s) {
  auto tree = tree_of_now(L, s, "operators");
  const std::string stage = lua_isnoneornil(L, 2) ? "inertia" : lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  if (stage != "position" && stage != "inertia")
    refuse(L, Code::lua_argument, "operators", "no argument, or the last stage to compute: \"position\", \"inertia\"",
           describe_value(L, 2));
  if (stage == "inertia") tree->articulate();
  LuaHost::charge(L, 200 * (tree->size(Space::body) + 1));
  push_object<LuaOperators>(L, kOperators, std::move(tree), "the whole tree", std::make_shared<const OperatingState>(present_state(s)));
  return 1;
}

void bind_operators(Scenario& s) {
  s.lua.protect([](lua_State* L) {
    make_operator_type(L);
    make_task_type(L);
    make_passive_type(L);
    make_diagonalised_type(L);
    make_closed_system_type(L);
    std::vector<luaL_Reg> methods = kOperatorsMethods;
    for (const auto& more : {task_methods(), momentum_methods(), passive_methods(), diagonalised_methods()})
      methods.insert(methods.end(), more.begin(), more.end());
    make_type<LuaOperators>(L, kOperators, methods, placed<operators_text>);
    luaL_getmetatable(L, kOperators);
    lua_getfield(L, -1, "__index");  // the table of methods: letters come first
    lua_pushvalue(L, -1);
    lua_pushcclosure(L, placed<operators_index>, 1);
    lua_setfield(L, -3, "__index");
    lua_newtable(L);  // what completion offers: methods, and letters
    for (const std::string& name : known_names(L, lua_absindex(L, -2))) {
      lua_pushstring(L, name.c_str());
      lua_pushvalue(L, -1);
      if (lua_rawget(L, -4) == LUA_TNIL) {
        lua_pop(L, 1);
        lua_pushboolean(L, 1);
      }
      lua_rawset(L, -3);
    }
    lua_setfield(L, -3, "__members");
    lua_pop(L, 2);
  });
}

}  // namespace cardan
