// Operational space, as methods of s = sim:operators(). Formulas: docs/operators.md.
#include <fmt/format.h>

#include "core/operators/operational_space.hpp"
#include "scripts/bindings/operator_methods.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

constexpr char kTask[] = "cardan.task";

Eigen::Matrix<double, 6, 1> six(lua_State* L, int arg, const char* what) { return finite_vector(L, arg, 6, what); }

int compliance(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const std::vector<int> nodes = nodes_at(L, 2, tree.model());
  LuaHost::charge(L, 2000LL * static_cast<long long>(nodes.size() * (nodes.size() + 1)));
  push_matrix(L, operators::compliance(tree, nodes), to_labels(tree.node_labels(nodes, Sort::motion)),
              to_labels(tree.node_labels(nodes, Sort::force)));
  return 1;
}

struct LuaTask {
  std::shared_ptr<const TreeOperators> tree;
  std::shared_ptr<TreeOperators> passive;
  std::shared_ptr<const operators::ClosedSystem> closed;
  std::unique_ptr<operators::OperationalSpace> space;
  Labels motion, force;  // of its rows
};
LuaTask& to_task(lua_State* L) {
  if (auto* t = static_cast<LuaTask*>(luaL_testudata(L, 1, kTask))) return *t;
  refuse(L, Code::lua_argument, "task", "the result of s:task{...} before a colon", describe_value(L, 1));
}

/// s:task{nodes = {...}, rows = {1, 2, ...} or T = matrix, passive = {components}}
int task(lua_State* L) {
  tree_with_Y(L);
  return push_task(L, shared_tree_of(L), nullptr);
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
template <VectorXd (operators::OperationalSpace::*kMethod)(const VectorXd&) const, bool kTaskIn, bool kTaskOut, Sort kSort>
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
  const VectorXd tau_0 =
      lua_isnoneornil(L, 3) ? VectorXd(VectorXd::Zero(t.tree->size(Space::hinge))) : hinge_vector(L, 3, *t.tree, "the posture's forces");
  push_vector(L, t.space->torque(F, tau_0), hinge_labels(*t.tree, Sort::force));
  return 1;
}
/// task:bias(v) = Jdot v: accelerations of the task at v' = 0
int task_bias(lua_State* L) {
  const LuaTask& t = to_task(L);
  Workspace workspace(t.tree->model());
  push_vector(L, operators::task_bias(*t.tree, t.space->task(), workspace, hinge_vector(L, 2, *t.tree, "the velocities")), t.motion);
  return 1;
}
/// task:force_for(wanted, drift) = Lambda (wanted - drift)
int task_force_for(lua_State* L) {
  const LuaTask& t = to_task(L);
  const VectorXd wanted = finite_vector(L, 2, t.space->rows(), "the wanted acceleration");
  const VectorXd drift =
      lua_isnoneornil(L, 3) ? VectorXd(VectorXd::Zero(t.space->rows())) : finite_vector(L, 3, t.space->rows(), "the drift");
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
                                t.passive ? ", with passive components" : "")
                        .c_str());
  return 1;
}

int node_at(lua_State* L, int arg, const Model& m) {
  if (lua_type(L, arg) != LUA_TSTRING) refuse(L, Code::lua_argument, "node", "the name of a node", describe_value(L, arg));
  return node_indices(L, {lua_tostring(L, arg)}, m).front();
}
/// s:effective_inertia(node, {nx, ny, nz, fx, fy, fz})
int effective_inertia(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  lua_pushnumber(L, operators::effective_inertia(tree, node_at(L, 2, tree.model()), six(L, 3, "the direction")));
  return 1;
}
int manipulability(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const operators::Manipulability m = operators::manipulability(tree, {.nodes = nodes_at(L, 2, tree.model()), .T = {}});
  lua_newtable(L);
  push_vector(L, m.singular_values), set(L, "singular_values");
  set_number(L, "kinematic", m.kinematic), set_number(L, "dynamic", m.dynamic);
  return 1;
}
int participation(lua_State* L) {
  const TreeOperators& tree = tree_with_Y(L);
  const operators::Participation p = operators::participation(tree, node_at(L, 2, tree.model()), six(L, 3, "the direction"));
  const Labels names = names_alone(tree);
  lua_newtable(L);
  push_vector(L, p.shape, names), set(L, "shape");
  push_vector(L, p.response, names), set(L, "response");
  push_vector(L, p.share, names), set(L, "share");
  return 1;
}

using OS = operators::OperationalSpace;
const std::vector<luaL_Reg> kTaskMethods = {{"compliance", placed<task_compliance, 0>},
                                            {"inertia", placed<task_inertia, 0>},
                                            {"rank", placed<task_rank, 0>},
                                            {"condition", placed<task_condition, 0>},
                                            {"rows", placed<task_rows, 0>},
                                            {"torque", placed<task_torque, 2>},
                                            {"bias", placed<task_bias, 1>},
                                            {"force_for", placed<task_force_for, 2>},
                                            {"require_full_rank", placed<task_require_full_rank, 0>},
                                            {"rates", placed<task_map<&OS::rates, false, true, Sort::motion>, 1>},
                                            {"forces", placed<task_map<&OS::forces, true, false, Sort::force>, 1>},
                                            {"consistent_inverse", placed<task_map<&OS::consistent_inverse, true, false, Sort::motion>, 1>},
                                            {"task_part", placed<task_map<&OS::task_part, false, true, Sort::force>, 1>},
                                            {"null_motion", placed<task_map<&OS::null_motion, false, false, Sort::motion>, 1>},
                                            {"null_forces", placed<task_map<&OS::null_forces, false, false, Sort::force>, 1>}};

}  // namespace

int push_task(lua_State* L, std::shared_ptr<const TreeOperators> tree, std::shared_ptr<const operators::ClosedSystem> closed) {
  DiagnosticSink sink;
  LuaTable table(L, 2, "task", sink);
  table.require({"nodes"});
  const auto names = table.texts("nodes");
  const auto rows = table.numbers("rows", 0);
  const auto passive = closed ? std::nullopt : table.texts("passive");
  const bool has_T = table.has("T");
  table.finish();
  sink.throw_if_any();
  operators::Task task{.nodes = node_indices(L, *names, tree->model()), .T = {}};
  const operators::SpaceLabels motion = tree->node_labels(task.nodes, Sort::motion), force = tree->node_labels(task.nodes, Sort::force);
  auto out = LuaTask{tree, nullptr, closed, nullptr, to_labels(motion), to_labels(force)};
  const int all = static_cast<int>(motion.names.size());
  if (rows && has_T) refuse(L, Code::lua_argument, "task", "rows or T", "both");
  if (rows) {
    std::vector<int> picked;
    out.motion = out.force = {};
    for (const double r : *rows) {
      const int i = static_cast<int>(r) - 1;
      if (i < 0 || i >= all || static_cast<double>(i + 1) != r)
        refuse(L, Code::out_of_range, "task.rows", fmt::format("1 ... {}", all), fmt::format("{:g}", r));
      picked.push_back(i);
      for (auto* l : {&out.motion, &out.force}) {
        const operators::SpaceLabels& from = l == &out.motion ? motion : force;
        l->names.push_back(from.names[static_cast<std::size_t>(i)]), l->units.push_back(from.units[static_cast<std::size_t>(i)]);
      }
    }
    task = operators::Task::of_rows(task.nodes, picked);
  } else if (has_T) {
    lua_getfield(L, 2, "T");
    task.T = to_matrix(L, lua_gettop(L), kAnySize, all, "task.T");
    lua_pop(L, 1);
    out.motion = out.force = {};
  }
  if (passive) {
    out.passive = articulated_for(L, *tree, *passive, "task.passive");
    out.passive->operational_space();
  }
  out.space = closed ? std::make_unique<operators::OperationalSpace>(*closed, std::move(task))
                     : std::make_unique<operators::OperationalSpace>(*tree, std::move(task), out.passive.get());
  push_object<LuaTask>(L, kTask, std::move(out));
  return 1;
}
const std::vector<luaL_Reg>& task_methods() {
  static const std::vector<luaL_Reg> all = {{"compliance", placed<compliance>},
                                            {"task", placed<task, 1>},
                                            {"effective_inertia", placed<effective_inertia, 2>},
                                            {"manipulability", placed<manipulability>},
                                            {"participation", placed<participation, 2>}};
  return all;
}

void make_task_type(lua_State* L) { make_type<LuaTask>(L, kTask, kTaskMethods, placed<task_text>); }

}  // namespace cardan
