// Modes of the assembled system, derivatives of the equations of motion, inverse kinematics and inter-body forces in scripts.
#include "scripts/host/bind_studies.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/inverse_kinematics.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_modes.hpp"
#include "scripts/host/bind_operators.hpp"
#include "scripts/host/bind_sim.hpp"
#include "scripts/host/lua_table.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

/// Velocity component of "arm.rate", or of a coordinate whose rate it is: "arm.angle".
int velocity_component(lua_State* L, const Model& m, const std::string& name, const char* what) {
  const Labels v = velocity_labels(m), q = coordinate_labels(m);
  const auto in_v = std::find(v.names.begin(), v.names.end(), name);
  if (in_v != v.names.end()) return static_cast<int>(in_v - v.names.begin());
  const auto in_q = std::find(q.names.begin(), q.names.end(), name);
  const int at = static_cast<int>(in_q - q.names.begin());
  if (in_q != q.names.end())
    for (const PlainRates& r : m.plain_rates)
      if (at >= r.q && at < r.q + r.n) return r.v + at - r.q;
  for (const UserBody& u : m.user)  // behind the quaternion of a hinge
    if (in_q != q.names.end() && u.nq == u.nv + 1 && at >= u.q + 4 && at < u.q + u.nq) return u.v + at - u.q - 1;
  std::vector<std::string> known = v.names;
  known.insert(known.end(), q.names.begin(), q.names.end());
  refuse(L, Code::unknown_name, what, fmt::format("a component: {}", fmt::join(v.names, ", ")), in_quotes(name), did_you_mean(name, known));
}

soa::IkTarget target_of(lua_State* L, LuaTable& t, const Model& m) {
  t.require({"node"});
  const auto node = t.text("node");
  const auto position = t.numbers("position", 3, "m"), attitude = t.numbers("attitude", 4);
  soa::IkTarget out;
  if (node) out.node = node_indices(L, {*node}, m).front();
  if (attitude && std::abs(Eigen::Map<const Eigen::Vector4d>(attitude->data()).norm() - 1.0) > 1e-6) t.reject("attitude", "a unit quaternion w, x, y, z");
  if (!position && !attitude) t.reject("position", "a position, an attitude, or both");
  if (position) out.position = Eigen::Map<const Eigen::Vector3d>(position->data());
  if (attitude) out.R_WN = Eigen::Quaterniond((*attitude)[0], (*attitude)[1], (*attitude)[2], (*attitude)[3]).normalized().toRotationMatrix();
  out.rows = {attitude.has_value(), attitude.has_value(), attitude.has_value(), position.has_value(), position.has_value(), position.has_value()};
  if (const auto rows = t.numbers("rows", 0)) {  // of [rotation; position] in target axes
    std::array<bool, 6> picked{};
    for (const double r : *rows) {
      const int i = static_cast<int>(r) - 1;
      if (i < 0 || i > 5 || !out.rows[static_cast<std::size_t>(i)])
        t.reject("rows", "rows 1 ... 3 of an attitude and 4 ... 6 of a position that are given");
      else
        picked[static_cast<std::size_t>(i)] = true;
    }
    out.rows = picked;
  }
  out.rotation_weight = t.number("rotation_weight").value_or(1.0);
  out.position_weight = t.number("position_weight").value_or(1.0);
  t.finish();
  return out;
}

}  // namespace

int system_modes_study(lua_State* L, const soa::TreeOperators& tree, const OperatingState&) {
  soa::SystemModesOptions options;
  if (!lua_isnoneornil(L, 2)) {
    DiagnosticSink sink;
    LuaTable table(L, 2, "system_modes", sink);
    options.elastic = static_cast<int>(table.integer("elastic").value_or(options.elastic));
    options.rigid = static_cast<int>(table.integer("rigid").value_or(options.rigid));
    if (options.elastic < 0) table.reject("elastic", "a number of modes");
    if (options.rigid < 0) table.reject("rigid", "a number of modes");
    table.finish();
    sink.throw_if_any();
  }
  LuaHost::charge(L, 20000LL * (tree.size(soa::Space::body) + 1));
  const soa::SystemModes modes = soa::system_modes(tree, options);
  Labels rows = to_labels(modes.labels);
  rows.units.clear();
  lua_newtable(L);
  lua_pushinteger(L, modes.n_rigid), set(L, "n_rigid");
  lua_pushinteger(L, modes.first_elastic + 1), set(L, "first_elastic");
  lua_pushboolean(L, modes.complete), set(L, "complete");
  push_vector(L, modes.frequency, {{}, std::vector<std::string>(static_cast<std::size_t>(modes.frequency.size()), "Hz")}), set(L, "frequency");
  push_vector(L, modes.damping), set(L, "damping");
  push_matrix(L, modes.shapes, rows), set(L, "shapes");
  push_matrix(L, modes.strain, rows), set(L, "strain");
  push_matrix(L, modes.kinetic, {modes.bodies, {}}), set(L, "kinetic");
  return 1;
}

int derivatives_study(lua_State* L, const soa::TreeOperators& tree, const OperatingState& at) {
  lua_settop(L, 2);
  const Model& m = tree.model();
  Sensitivities about(tree);
  about.solve(at.inputs(tree.q().data()));
  const Labels names{tree.labels(soa::Space::hinge, soa::Sort::unknown).names, {}};
  lua_newtable(L);
  if (lua_isnoneornil(L, 2)) {
    LuaHost::charge(L, 400LL * static_cast<std::int64_t>(m.bodies.size()) * (4 * tree.size(soa::Space::hinge) + 1));
    const InverseDerivatives inverse = about.inverse();
    const ForwardDerivatives forward = about.forward();
    push_matrix(L, inverse.q, names, names), set(L, "tau_q");
    push_matrix(L, inverse.v, names, names), set(L, "tau_v");
    push_matrix(L, forward.q, names, names), set(L, "vdot_q");
    push_matrix(L, forward.v, names, names), set(L, "vdot_v");
    push_matrix(L, forward.tau, names, names), set(L, "vdot_tau");
    return 1;
  }
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  const int body = m.find_body(name);
  if (name.empty() || body < 0) refuse(L, Code::unknown_body, "derivatives", "a body of the vehicle", describe_value(L, 2));
  if (m.user[static_cast<std::size_t>(body)].n_modes > 0) {
    push_matrix(L, about.inverse_in_stiffness(body), names), set(L, "tau");
    push_matrix(L, about.forward_in_stiffness(body), names), set(L, "vdot");
    return 1;
  }
  const Labels parameters{{"m", "hx", "hy", "hz", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz"},
                          {"kg", "kg m", "kg m", "kg m", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2"}};
  push_matrix(L, about.inverse_in_inertia(body), names, parameters), set(L, "tau");
  push_matrix(L, about.forward_in_inertia(body), names, parameters), set(L, "vdot");
  return 1;
}

int inverse_kinematics_study(lua_State* L, const soa::TreeOperators& tree, const OperatingState& at) {
  const Model& m = tree.model();
  DiagnosticSink sink;
  LuaTable table(L, 2, "inverse_kinematics", sink);
  table.require({"targets"});
  std::vector<soa::IkTarget> targets;
  for (LuaTable& t : table.tables("targets")) targets.push_back(target_of(L, t, m));
  if (table.has("targets") && targets.empty()) table.reject("targets", "one target or more");
  soa::IkOptions options;
  options.tolerance = table.number("tolerance").value_or(options.tolerance);
  options.iterations = static_cast<int>(table.integer("iterations").value_or(options.iterations));
  options.starts = static_cast<int>(table.integer("starts").value_or(options.starts));
  options.seed = static_cast<std::uint64_t>(table.integer("seed").value_or(static_cast<std::int64_t>(at.seed > 0 ? at.seed : options.seed)));
  options.dynamic = table.flag("dynamic").value_or(false);
  for (const std::string& name : table.texts("free").value_or(std::vector<std::string>())) options.free.push_back(velocity_component(L, m, name, "inverse_kinematics.free"));
  if (table.has("prefer")) {
    lua_getfield(L, 2, "prefer");
    options.prefer = to_vector(L, lua_gettop(L), m.nq, "inverse_kinematics.prefer");
    lua_pop(L, 1);
  }
  if (table.has("limits")) {
    lua_getfield(L, 2, "limits");
    const int limits = lua_gettop(L);
    if (!lua_istable(L, limits)) table.reject("limits", "{[component] = {lower, upper}}");
    if (lua_istable(L, limits)) {
      DiagnosticSink inner;
      for (lua_pushnil(L); lua_next(L, limits); lua_pop(L, 1)) {
        const std::string name = lua_type(L, -2) == LUA_TSTRING ? lua_tostring(L, -2) : "";
        const VectorXd range = to_vector(L, lua_gettop(L), 2, "inverse_kinematics.limits." + name);
        options.limits.push_back({.v = velocity_component(L, m, name, "inverse_kinematics.limits"), .lower = range[0], .upper = range[1]});
      }
      std::sort(options.limits.begin(), options.limits.end(), [](const auto& a, const auto& b) { return a.v < b.v; });  // not the order of the table
    }
    lua_pop(L, 1);
  }
  table.finish();
  sink.throw_if_any();
  LuaHost::charge(L, 1000LL * static_cast<std::int64_t>(m.bodies.size()) * options.starts);
  const soa::IkResult r = soa::inverse_kinematics(tree, targets, options);
  const Labels v = velocity_labels(m);
  lua_newtable(L);
  lua_pushboolean(L, r.reached), set(L, "reached");
  push_vector(L, r.q, coordinate_labels(m)), set(L, "q");
  set_number(L, "residual", r.residual);
  push_matrix(L, r.error, {{"rx", "ry", "rz", "x", "y", "z"}, {"rad", "rad", "rad", "m", "m", "m"}}), set(L, "error");
  lua_newtable(L);
  for (std::size_t i = 0; i < r.at_limit.size(); ++i) {
    lua_pushstring(L, v.names[static_cast<std::size_t>(r.at_limit[i])].c_str());
    lua_rawseti(L, -2, static_cast<lua_Integer>(i) + 1);
  }
  set(L, "at_limit");
  lua_pushboolean(L, r.stationary), set(L, "stationary");
  lua_pushinteger(L, r.iterations), set(L, "iterations");
  lua_pushinteger(L, r.starts), set(L, "starts");
  lua_pushinteger(L, static_cast<lua_Integer>(r.seed)), set(L, "seed");
  lua_pushstring(L, r.message.c_str()), set(L, "message");
  return 1;
}

int interbody_forces_study(lua_State* L, const soa::TreeOperators& tree, const OperatingState& at) {
  const Model& m = tree.model();
  const int n = tree.size(soa::Space::hinge);
  VectorXd v = tree.from_model(at.v), vdot;
  if (!lua_isnoneornil(L, 2)) {
    if (lua_type(L, 2) != LUA_TTABLE) refuse(L, Code::lua_argument, "interbody_forces", "nothing, or a table {v = , vdot = }", describe_value(L, 2));
    for (lua_pushnil(L); lua_next(L, 2); lua_pop(L, 1)) {
      const std::string key = lua_type(L, -2) == LUA_TSTRING ? lua_tostring(L, -2) : "";
      if (key != "v" && key != "vdot") refuse(L, Code::unknown_key, "interbody_forces", "v, vdot", describe_value(L, -2));
      (key == "v" ? v : vdot) = finite_vector(L, lua_gettop(L), n, ("interbody_forces." + key).c_str());
    }
  }
  LuaHost::charge(L, 400LL * static_cast<std::int64_t>(m.bodies.size()));
  const VectorXd v_all = tree.to_model(v);
  Inputs in = at.inputs(tree.q().data());
  in.v = v_all.data();
  if (vdot.size() == 0) {  // what the forces of the state do
    Sensitivities about(tree);
    about.solve(in);
    vdot = about.vdot();
  }
  const VectorXd vdot_all = tree.to_model(vdot);
  in.vdot = vdot_all.data();
  Workspace workspace(m);
  push_vector(L, soa::interbody_forces(tree, workspace, in), to_labels(tree.labels(soa::Space::body, soa::Sort::force)));
  return 1;
}

int push_modes(lua_State* L, Scenario& s) { return study_of_now(L, s, "system_modes", system_modes_study); }
int push_derivatives(lua_State* L, Scenario& s) { return study_of_now(L, s, "derivatives", derivatives_study); }
int push_inverse_kinematics(lua_State* L, Scenario& s) { return study_of_now(L, s, "inverse_kinematics", inverse_kinematics_study); }

}  // namespace cardan
