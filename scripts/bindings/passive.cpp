// Hybrid dynamics and components without actuator, as methods of s = sim:operators().
#include <fmt/format.h>

#include <algorithm>

#include "core/operators/hybrid.hpp"
#include "scripts/bindings/operator_methods.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

constexpr char kPassive[] = "cardan.passive";

/// s:bias(v): C - gravity - elastic forces at v
int bias(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const VectorXd v = tree.to_model(hinge_vector(L, 2, tree, "the velocities"));
  Workspace workspace(tree.model());
  push_vector(L, operators::bias(tree, workspace, {.v = v.data()}), hinge_labels(tree, Sort::force));
  return 1;
}
/// s:hybrid{bias = , tau = , vdot = }: of the free components tau is read, of the others v'
int hybrid(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  if (lua_type(L, 2) != LUA_TTABLE) refuse(L, Code::lua_argument, "hybrid", "a table {bias = , tau = , vdot = }", describe_value(L, 2));
  VectorXd parts[3] = {VectorXd::Zero(tree.size(Space::hinge)), VectorXd::Zero(tree.size(Space::hinge)),
                       VectorXd::Zero(tree.size(Space::hinge))};
  constexpr const char* keys[] = {"bias", "tau", "vdot"};
  for_each_key(L, 2, [&](int key_at, int value) {
    const std::string key = lua_type(L, key_at) == LUA_TSTRING ? lua_tostring(L, key_at) : "";
    const auto k = std::find(std::begin(keys), std::end(keys), key) - std::begin(keys);
    if (k == 3) refuse(L, Code::unknown_key, "hybrid", "bias, tau, vdot", describe_value(L, key_at));
    parts[k] = finite_vector(L, value, parts[k].size(), ("hybrid." + key).c_str());
  });
  const operators::Hybrid h = operators::hybrid_dynamics(tree, parts[0], parts[1], parts[2]);
  lua_newtable(L);
  push_vector(L, h.vdot, hinge_labels(tree, Sort::motion)), set(L, "vdot");
  push_vector(L, h.tau, hinge_labels(tree, Sort::force)), set(L, "tau");
  return 1;
}

struct LuaPassive {
  std::shared_ptr<TreeOperators> tree;  // free = the passive components
  std::unique_ptr<operators::Unactuated> system;
};
LuaPassive& to_passive(lua_State* L) {
  if (auto* p = static_cast<LuaPassive*>(luaL_testudata(L, 1, kPassive))) return *p;
  refuse(L, Code::lua_argument, "passive", "the result of s:passive{...} or s:floating_base() before a colon", describe_value(L, 1));
}
int push_passive(lua_State* L, std::shared_ptr<TreeOperators> tree) {
  auto system = std::make_unique<operators::Unactuated>(*tree);
  push_object<LuaPassive>(L, kPassive, std::move(tree), std::move(system));
  return 1;
}
int passive(lua_State* L) { return push_passive(L, articulated_for(L, tree_of(L), names_at(L, 2, "passive"), "passive")); }
int floating_base(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  auto part = articulated_for(L, tree, {}, "floating_base");
  part->articulate({.free = operators::base_mask(tree)});
  return push_passive(L, std::move(part));
}
int passive_velocities(lua_State* L) {
  const LuaPassive& p = to_passive(L);
  const VectorXd v = hinge_vector(L, 2, *p.tree, "the velocities");
  const VectorXd momenta = lua_isnoneornil(L, 3) ? VectorXd() : hinge_vector(L, 3, *p.tree, "the momenta");
  push_vector(L, p.system->velocities(v, momenta), velocity_labels_of(*p.tree));
  return 1;
}
int passive_jacobian(lua_State* L) {
  const LuaPassive& p = to_passive(L);
  const std::vector<int> nodes = nodes_at(L, 2, p.tree->model());
  push_matrix(L, p.system->generalised_jacobian({.nodes = nodes, .T = {}}), to_labels(p.tree->node_labels(nodes, Sort::motion)),
              hinge_labels(*p.tree, Sort::motion));
  return 1;
}
int passive_forces(lua_State* L) {
  const LuaPassive& p = to_passive(L);
  push_vector(L, p.system->reduced_forces(hinge_vector(L, 2, *p.tree, "the forces")), hinge_labels(*p.tree, Sort::force));
  return 1;
}
int passive_mass(lua_State* L) {
  const LuaPassive& p = to_passive(L);
  push_vector(L, p.system->reduced_mass_times(hinge_vector(L, 2, *p.tree, "the accelerations")), hinge_labels(*p.tree, Sort::force));
  return 1;
}
int passive_coupling(lua_State* L) {
  const LuaPassive& p = to_passive(L);
  push_matrix(L, p.system->coupling(), hinge_labels(*p.tree, Sort::motion), hinge_labels(*p.tree, Sort::motion));
  return 1;
}
int passive_text(lua_State* L) {
  const LuaPassive& p = to_passive(L);
  int n = 0;
  for (int i = 0; i < p.tree->size(Space::hinge); ++i) n += p.tree->is_free(i);
  lua_pushstring(L, fmt::format("{} components without actuator among {}", n, p.tree->size(Space::hinge)).c_str());
  return 1;
}

const std::vector<luaL_Reg> kPassiveMethods = {{"velocities", placed<passive_velocities, 2>},
                                               {"jacobian", placed<passive_jacobian>},
                                               {"forces", placed<passive_forces, 1>},
                                               {"mass", placed<passive_mass, 1>},
                                               {"coupling", placed<passive_coupling, 0>}};

}  // namespace

const std::vector<luaL_Reg>& passive_methods() {
  static const std::vector<luaL_Reg> all = {
      {"bias", placed<bias, 1>}, {"hybrid", placed<hybrid, 1>}, {"passive", placed<passive>}, {"floating_base", placed<floating_base, 0>}};
  return all;
}

void make_passive_type(lua_State* L) { make_type<LuaPassive>(L, kPassive, kPassiveMethods, placed<passive_text>); }

}  // namespace cardan
