// Modes of the assembled system, derivatives of the equations of motion, inverse kinematics, equilibria and inter-body forces in scripts.
#include "scripts/bindings/studies.hpp"
#include "scripts/bindings/bind.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/units.hpp"
#include "core/dynamics/loops.hpp"
#include "core/linalg/linear_operator.hpp"
#include "core/model/loops.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/inverse_kinematics.hpp"
#include "core/operators/linear_model.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_modes.hpp"
#include "core/sim/equilibrium.hpp"
#include "scripts/bindings/labels.hpp"
#include "scripts/bindings/operator_methods.hpp"
#include "scripts/lua/table.hpp"
#include "scripts/mission/examine.hpp"

namespace cardan {
namespace {

using Eigen::VectorXd;

operators::IkTarget target_of(lua_State* L, LuaTable& t, const Model& m) {
  t.require({"node"});
  const auto node = t.text("node");
  const auto position = t.numbers("position", 3, "m"), attitude = t.numbers("attitude", 4);
  operators::IkTarget out;
  if (node) out.node = node_indices(L, {*node}, m).front();
  if (attitude && std::abs(Eigen::Map<const Eigen::Vector4d>(attitude->data()).norm() - 1.0) > 1e-6)
    t.reject("attitude", "a unit quaternion w, x, y, z");
  if (!position && !attitude) t.reject("position", "a position, an attitude, or both");
  if (position) out.position = Eigen::Map<const Eigen::Vector3d>(position->data());
  if (attitude)
    out.R_WN = Eigen::Quaterniond((*attitude)[0], (*attitude)[1], (*attitude)[2], (*attitude)[3]).normalized().toRotationMatrix();
  out.rows = {attitude.has_value(), attitude.has_value(), attitude.has_value(),
              position.has_value(), position.has_value(), position.has_value()};
  if (const auto rows = t.numbers("rows", 0)) {  // of [rotation; position] in target axes
    std::array<bool, 6> picked{};
    for (const double r : *rows) {
      const bool is_one = r >= 1.0 && r <= 6.0 && r == std::floor(r);
      const std::size_t i = is_one ? static_cast<std::size_t>(r) - 1 : 0;
      if (!is_one || !out.rows[i])
        t.reject("rows", "rows 1 ... 3 of an attitude and 4 ... 6 of a position that are given");
      else
        picked[i] = true;
    }
    out.rows = picked;
  }
  out.rotation_weight = t.number("rotation_weight").value_or(1.0);
  out.position_weight = t.number("position_weight").value_or(1.0);
  t.finish();
  return out;
}

/// A line per mode: what moves, by its share of the kinetic energy, and what is strained, by its share of that energy.
std::string modes_text(const operators::SystemModes& modes) {
  constexpr double kNamed = 0.05;     // smaller shares are left out
  constexpr double kDamping = 1e-12;  // less is what rounding leaves of other modes
  const auto largest = [](const Eigen::VectorXd& shares, const std::vector<std::string>& names) {
    std::vector<int> order(static_cast<std::size_t>(shares.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return shares[a] > shares[b]; });
    std::string out;
    for (std::size_t i = 0; i < order.size() && i < 3 && shares[order[i]] >= kNamed; ++i)
      out += fmt::format("{}{} {:.0f} %", i > 0 ? ", " : "", names[static_cast<std::size_t>(order[i])], 100.0 * shares[order[i]]);
    return out;
  };
  const auto n = static_cast<int>(modes.frequency.size());
  std::string out = fmt::format("{} rigid-body and {} elastic modes, without weight, of preload with that of devices{}", modes.n_rigid,
                                n - modes.first_elastic, modes.complete ? "" : "; that none was missed is not certain");
  out += "\n   no      [Hz]  damping  moves (kinetic energy)                              strains";
  for (int j = 0; j < n; ++j)
    out += fmt::format("\n  {:>3}  {:>8.5g}  {:>7.4g}  {:<50}  {}", j + 1, modes.frequency[j],
                       std::abs(modes.damping[j]) < kDamping ? 0.0 : modes.damping[j], largest(modes.kinetic.col(j), modes.bodies),
                       j < modes.first_elastic ? "-" : largest(modes.strain.col(j), modes.labels.names));
  return out;
}
/// Upvalue: the text.
int stored_text(lua_State* L) {
  lua_pushvalue(L, lua_upvalueindex(1));
  return 1;
}

}  // namespace

namespace {

/// `X`: motions that closed loops leave free (LoopFreedom); null: there are none.
int push_system_modes(lua_State* L, const TreeOperators& tree, const OperatingState& at, const Eigen::MatrixXd* X,
                      const Model* closed = nullptr, std::span<const LoopDrive> drives = {}) {
  operators::SystemModesOptions options{.devices = at.devices.get(), .closed = closed, .drives = drives};
  if (!lua_isnoneornil(L, 2)) {
    DiagnosticSink sink;
    LuaTable table(L, 2, "system_modes", sink);
    options.elastic = static_cast<int>(table.integer("elastic", 0).value_or(options.elastic));
    options.rigid = static_cast<int>(table.integer("rigid", 0).value_or(options.rigid));
    table.finish();
    sink.throw_if_any();
  }
  LuaHost::charge(L, 4000LL * (tree.size(Space::body) + 1));
  const operators::SystemModes modes = [&] {
    try {
      return X ? operators::closed_system_modes(tree, *X, options) : operators::system_modes(tree, options);
    } catch (const LinalgError& e) {
      refuse(L, Code::unsupported, "modes of the system", "modes to 8 digits, none missed", e.what(),
             "away from an equilibrium they mean little; linearize() has the poles there");
    }
  }();
  Labels rows = to_labels(modes.labels);
  rows.units.clear();
  lua_newtable(L);
  lua_pushinteger(L, modes.n_rigid), set(L, "n_rigid");
  lua_pushinteger(L, modes.first_elastic + 1), set(L, "first_elastic");
  lua_pushboolean(L, modes.complete), set(L, "complete");
  push_vector(L, modes.frequency, {{}, std::vector<std::string>(static_cast<std::size_t>(modes.frequency.size()), "Hz")}),
      set(L, "frequency");
  push_vector(L, modes.damping), set(L, "damping");
  push_matrix(L, modes.shapes, rows), set(L, "shapes");
  push_matrix(L, modes.strain, rows), set(L, "strain");
  push_matrix(L, modes.kinetic, {modes.bodies, {}}), set(L, "kinetic");
  lua_newtable(L);  // as text: a table of the modes
  const std::string text = modes_text(modes);
  lua_pushlstring(L, text.data(), text.size());
  lua_pushcclosure(L, stored_text, 1), set(L, "__tostring");
  lua_setmetatable(L, -2);
  return 1;
}

}  // namespace

int system_modes_study(lua_State* L, const TreeOperators& tree, const OperatingState& at) {
  return push_system_modes(L, tree, at, nullptr);
}

namespace {

/// Of inverse dynamics, in the parameters of the body that argument 2 names: its inertia, or its modal stiffness.
struct InParameters {
  int body;
  bool body_is_flexible;
  Labels labels;
  Eigen::MatrixXd tau;
};
InParameters in_parameters(lua_State* L, operators::Sensitivities& about, const Model& m) {
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : "";
  const int body = m.find_body(name);
  if (name.empty() || body < 0) refuse(L, Code::unknown_body, "derivatives", "a body of the vehicle", describe_value(L, 2));
  if (m.user[static_cast<std::size_t>(body)].n_modes > 0) return {body, true, {}, about.inverse_in_stiffness(body)};
  return {body,
          false,
          {{"m", "hx", "hy", "hz", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz"},
           {"kg", "kg m", "kg m", "kg m", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2", "kg m^2"}},
          about.inverse_in_inertia(body)};
}

/// Of a vehicle with closed loops.
int push_closed_derivatives(lua_State* L, const std::shared_ptr<const Model>& model, const OperatingState& at, const double* q) {
  lua_settop(L, 2);
  const auto n = static_cast<std::int64_t>(model->nv);
  LuaHost::charge(L, 100LL * static_cast<std::int64_t>(model->bodies.size()) * (2 * n + 2));
  const operators::OperatingPoint point = at.point(q);
  const operators::ClosedDerivatives found = operators::closed_derivatives(*model, point);
  const operators::ClosedSystem closed(model, q, point.drives);
  const TreeOperators& tree = closed.tree();
  const Labels names = names_alone(tree);
  const auto in_hinge_space = [&](Eigen::MatrixXd x) {
    for (Eigen::Index j = 0; j < x.cols(); ++j) x.col(j) = tree.from_model(Eigen::VectorXd(x.col(j)));
    return x;
  };
  lua_newtable(L);
  if (lua_isnoneornil(L, 2)) {
    Labels moved;
    for (const int v : found.independent) moved.names.push_back(names.names[static_cast<std::size_t>(tree.place_of_velocity(v))]);
    push_matrix(L, in_hinge_space(found.q), names, moved), set(L, "vdot_q");
    push_matrix(L, in_hinge_space(found.v), names, moved), set(L, "vdot_v");
    push_matrix(L, Eigen::MatrixXd(closed.motions() * closed.motions().transpose()), names, names), set(L, "vdot_tau");
    return 1;
  }
  operators::Sensitivities about(tree.model_pointer());
  Inputs in = at.inputs(q);
  in.vdot = found.vdot.data();
  about.at(in);
  const InParameters of = in_parameters(L, about, *model);
  Eigen::MatrixXd vdot = of.tau;
  for (Eigen::Index j = 0; j < vdot.cols(); ++j) vdot.col(j) = -closed.respond(of.tau.col(j));
  push_matrix(L, vdot, names, of.labels), set(L, "vdot");
  return 1;
}

}  // namespace

int derivatives_study(lua_State* L, const TreeOperators& tree, const OperatingState& at) {
  lua_settop(L, 2);
  const Model& m = tree.model();
  operators::Sensitivities about(tree);
  about.solve(at.inputs(tree.q().data()), at.devices.get());
  const Labels names{tree.labels(Space::hinge, Sort::unknown).names, {}};
  lua_newtable(L);
  if (lua_isnoneornil(L, 2)) {
    LuaHost::charge(L, 50LL * static_cast<std::int64_t>(m.bodies.size()) * (4 * tree.size(Space::hinge) + 1));
    const operators::InverseDerivatives inverse = about.inverse();
    const operators::ForwardDerivatives forward = about.forward();
    push_matrix(L, inverse.q, names, names), set(L, "tau_q");
    push_matrix(L, inverse.v, names, names), set(L, "tau_v");
    push_matrix(L, forward.q, names, names), set(L, "vdot_q");
    push_matrix(L, forward.v, names, names), set(L, "vdot_v");
    push_matrix(L, forward.tau, names, names), set(L, "vdot_tau");
    return 1;
  }
  const InParameters in = in_parameters(L, about, m);
  push_matrix(L, in.tau, names, in.labels), set(L, "tau");
  push_matrix(L, in.body_is_flexible ? about.forward_in_stiffness(in.body) : about.forward_in_inertia(in.body), names, in.labels),
      set(L, "vdot");
  return 1;
}

namespace {

/// A state as initial{...} takes it: per body what its hinge and its modes have; null v: coordinates alone.
void push_initial(lua_State* L, const Model& m, const VectorXd& q, const VectorXd* v) {
  const auto numbers = [&](const VectorXd& x, int first, int n, const std::string& key) {
    if (n == 0) return;
    lua_createtable(L, n, 0);
    for (int i = 0; i < n; ++i) lua_pushnumber(L, x[first + i]), lua_rawseti(L, -2, i + 1);
    lua_setfield(L, -2, key.c_str());
  };
  lua_newtable(L);
  for (const UserBody& u : m.user) {
    if (u.nq + u.n_modes == 0) continue;
    lua_newtable(L);
    for (int i = 0; i < u.nq; ++i) lua_pushnumber(L, q[u.q + i]), lua_setfield(L, -2, u.q_names[static_cast<std::size_t>(i)].c_str());
    for (int j = 0; v && j < u.nv; ++j)
      lua_pushnumber(L, (*v)[u.v + j]), lua_setfield(L, -2, u.v_names[static_cast<std::size_t>(j)].c_str());
    numbers(q, u.eta, u.n_modes, "eta");
    if (v) numbers(*v, u.etadot, u.n_modes, "etadot");
    lua_setfield(L, -2, u.name.c_str());
  }
}

}  // namespace

/// solve(targets, options).
template <class Solve>
int push_inverse_kinematics(lua_State* L, const Model& m, std::uint64_t seed, const Solve& solve) {
  DiagnosticSink sink;
  LuaTable table(L, 2, "inverse_kinematics", sink);
  table.require({"targets"});
  std::vector<operators::IkTarget> targets;
  for (LuaTable& t : table.tables("targets")) targets.push_back(target_of(L, t, m));
  if (table.has("targets") && targets.empty()) table.reject("targets", "one target or more");
  operators::IkOptions options;
  options.tolerance = table.number("tolerance").value_or(options.tolerance);
  options.iterations = static_cast<int>(table.integer("iterations", 1).value_or(options.iterations));
  options.starts = static_cast<int>(table.integer("starts", 1).value_or(options.starts));
  options.seed = static_cast<std::uint64_t>(table.integer("seed", 0, std::numeric_limits<std::int64_t>::max())
                                                .value_or(static_cast<std::int64_t>(seed > 0 ? seed : options.seed)));
  if (!(options.tolerance > 0.0)) table.reject("tolerance", "a positive number");
  options.dynamic = table.flag("dynamic").value_or(false);
  for (const std::string& name : table.texts("free").value_or(std::vector<std::string>()))
    for (const int v : components_at(L, m, name, "inverse_kinematics.free")) options.free.push_back(v);
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
      for_each_key(L, limits, [&](int key, int value) {
        const std::string name = lua_type(L, key) == LUA_TSTRING ? lua_tostring(L, key) : "";
        const std::vector<int> v = components_at(L, m, name, "inverse_kinematics.limits");
        if (v.size() != 1)
          refuse(L, Code::lua_argument, "inverse_kinematics.limits." + name, "one component", fmt::format("{} of them", v.size()));
        const VectorXd range = to_vector(L, value, 2, "inverse_kinematics.limits." + name);
        options.limits.push_back({.v = v[0], .lower = range[0], .upper = range[1]});
      });
      std::sort(options.limits.begin(), options.limits.end(), [](const auto& a, const auto& b) { return a.v < b.v; });  // that of v
    }
    lua_pop(L, 1);
  }
  table.finish();
  sink.throw_if_any();
  LuaHost::charge(L, 1000LL * static_cast<std::int64_t>(m.bodies.size()) * options.starts);
  const operators::IkResult r = solve(targets, options);
  const Labels v = velocity_labels(m);
  lua_newtable(L);
  lua_pushboolean(L, r.reached), set(L, "reached");
  push_vector(L, r.q, coordinate_labels(m)), set(L, "q");
  push_initial(L, m, r.q, nullptr), set(L, "initial");
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

int inverse_kinematics_study(lua_State* L, const TreeOperators& tree, const OperatingState& at) {
  return push_inverse_kinematics(L, tree.model(), at.seed, [&](const auto& targets, const auto& options) {
    return operators::inverse_kinematics(tree, targets, options);
  });
}

int interbody_forces_study(lua_State* L, const TreeOperators& tree, const OperatingState& at) {
  const Model& m = tree.model();
  const int n = tree.size(Space::hinge);
  VectorXd v = tree.from_model(at.v), vdot;
  if (!lua_isnoneornil(L, 2)) {
    if (lua_type(L, 2) != LUA_TTABLE)
      refuse(L, Code::lua_argument, "interbody_forces", "nothing, or a table {v = , vdot = }", describe_value(L, 2));
    for_each_key(L, 2, [&](int key_at, int value) {
      const std::string key = lua_type(L, key_at) == LUA_TSTRING ? lua_tostring(L, key_at) : "";
      if (key != "v" && key != "vdot") refuse(L, Code::unknown_key, "interbody_forces", "v, vdot", describe_value(L, key_at));
      (key == "v" ? v : vdot) = finite_vector(L, value, n, ("interbody_forces." + key).c_str());
    });
  }
  LuaHost::charge(L, 400LL * static_cast<std::int64_t>(m.bodies.size()));
  const VectorXd v_all = tree.to_model(v);
  Inputs in = at.inputs(tree.q().data());
  in.v = v_all.data();
  if (vdot.size() == 0) {  // what the forces of the state do
    operators::Sensitivities about(tree);
    about.solve(in);
    vdot = about.vdot();
  }
  const VectorXd vdot_all = tree.to_model(vdot);
  in.vdot = vdot_all.data();
  Workspace workspace(m);
  push_vector(L, operators::interbody_forces(tree, workspace, in), to_labels(tree.labels(Space::body, Sort::force)));
  return 1;
}

int push_modes(lua_State* L, Scenario& s) {
  if (s.model->loops.empty()) return study_of_now(L, s, "system_modes", system_modes_study);
  require_a_state(L, s, "system_modes");
  const auto model = s.sim ? s.sim->shared_model() : s.model;
  Workspace ws(*model);
  const std::span<const LoopDrive> drives = s.sim ? std::span<const LoopDrive>(s.sim->drives()) : std::span<const LoopDrive>();
  const Eigen::MatrixXd X = loop_freedom(*model, ws, s.q, s.sim ? s.sim->drives().data() : nullptr).X;
  TreeOperators tree(open_tree(model));
  tree.at(s.q);
  return push_system_modes(L, tree, present_state(s), &X, model.get(), drives);
}
int push_derivatives(lua_State* L, Scenario& s) {
  if (s.q) expect_away_from_centre(s.model, s.q);
  if (s.model->loops.empty()) return study_of_now(L, s, "derivatives", derivatives_study);
  require_a_state(L, s, "derivatives");
  return push_closed_derivatives(L, s.sim ? s.sim->shared_model() : s.model, present_state(s), s.q);
}
int push_inverse_kinematics(lua_State* L, Scenario& s) {
  if (s.model->loops.empty()) return study_of_now(L, s, "inverse_kinematics", inverse_kinematics_study);
  require_a_state(L, s, "inverse_kinematics");
  const auto model = s.sim ? s.sim->shared_model() : s.model;
  return push_inverse_kinematics(L, *model, present_state(s).seed, [&](const auto& targets, operators::IkOptions options) {
    options.drives = s.sim ? s.sim->drives().data() : nullptr;
    return operators::inverse_kinematics(model, s.q, targets, options);
  });
}

/// equilibrium{move = {...}, iterations = , tolerance = }
int push_equilibrium(lua_State* L, Scenario& s) {
  require_a_state(L, s, "equilibrium");
  DiagnosticSink sink;
  LuaTable table(L, 2, "equilibrium", sink);
  table.require({"move"});
  EquilibriumOptions options;
  for (const std::string& name : table.texts("move").value_or(std::vector<std::string>()))
    for (const int v : components_at(L, *s.model, name, "equilibrium.move")) options.move.push_back(v);
  options.iterations = static_cast<int>(table.integer("iterations", 1).value_or(options.iterations));
  options.tolerance = table.number("tolerance").value_or(options.tolerance);
  if (!(options.tolerance > 0.0)) table.reject("tolerance", "a positive number");
  table.finish();
  sink.throw_if_any();
  LuaHost::charge(L, 500LL * static_cast<std::int64_t>(s.model->bodies.size()) * static_cast<std::int64_t>(options.move.size() + 2));
  const Equilibrium found = find_equilibrium(*s.sim, options);
  lua_newtable(L);
  lua_pushboolean(L, found.reached), set(L, "reached");
  lua_pushboolean(L, found.statically_stable), set(L, "statically_stable");
  push_vector(L, found.q, coordinate_labels(*s.model)), set(L, "q");
  push_vector(L, found.v, velocity_labels(*s.model)), set(L, "v");
  push_initial(L, *s.model, found.q, &found.v), set(L, "initial");
  set_number(L, "residual", found.residual);
  lua_pushinteger(L, found.iterations), set(L, "iterations");
  lua_pushstring(L, found.message.c_str()), set(L, "message");
  return 1;
}

}  // namespace cardan
