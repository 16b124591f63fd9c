// What is asked of the operators beyond their algebra, as methods of s = sim:operators(): operational space, momentum, mass
// properties, hybrid dynamics, log det M, diagonalised velocities. Formulas: docs/operators.md; all O(N) unless it is a matrix that
// is asked for.
#include <fmt/format.h>

#include <algorithm>

#include "core/base/units.hpp"
#include "core/operators/diagonalised.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/log_det.hpp"
#include "core/operators/operational_space.hpp"
#include "core/operators/system_properties.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/bindings/linear.hpp"
#include "scripts/bindings/operators.hpp"
#include "scripts/bindings/studies.hpp"
#include "scripts/lua/matrix.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;
using soa::Sort;
using soa::Space;
using soa::TreeOperators;

constexpr char kTask[] = "cardan.task", kPassive[] = "cardan.passive", kDiagonalised[] = "cardan.diagonalised";

TreeOperators& tree_of(lua_State* L) { return *to_operators(L).tree; }
/// With Y, which is made when it is first needed.
TreeOperators& tree_with_Y(lua_State* L) {
  TreeOperators& tree = tree_of(L);
  if (!tree.has(soa::Stage::operational_space)) tree.operational_space();
  return tree;
}

Labels hinge_labels(const TreeOperators& tree, Sort sort) { return to_labels(tree.labels(Space::hinge, sort)); }
/// Of what has no unit of its own: nu, shares, inertias of mixed kinds.
Labels names_alone(const TreeOperators& tree) { return {tree.labels(Space::hinge, Sort::unknown).names, {}}; }
Labels velocity_labels_of(const TreeOperators& tree) {
  Labels out = hinge_labels(tree, Sort::motion);
  for (std::string& unit : out.units)
    if (unit.ends_with("^2")) unit.resize(unit.size() - 2);
  return out;
}
VectorXd hinge_vector(lua_State* L, int arg, const TreeOperators& tree, const char* what) { return finite_vector(L, arg, tree.size(Space::hinge), what); }
Eigen::Matrix<double, 6, 1> six(lua_State* L, int arg, const char* what) { return finite_vector(L, arg, 6, what); }
const Labels kMomentum{{"hx", "hy", "hz", "px", "py", "pz"}, {"N m s", "N m s", "N m s", "N s", "N s", "N s"}};

Labels body_labels(const TreeOperators& tree) {
  Labels out;
  for (const soa::OperatorBody& b : tree.bodies()) out.names.push_back(tree.model().user[static_cast<std::size_t>(b.user)].name);
  return out;
}

/// A part of the tree of its own, at the same q, whose free components are those that are named.
std::shared_ptr<TreeOperators> articulated_for(lua_State* L, const TreeOperators& tree, const std::vector<std::string>& names, const char* what) {
  std::vector<int> bodies;
  for (const soa::OperatorBody& b : tree.bodies()) bodies.push_back(b.sweep);
  auto part = std::make_shared<TreeOperators>(tree.subgraph(bodies));
  part->articulate({.free = component_mask(L, tree, names, what)});
  return part;
}

// ---- operational space ---------------------------------------------------------------------------------------------------------------

int compliance(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const std::vector<int> nodes = nodes_at(L, 2, tree.model());
  LuaHost::charge(L, 2000LL * static_cast<long long>(nodes.size() * (nodes.size() + 1)));
  push_matrix(L, soa::compliance(tree, nodes), to_labels(tree.node_labels(nodes, Sort::motion)), to_labels(tree.node_labels(nodes, Sort::force)));
  return 1;
}

struct LuaTask {
  std::shared_ptr<TreeOperators> tree, passive;
  std::unique_ptr<soa::OperationalSpace> space;
  Labels motion, force;  // of its rows
};
LuaTask& to_task(lua_State* L) {
  if (auto* t = static_cast<LuaTask*>(luaL_testudata(L, 1, kTask))) return *t;
  refuse(L, Code::lua_argument, "task", "the result of s:task{...} before a colon", describe_value(L, 1));
}

/// s:task{nodes = {...}, rows = {1, 2, ...} or T = matrix, passive = {components}}
int task(lua_State* L) {
  LuaOperators& o = to_operators(L);
  tree_with_Y(L);
  DiagnosticSink sink;
  LuaTable table(L, 2, "task", sink);
  table.require({"nodes"});
  const auto names = table.texts("nodes");
  const auto rows = table.numbers("rows", 0);
  const auto passive = table.texts("passive");
  const bool has_T = table.has("T");
  table.finish();
  sink.throw_if_any();
  soa::Task task{.nodes = node_indices(L, *names, o.tree->model()), .T = {}};
  const soa::SpaceLabels motion = o.tree->node_labels(task.nodes, Sort::motion), force = o.tree->node_labels(task.nodes, Sort::force);
  auto out = LuaTask{o.tree, nullptr, nullptr, to_labels(motion), to_labels(force)};
  const int all = static_cast<int>(motion.names.size());
  if (rows && has_T) refuse(L, Code::lua_argument, "task", "rows or T", "both");
  if (rows) {
    std::vector<int> picked;
    out.motion = out.force = {};
    for (const double r : *rows) {
      const int i = static_cast<int>(r) - 1;
      if (i < 0 || i >= all || static_cast<double>(i + 1) != r) refuse(L, Code::out_of_range, "task.rows", fmt::format("1 ... {}", all), fmt::format("{:g}", r));
      picked.push_back(i);
      for (auto* l : {&out.motion, &out.force}) {
        const soa::SpaceLabels& from = l == &out.motion ? motion : force;
        l->names.push_back(from.names[static_cast<std::size_t>(i)]), l->units.push_back(from.units[static_cast<std::size_t>(i)]);
      }
    }
    task = soa::Task::of_rows(task.nodes, picked);
  } else if (has_T) {
    lua_getfield(L, 2, "T");
    task.T = to_matrix(L, lua_gettop(L), kAnySize, all, "task.T");
    lua_pop(L, 1);
    out.motion = out.force = {};
  }
  if (passive) {
    out.passive = articulated_for(L, *o.tree, *passive, "task.passive");
    out.passive->operational_space();
  }
  out.space = std::make_unique<soa::OperationalSpace>(*o.tree, std::move(task), out.passive.get());
  push_object<LuaTask>(L, kTask, std::move(out));
  return 1;
}
int task_compliance(lua_State* L) {
  const LuaTask& t = to_task(L);
  push_matrix(L, t.space->compliance(), t.motion, t.force);
  return 1;
}
int task_inertia(lua_State* L) {
  const LuaTask& t = to_task(L);
  push_matrix(L, t.space->inertia(), t.force, t.motion);
  return 1;
}
int task_rank(lua_State* L) {
  lua_pushinteger(L, to_task(L).space->rank());
  return 1;
}
int task_condition(lua_State* L) {
  lua_pushnumber(L, to_task(L).space->condition());
  return 1;
}
int task_rows(lua_State* L) {
  lua_pushinteger(L, to_task(L).space->rows());
  return 1;
}
/// Task space in, hinge space out, and back.
template <VectorXd (soa::OperationalSpace::*kMethod)(const VectorXd&) const, bool kTaskIn, bool kTaskOut, Sort kSort>
int task_map(lua_State* L) {
  const LuaTask& t = to_task(L);
  const VectorXd x = finite_vector(L, 2, kTaskIn ? t.space->rows() : t.tree->size(Space::hinge), "the vector");
  push_vector(L, (*t.space.*kMethod)(x), kTaskOut ? (kSort == Sort::force ? t.force : t.motion) : hinge_labels(*t.tree, kSort));
  return 1;
}
/// task:torque(F, tau_0) = J* F + N* tau_0
int task_torque(lua_State* L) {
  const LuaTask& t = to_task(L);
  const VectorXd F = finite_vector(L, 2, t.space->rows(), "the task force");
  const VectorXd tau_0 = lua_isnoneornil(L, 3) ? VectorXd(VectorXd::Zero(t.tree->size(Space::hinge))) : hinge_vector(L, 3, *t.tree, "the posture's forces");
  push_vector(L, t.space->torque(F, tau_0), hinge_labels(*t.tree, Sort::force));
  return 1;
}
/// task:bias(v) = Jdot v: accelerations of the task at v' = 0
int task_bias(lua_State* L) {
  const LuaTask& t = to_task(L);
  soa::Workspace<double> workspace(t.tree->model());
  push_vector(L, soa::task_bias(*t.tree, t.space->task(), workspace, hinge_vector(L, 2, *t.tree, "the velocities")), t.motion);
  return 1;
}
/// task:force_for(wanted, drift) = Lambda (wanted - drift)
int task_force_for(lua_State* L) {
  const LuaTask& t = to_task(L);
  const VectorXd wanted = finite_vector(L, 2, t.space->rows(), "the wanted acceleration");
  const VectorXd drift = lua_isnoneornil(L, 3) ? VectorXd(VectorXd::Zero(t.space->rows())) : finite_vector(L, 3, t.space->rows(), "the drift");
  push_vector(L, t.space->force_for(wanted, drift), t.force);
  return 1;
}
int task_require_full_rank(lua_State* L) {
  to_task(L).space->require_full_rank();
  return 0;
}
int task_text(lua_State* L) {
  const LuaTask& t = to_task(L);
  lua_pushstring(L, fmt::format("task of {} rows, rank {}, condition {:.3g}{}", t.space->rows(), t.space->rank(), t.space->condition(),
                                t.passive ? ", with passive components" : "").c_str());
  return 1;
}

int node_at(lua_State* L, int arg, const Model& m) {
  if (lua_type(L, arg) != LUA_TSTRING) refuse(L, Code::lua_argument, "node", "the name of a node", describe_value(L, arg));
  return node_indices(L, {lua_tostring(L, arg)}, m).front();
}
/// s:effective_inertia(node, {nx, ny, nz, fx, fy, fz})
int effective_inertia(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  lua_pushnumber(L, soa::effective_inertia(tree, node_at(L, 2, tree.model()), six(L, 3, "the direction")));
  return 1;
}
int manipulability(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const soa::Manipulability m = soa::manipulability(tree, {.nodes = nodes_at(L, 2, tree.model()), .T = {}});
  lua_newtable(L);
  push_vector(L, m.singular_values), set(L, "singular_values");
  set_number(L, "kinematic", m.kinematic), set_number(L, "dynamic", m.dynamic);
  return 1;
}
int participation(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const soa::Participation p = soa::participation(tree, node_at(L, 2, tree.model()), six(L, 3, "the direction"));
  const Labels names = names_alone(tree);
  lua_newtable(L);
  push_vector(L, p.shape, names), set(L, "shape");
  push_vector(L, p.response, names), set(L, "response");
  push_vector(L, p.share, names), set(L, "share");
  return 1;
}

// ---- mass properties and momentum -------------------------------------------------------------------------------------------------------

int mass_properties(lua_State* L) {
  const soa::MassProperties p = soa::mass_properties(tree_of(L));
  lua_newtable(L);
  set_number(L, "mass", p.mass);
  push_vector(L, p.com, {{"x", "y", "z"}, {"m", "m", "m"}}), set(L, "com");
  push_matrix(L, p.inertia, {{"x", "y", "z"}, {"kg m^2", "kg m^2", "kg m^2"}}), set(L, "inertia");
  return 1;
}
soa::About about_at(lua_State* L, int arg) {
  const std::string word = lua_isnoneornil(L, arg) ? "world" : lua_type(L, arg) == LUA_TSTRING ? lua_tostring(L, arg) : "";
  if (word != "world" && word != "com") refuse(L, Code::lua_argument, "momentum", "about \"world\" (default) or \"com\"", describe_value(L, arg));
  return word == "com" ? soa::About::mass_centre : soa::About::world_origin;
}
int momentum(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  push_vector(L, soa::momentum(tree, about_at(L, 3), hinge_vector(L, 2, tree, "the velocities")), kMomentum);
  return 1;
}
int momentum_matrix(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  push_matrix(L, soa::momentum_matrix(tree, about_at(L, 2)), kMomentum, velocity_labels_of(tree));
  return 1;
}
int momentum_sharing(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const soa::MomentumSharing m = soa::momentum_sharing(tree, hinge_vector(L, 2, tree, "the velocities"));
  lua_newtable(L);
  push_matrix(L, m.bodies, kMomentum, body_labels(tree)), set(L, "bodies");
  push_vector(L, m.total, kMomentum), set(L, "total");
  if (m.angular.size() > 0) push_vector(L, m.angular, body_labels(tree)), set(L, "angular");
  if (m.linear.size() > 0) push_vector(L, m.linear, body_labels(tree)), set(L, "linear");
  return 1;
}
int reflected_inertia(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const soa::ReflectedInertia r = soa::reflected_inertia(tree);
  const Labels names = names_alone(tree);
  lua_newtable(L);
  push_vector(L, r.others_locked, names), set(L, "others_locked");
  push_vector(L, r.outboard_free, names), set(L, "outboard_free");
  push_vector(L, r.others_free, names), set(L, "others_free");
  return 1;
}

// ---- hybrid dynamics, passive components ---------------------------------------------------------------------------------------------------

/// s:bias(v): C - gravity - elastic forces at v
int bias(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  const VectorXd v = tree.to_model(hinge_vector(L, 2, tree, "the velocities"));
  soa::Workspace<double> workspace(tree.model());
  push_vector(L, soa::bias(tree, workspace, {.v = v.data()}), hinge_labels(tree, Sort::force));
  return 1;
}
/// s:hybrid{bias = , tau = , vdot = }: of the free components tau is read, of the others v'
int hybrid(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  if (lua_type(L, 2) != LUA_TTABLE) refuse(L, Code::lua_argument, "hybrid", "a table {bias = , tau = , vdot = }", describe_value(L, 2));
  VectorXd parts[3] = {VectorXd::Zero(tree.size(Space::hinge)), VectorXd::Zero(tree.size(Space::hinge)), VectorXd::Zero(tree.size(Space::hinge))};
  constexpr const char* keys[] = {"bias", "tau", "vdot"};
  for_each_key(L, 2, [&](int key_at, int value) {
    const std::string key = lua_type(L, key_at) == LUA_TSTRING ? lua_tostring(L, key_at) : "";
    const auto k = std::find(std::begin(keys), std::end(keys), key) - std::begin(keys);
    if (k == 3) refuse(L, Code::unknown_key, "hybrid", "bias, tau, vdot", describe_value(L, key_at));
    parts[k] = finite_vector(L, value, parts[k].size(), ("hybrid." + key).c_str());
  });
  const soa::Hybrid h = soa::hybrid_dynamics(tree, parts[0], parts[1], parts[2]);
  lua_newtable(L);
  push_vector(L, h.vdot, hinge_labels(tree, Sort::motion)), set(L, "vdot");
  push_vector(L, h.tau, hinge_labels(tree, Sort::force)), set(L, "tau");
  return 1;
}

struct LuaPassive {
  std::shared_ptr<TreeOperators> tree;  // free = the passive components
  std::unique_ptr<soa::Unactuated> system;
};
LuaPassive& to_passive(lua_State* L) {
  if (auto* p = static_cast<LuaPassive*>(luaL_testudata(L, 1, kPassive))) return *p;
  refuse(L, Code::lua_argument, "passive", "the result of s:passive{...} or s:floating_base() before a colon", describe_value(L, 1));
}
int push_passive(lua_State* L, std::shared_ptr<TreeOperators> tree) {
  auto system = std::make_unique<soa::Unactuated>(*tree);
  push_object<LuaPassive>(L, kPassive, std::move(tree), std::move(system));
  return 1;
}
int passive(lua_State* L) { return push_passive(L, articulated_for(L, tree_of(L), names_at(L, 2, "passive"), "passive")); }
int floating_base(lua_State* L) {
  const TreeOperators& tree = tree_of(L);
  auto part = articulated_for(L, tree, {}, "floating_base");
  part->articulate({.free = soa::base_mask(tree)});
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
  push_matrix(L, p.system->generalised_jacobian({.nodes = nodes, .T = {}}), to_labels(p.tree->node_labels(nodes, Sort::motion)), hinge_labels(*p.tree, Sort::motion));
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

// ---- log det M, diagonalised velocities ---------------------------------------------------------------------------------------------------------

int log_det_gradient(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  LuaHost::charge(L, 100LL * log_det_passes(tree) * tree.size(Space::body));
  push_vector(L, cardan::log_det_gradient(tree), names_alone(tree));
  return 1;
}

struct LuaDiagonalised {
  std::shared_ptr<TreeOperators> tree;
  std::unique_ptr<Diagonalised> system;
};
LuaDiagonalised& to_diagonalised(lua_State* L) {
  if (auto* d = static_cast<LuaDiagonalised*>(luaL_testudata(L, 1, kDiagonalised))) return *d;
  refuse(L, Code::lua_argument, "diagonalised", "the result of s:diagonalised() before a colon", describe_value(L, 1));
}
/// s:diagonalised("normalised" or "rates")
int diagonalised(lua_State* L) {
  LuaOperators& o = to_operators(L);
  const std::string form = lua_isnoneornil(L, 2) ? "normalised" : lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  if (form != "normalised" && form != "rates") refuse(L, Code::lua_argument, "diagonalised", "\"normalised\" (default) or \"rates\"", describe_value(L, 2));
  o.tree->require(soa::Kind::D);
  push_object<LuaDiagonalised>(L, kDiagonalised, o.tree, std::make_unique<Diagonalised>(*o.tree, form == "rates" ? Diagonalised::Form::rates : Diagonalised::Form::normalised));
  return 1;
}
int nu_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  push_vector(L, d.system->from_velocity(hinge_vector(L, 2, *d.tree, "the velocities")), names_alone(*d.tree));
  return 1;
}
int velocity_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  VectorXd v = VectorXd::Zero(d.tree->size(Space::hinge));
  d.system->to_velocity(hinge_vector(L, 2, *d.tree, "nu"), v);
  push_vector(L, v, velocity_labels_of(*d.tree));
  return 1;
}
int eps_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  push_vector(L, d.system->eps(hinge_vector(L, 2, *d.tree, "the forces")), names_alone(*d.tree));
  return 1;
}
int coriolis_of(lua_State* L) {
  const LuaDiagonalised& d = to_diagonalised(L);
  push_vector(L, d.system->coriolis(hinge_vector(L, 2, *d.tree, "the velocities")), names_alone(*d.tree));
  return 1;
}
int diagonalised_text(lua_State* L) {
  lua_pushstring(L, fmt::format("diagonalised velocities of {} components", to_diagonalised(L).tree->size(Space::hinge)).c_str());
  return 1;
}

template <lua_CFunction kFunction>
constexpr lua_CFunction method = operator_method<kFunction>;
template <Study kStudy>
int study(lua_State* L) {
  const LuaOperators& o = to_operators(L);
  return kStudy(L, *o.tree, *o.at);
}

using OS = soa::OperationalSpace;
const std::vector<luaL_Reg> kTaskMethods = {
    {"compliance", method<task_compliance>}, {"inertia", method<task_inertia>}, {"rank", method<task_rank>}, {"condition", method<task_condition>},
    {"rows", method<task_rows>}, {"torque", method<task_torque>}, {"bias", method<task_bias>}, {"force_for", method<task_force_for>},
    {"require_full_rank", method<task_require_full_rank>},
    {"rates", method<task_map<&OS::rates, false, true, Sort::motion>>}, {"forces", method<task_map<&OS::forces, true, false, Sort::force>>},
    {"consistent_inverse", method<task_map<&OS::consistent_inverse, true, false, Sort::motion>>},
    {"task_part", method<task_map<&OS::task_part, false, true, Sort::force>>},
    {"null_motion", method<task_map<&OS::null_motion, false, false, Sort::motion>>},
    {"null_forces", method<task_map<&OS::null_forces, false, false, Sort::force>>}};
const std::vector<luaL_Reg> kPassiveMethods = {{"velocities", method<passive_velocities>}, {"jacobian", method<passive_jacobian>}, {"forces", method<passive_forces>},
                                               {"mass", method<passive_mass>}, {"coupling", method<passive_coupling>}};
const std::vector<luaL_Reg> kDiagonalisedMethods = {{"nu", method<nu_of>}, {"velocity", method<velocity_of>}, {"eps", method<eps_of>}, {"coriolis", method<coriolis_of>}};

template <class T>
void make_type(lua_State* L, const char* type, const std::vector<luaL_Reg>& methods, lua_CFunction text) {
  make_handle_type(L, type, methods, text);
  luaL_getmetatable(L, type);
  lua_pushcfunction(L, collect<T>);
  lua_setfield(L, -2, "__gc");
  lua_pop(L, 1);
}

}  // namespace

const std::vector<luaL_Reg>& analysis_methods() {
  static const std::vector<luaL_Reg> all = {{"compliance", method<compliance>}, {"task", method<task>}, {"effective_inertia", method<effective_inertia>},
                                            {"manipulability", method<manipulability>}, {"participation", method<participation>},
                                            {"mass_properties", method<mass_properties>}, {"momentum", method<momentum>},
                                            {"momentum_matrix", method<momentum_matrix>}, {"momentum_sharing", method<momentum_sharing>},
                                            {"reflected_inertia", method<reflected_inertia>}, {"bias", method<bias>}, {"hybrid", method<hybrid>},
                                            {"passive", method<passive>}, {"floating_base", method<floating_base>},
                                            {"log_det_gradient", method<log_det_gradient>}, {"diagonalised", method<diagonalised>},
                                            {"linearize", method<study<linear_model>>}, {"derivatives", method<study<derivatives_study>>},
                                            {"system_modes", method<study<system_modes_study>>}, {"inverse_kinematics", method<study<inverse_kinematics_study>>},
                                            {"interbody_forces", method<study<interbody_forces_study>>}};
  return all;
}

void make_analysis_types(lua_State* L) {
  make_type<LuaTask>(L, kTask, kTaskMethods, method<task_text>);
  make_type<LuaPassive>(L, kPassive, kPassiveMethods, method<passive_text>);
  make_type<LuaDiagonalised>(L, kDiagonalised, kDiagonalisedMethods, method<diagonalised_text>);
}

}  // namespace cardan
