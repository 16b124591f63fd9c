#include "scripts/bindings/operator_methods.hpp"

#include <fmt/format.h>

#include "core/base/units.hpp"
#include "core/model/components.hpp"

namespace cardan {

using Eigen::VectorXd;

const std::shared_ptr<TreeOperators>& shared_tree_of(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  if (o.tree) return o.tree;
  std::vector<std::string> loops;
  for (const Loop& loop : o.letters->model().loops.all) loops.push_back(loop.name);
  refuse(
      L, Code::unsupported, "operators",
      "an open tree: of closed loops operators() has letters, nodes, along, articulate, operational_space, log_det, compounds, size, names",
      fmt::format("loops: {}", fmt::join(loops, ", ")),
      "closed_system() has the analyses, and open_tree() of it the tree without its loops");
}
void push_tree(lua_State* L, std::shared_ptr<TreeOperators> tree, std::string of, std::shared_ptr<const OperatingState> at) {
  push_object<LuaOperators>(L, kOperators, tree, std::move(of), std::move(at), tree);
}
TreeOperators& tree_with_Y(lua_State* L) {
  TreeOperators& tree = tree_of(L);
  if (!tree.has(operators::Stage::operational_space)) tree.operational_space();
  return tree;
}

Labels hinge_labels(const TreeOperators& tree, Sort sort) { return to_labels(tree.labels(Space::hinge, sort)); }
Labels names_alone(const TreeOperators& tree) { return {tree.labels(Space::hinge, Sort::unknown).names, {}}; }
Labels velocity_labels_of(const TreeOperators& tree) {
  Labels out = hinge_labels(tree, Sort::motion);
  for (std::string& unit : out.units)
    if (unit.ends_with("^2")) unit.resize(unit.size() - 2);
  return out;
}
VectorXd hinge_vector(lua_State* L, int arg, const TreeOperators& tree, const char* what) {
  return finite_vector(L, arg, tree.size(Space::hinge), what);
}

std::shared_ptr<TreeOperators> articulated_for(lua_State* L, const TreeOperators& tree, const std::vector<std::string>& names,
                                               const char* what) {
  std::vector<int> bodies;
  for (const operators::OperatorBody& b : tree.bodies()) bodies.push_back(b.sweep);
  auto part = std::make_shared<TreeOperators>(tree.subgraph(bodies));
  part->articulate({.free = component_mask(L, tree, names, what)});
  return part;
}

Eigen::VectorXd finite_vector(lua_State* L, int index, Eigen::Index size, const char* what) {
  Eigen::VectorXd x = to_vector(L, index, size, what);
  if (!x.allFinite()) refuse(L, Code::not_finite, what, "finite numbers", "some that are not");
  return x;
}

Labels to_labels(operators::SpaceLabels l) { return {std::move(l.names), std::move(l.units)}; }

std::vector<std::string> names_at(lua_State* L, int first, const char* what) {
  std::vector<std::string> names;
  const bool in_table = lua_type(L, first) == LUA_TTABLE;
  const int n = in_table ? static_cast<int>(lua_rawlen(L, first)) : lua_gettop(L) - first + 1;
  for (int i = 0; i < n; ++i) {
    if (in_table)
      lua_rawgeti(L, first, i + 1);
    else
      lua_pushvalue(L, first + i);
    if (lua_type(L, -1) != LUA_TSTRING) refuse(L, Code::lua_argument, what, "names", describe_value(L, -1));
    names.emplace_back(lua_tostring(L, -1));
    lua_pop(L, 1);
  }
  return names;
}

std::vector<int> node_indices(lua_State* L, const std::vector<std::string>& names, const Model& m) {
  std::vector<std::string> known;
  for (const UserNode& n : m.nodes) known.push_back(n.name);
  std::vector<int> out;
  for (const std::string& name : names) {
    const int j = m.find_node(name);
    if (j < 0)
      refuse(L, Code::unknown_node, "nodes", fmt::format("nodes of the vehicle: {}", fmt::join(known, ", ")), in_quotes(name),
             did_you_mean(name, known));
    out.push_back(j);
  }
  return out;
}

std::vector<int> components_at(lua_State* L, const Model& m, const std::string& name, const char* what) {
  std::vector<int> found = components_of(m, name);
  if (found.empty())
    refuse(L, Code::unknown_name, what, fmt::format("a component, or a body for all of its hinge: {}", fmt::join(component_names(m), ", ")),
           in_quotes(name), did_you_mean(name, component_names(m)));
  return found;
}

std::vector<std::uint8_t> component_mask(lua_State* L, const operators::SpatialOperators& tree, const std::vector<std::string>& names,
                                         const char* what) {
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(tree.size(Space::hinge)), 0);
  for (const std::string& name : names) {
    bool takes_part = false;
    for (const int v : components_at(L, tree.model(), name, what))
      if (const int place = tree.place_of_velocity(v); place >= 0) mask[static_cast<std::size_t>(place)] = 1, takes_part = true;
    if (!takes_part)
      refuse(L, Code::unknown_name, what,
             fmt::format("{}: {}", tree.model().loops.empty() ? "a component of the bodies that take part" : "an independent component",
                         fmt::join(tree.labels(Space::hinge, Sort::motion).names, ", ")),
             in_quotes(name));
  }
  return mask;
}

int at_script_line(lua_State* L, const std::function<int(lua_State*)>& function) {
  try {
    return function(L);
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) {
      if (!d.at.mark.file.empty()) continue;
      d.at.mark = LuaHost::caller(L);
      d.stack = LuaHost::traceback(L);
    }
    throw InputError(all);
  }
}

LuaOperators& to_operators(lua_State* L) {
  if (auto* o = static_cast<LuaOperators*>(luaL_testudata(L, 1, kOperators))) return *o;
  refuse(L, Code::lua_argument, "operators", "the result of operators() before a colon", describe_value(L, 1),
         "s = sim:operators(); s:subtree(\"boom\")");
}

OperatingState present_state(const Scenario& s) {
  OperatingState out = operating_state(*s.sim);
  out.seed = s.seed;
  return out;
}

void require_a_state(lua_State* L, const Scenario& s, const char* what) {
  if (s.in_event_function) refuse(L, Code::lua_argument, what, "coordinates, inside of an event's `when`", what);
}

std::shared_ptr<TreeOperators> tree_of_now(lua_State* L, Scenario& s, const char* what) {
  require_a_state(L, s, what);
  auto tree = std::make_shared<TreeOperators>(s.sim ? s.sim->shared_model() : s.model);
  tree->at(s.q);
  return tree;
}

int study_of_now(lua_State* L, Scenario& s, const char* what, Study study) {
  const auto tree = tree_of_now(L, s, what);
  return study(L, *tree, present_state(s));
}

}  // namespace cardan
