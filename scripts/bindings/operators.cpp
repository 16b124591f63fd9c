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
      if (operators::kKinds[k].name == name) return push_operator(L, Expression::leaf(o.letters, static_cast<operators::Kind>(k)));
    if (name == "I") return push_operator(L, Expression::unit(o.letters));
    for (const Expression::Named& f : Expression::named())
      if (f.name == name) return push_operator(L, f.of(o.letters));
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
  const std::string bodies = o.tree ? fmt::format("{} bodies", o.tree->bodies().size())
                                    : fmt::format("{} bodies in {}", o.compounds->bodies().size(), o.compounds->count());
  lua_pushstring(L, fmt::format("operators of {}: {}, hinge space {}, body space {}, {} nodes", o.of, bodies, o.letters->size(Space::hinge),
                                o.letters->size(Space::body), o.letters->nodes().size())
                        .c_str());
  return 1;
}

int push_part(lua_State* L, const std::vector<int>& bodies, std::string of) {
  auto part = std::make_shared<TreeOperators>(tree_of(L).subgraph(bodies));
  part->articulate();
  push_tree(L, std::move(part), std::move(of), to_operators(L).at);
  return 1;
}
int subtree(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const std::vector<int> bodies = tree.subtree(sweep_body(L, 2, tree.model(), "subtree"));
  return push_part(L, bodies, fmt::format("the subtree of {}", lua_tostring(L, 2)));
}
int path(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const Model& m = tree.model();
  const std::vector<int> bodies = tree.path(sweep_body(L, 2, m, "path"), sweep_body(L, 3, m, "path"));
  return push_part(L, bodies, fmt::format("the path from {} to {}", lua_tostring(L, 2), lua_tostring(L, 3)));
}
int subgraph(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const std::vector<std::string> names = names_at(L, 2, "subgraph");
  std::vector<int> bodies;
  for (const std::string& name : names) {
    lua_pushstring(L, name.c_str());
    bodies.push_back(sweep_body(L, lua_gettop(L), tree.model(), "subgraph"));
    lua_pop(L, 1);
  }
  if (bodies.empty()) refuse(L, Code::lua_argument, "subgraph", "the names of bodies", "none");
  return push_part(L, bodies, fmt::format("{}", fmt::join(names, ", ")));
}

/// s:nodes("bus.tip", ...) -> B of these nodes
int nodes(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  return push_operator(L, Expression::nodes(o.letters, nodes_at(L, 2, o.letters->model())));
}

/// s:articulate{free = {"arm.angle", ...}, W = vector}: P, D, G anew.
int articulate(lua_State* L) {
  LuaOperators& o = to_operators(L);
  const int n = o.letters->size(Space::hinge);
  Eigen::VectorXd W;
  std::vector<std::uint8_t> free;
  if (!lua_isnoneornil(L, 2)) {
    if (lua_type(L, 2) != LUA_TTABLE) refuse(L, Code::lua_argument, "articulate", "a table {free = ..., W = ...}", describe_value(L, 2));
    for_each_key(L, 2, [&](int key_at, int value) {
      const std::string key = lua_type(L, key_at) == LUA_TSTRING ? lua_tostring(L, key_at) : "";
      if (key == "W")
        W = finite_vector(L, value, n, "W of articulate");
      else if (key == "free")
        free = component_mask(L, *o.letters, names_at(L, value, "free of articulate"), "free of articulate");
      else
        refuse(L, Code::lua_argument, "articulate", "free, W", describe_value(L, key_at));
    });
  }
  o.letters->articulate({.W = W.size() > 0 ? W.data() : nullptr, .free = free});
  return 0;
}
int operational_space(lua_State* L) {
  to_operators(L).letters->operational_space();
  return 0;
}
/// s:along(u): dH, dE_phi, dM where q moves by N(q) u; u: a vector over v, or the name of a component (of several: their sum).
int along(lua_State* L) {
  LuaOperators& o = to_operators(L);
  Eigen::VectorXd u = Eigen::VectorXd::Zero(o.letters->model().nv);
  if (lua_type(L, 2) == LUA_TSTRING) {
    const std::vector<std::uint8_t> one = component_mask(L, *o.letters, {lua_tostring(L, 2)}, "along");
    for (int v = 0; v < o.letters->model().nv; ++v)
      if (const int place = o.letters->place_of_velocity(v); place >= 0 && one[static_cast<std::size_t>(place)]) u[v] = 1.0;
  } else
    u = finite_vector(L, 2, u.size(), "the direction of along");
  o.letters->along(u.data());
  return 0;
}
int log_det(lua_State* L) {
  lua_pushnumber(L, to_operators(L).letters->log_det());
  return 1;
}
/// The compound bodies of more than one body: {bodies, home, loops, independent}, names.
int compounds(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  lua_newtable(L);
  if (!o.compounds) return 1;
  const operators::CompoundTree& tree = *o.compounds;
  const Model& m = tree.model();
  const std::vector<std::string> names = tree.labels(Space::hinge, Sort::motion).names;
  const auto name = [&](int i) {
    return i < 0 ? std::string("world") : m.user[static_cast<std::size_t>(tree.bodies()[static_cast<std::size_t>(i)].user)].name;
  };
  const auto put = [&](const char* key, std::size_t n, const auto& text) {
    lua_createtable(L, static_cast<int>(n), 0);
    for (std::size_t i = 0; i < n; ++i) {
      lua_pushstring(L, text(i).c_str());
      lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
    }
    lua_setfield(L, -2, key);
  };
  lua_Integer n = 0;
  for (const operators::Compound& c : tree.compounds()) {
    if (c.loops.empty()) continue;
    lua_newtable(L);
    put("bodies", c.members.size(), [&](std::size_t i) { return name(c.members[i]); });
    put("loops", c.loops.size(), [&](std::size_t i) { return m.loops.all[static_cast<std::size_t>(c.loops[i])].name; });
    put("independent", static_cast<std::size_t>(c.n), [&](std::size_t i) { return names[static_cast<std::size_t>(c.v) + i]; });
    lua_pushstring(L, name(c.home).c_str());
    lua_setfield(L, -2, "home");
    lua_rawseti(L, -2, ++n);
  }
  return 1;
}
/// Of argument 2.
Space space_at(lua_State* L, const char* what, const char* fallback) {
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : fallback;
  if (name == "hinge") return Space::hinge;
  if (name == "body") return Space::body;
  if (name == "node") return Space::node;
  if (name == "rate") return Space::rate;
  refuse(L, Code::lua_argument, what, "\"hinge\", \"body\", \"node\" or \"rate\"", describe_value(L, 2));
}
int size(lua_State* L) {
  lua_pushinteger(L, to_operators(L).letters->size(space_at(L, "size", "")));
  return 1;
}
/// Names of the numbers of a space, in order.
int names(lua_State* L) {
  const operators::SpaceLabels l = to_operators(L).letters->labels(space_at(L, "names", "hinge"), Sort::motion);
  lua_createtable(L, static_cast<int>(l.names.size()), 0);
  for (std::size_t i = 0; i < l.names.size(); ++i) {
    lua_pushstring(L, l.names[i].c_str());
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
  return 1;
}

template <Study kStudy>
int study_of_operators(lua_State* L) {
  return kStudy(L, tree_of(L), *to_operators(L).at);
}

const std::vector<luaL_Reg> kOperatorsMethods = {{"subtree", placed<subtree, 1>},
                                                 {"path", placed<path, 2>},
                                                 {"subgraph", placed<subgraph, 1>},
                                                 {"nodes", placed<nodes>},
                                                 {"along", placed<along, 1>},
                                                 {"articulate", placed<articulate, 1>},
                                                 {"operational_space", placed<operational_space, 0>},
                                                 {"log_det", placed<log_det, 0>},
                                                 {"compounds", placed<compounds, 0>},
                                                 {"size", placed<size, 1>},
                                                 {"names", placed<names, 1>},
                                                 {"linearize", placed<study_of_operators<linear_model>, 1>},
                                                 {"derivatives", placed<study_of_operators<derivatives_study>, 1>},
                                                 {"system_modes", placed<study_of_operators<system_modes_study>, 1>},
                                                 {"inverse_kinematics", placed<study_of_operators<inverse_kinematics_study>, 1>},
                                                 {"interbody_forces", placed<study_of_operators<interbody_forces_study>, 1>}};

}  // namespace

int push_operators(lua_State* L, Scenario& s) {
  const std::string stage = lua_isnoneornil(L, 2) ? "inertia" : lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  if (stage != "position" && stage != "inertia")
    refuse(L, Code::lua_argument, "operators", "no argument, or the last stage to compute: \"position\", \"inertia\"",
           describe_value(L, 2));
  require_a_state(L, s, "operators");
  const std::shared_ptr<const Model> model = s.sim ? s.sim->shared_model() : s.model;
  LuaHost::charge(L, 200 * (6LL * static_cast<std::int64_t>(model->bodies.size()) + model->nv + 1));
  auto at = std::make_shared<const OperatingState>(present_state(s));
  if (model->loops.empty()) {
    auto tree = tree_of_now(L, s, "operators");
    if (stage == "inertia") tree->articulate();
    push_tree(L, std::move(tree), "the whole tree", std::move(at));
    return 1;
  }
  auto tree = std::make_shared<operators::CompoundTree>(model);
  tree->at(s.q, at->drives.empty() ? nullptr : at->drives.data());
  if (stage == "inertia") tree->articulate();
  push_object<LuaOperators>(L, kOperators, tree, "the tree of compound bodies", std::move(at), nullptr, tree);
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
