// What a script asks the vehicle for. A handle is a userdata with an index; its methods are plain C functions that read
// or set numbers: no allocation, no lookup of names.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "core/base/units.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/bindings/linear.hpp"
#include "scripts/bindings/operators.hpp"
#include "scripts/bindings/studies.hpp"
#include "scripts/lua/table.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {
namespace {

enum class Kind : int { vehicle, body, hinge, modes, node, load, n_kinds };
constexpr const char* kTypes[] = {"cardan.vehicle", "cardan.body", "cardan.hinge",
                                  "cardan.modes",   "cardan.node", "cardan.load"};
constexpr const char* kWords[] = {"vehicle", "body", "hinge", "modes", "node", "load"};

struct Handle {
  Kind kind;
  int index;  // user body, node or slot
  Scenario* scenario;
  const UserBody& user() const { return scenario->model->user[static_cast<std::size_t>(index)]; }
};

/// The handle a method was called on.
template <Kind kKind>
Handle& self(lua_State* L) {
  auto* h = static_cast<Handle*>(lua_touserdata(L, 1));
  if (!h || lua_rawlen(L, 1) != sizeof(Handle) || h->kind != kKind)
    refuse(L, Code::lua_argument, kWords[static_cast<int>(kKind)],
           fmt::format("a {} before a colon", kWords[static_cast<int>(kKind)]), describe_value(L, 1),
           "methods are called with a colon: wheel:rate()");
  return *h;
}

/// Event functions are evaluated at trial states, where only coordinates are known.
void expect_state(lua_State* L, const Scenario& s, const char* what) {
  if (s.in_event_function)
    refuse(L, Code::lua_argument, what, "hinge and mode coordinates, and t, inside of an event's `when`", what,
           "an event is located by its function at trial states, where nothing else is known");
}

std::string listed(const std::vector<std::string>& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

/// Index of the component of a coordinate or velocity (`names` are its own) that argument `arg` names: 1, 2, ... or a name; the
/// first one if absent. Where each coordinate has its rate, both names will do; the name of the body may stand before it.
int component(lua_State* L, int arg, const std::vector<std::string>& names, const UserBody& u) {
  const std::string& body = u.name;
  const int type = lua_type(L, arg);
  const auto n = static_cast<lua_Integer>(names.size());
  if (type == LUA_TNUMBER || type == LUA_TNONE || type == LUA_TNIL) {
    const lua_Integer i = type == LUA_TNUMBER ? lua_tointeger(L, arg) : 1;
    if (i >= 1 && i <= n) return static_cast<int>(i) - 1;
  } else if (type == LUA_TSTRING) {
    std::string_view name = lua_tostring(L, arg);
    if (name.starts_with(body) && name.substr(body.size()).starts_with('.')) name.remove_prefix(body.size() + 1);
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == name || (u.nq == u.nv && (u.q_names[i] == name || u.v_names[i] == name))) return static_cast<int>(i);
  }
  const std::string word = type == LUA_TSTRING ? lua_tostring(L, arg) : "";
  refuse(L, Code::unknown_name, "hinge of " + body,
         n == 0 ? "a hinge that moves" : fmt::format("1 to {}, or a name: {}", n, listed(names)),
         type == LUA_TNONE ? "the first component" : describe_value(L, arg), did_you_mean(word, names));
}

/// A number that is to be set; one that is not finite ends the run, whatever the script does about it.
double command(lua_State* L, int arg, Scenario& s, const char* what, const std::string& name) {
  if (lua_type(L, arg) != LUA_TNUMBER)
    refuse(L, Code::lua_argument, fmt::format("{} of {}", what, name), "a number", describe_value(L, arg));
  const double x = lua_tonumber(L, arg);
  if (std::isfinite(x)) return x;
  const std::string got = fmt::format("{} of {} = {}", what, name, std::isnan(x) ? "nan" : x > 0 ? "inf" : "-inf");
  if (s.stage == Scenario::Stage::setup)
    refuse(L, Code::lua_argument, fmt::format("{} of {}", what, name), "a finite number", got);
  s.fault = RunFailure{Code::controller_nan,
                       s.sim->time(),
                       "",
                       "",
                       fmt::format("{}: {}{}", s.actor, got, place_of_failure(LuaHost::caller(L))),
                       "a division by zero, or the root of a negative number?",
                       ""};
  refuse(L, Code::lua_argument, fmt::format("{} of {}", what, name), "a finite number", got);
}

int push3(lua_State* L, const Eigen::Vector3d& x) {
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, x[i]);
  return 3;
}
int push_quaternion(lua_State* L, const Eigen::Matrix3d& R) {
  Eigen::Quaterniond q(R);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  for (double x : {q.w(), q.x(), q.y(), q.z()}) lua_pushnumber(L, x);
  return 4;
}

// ---- bodies ----

/// A body whose own frame hangs on the world frame by a quaternion hinge: attitude and rate are coordinates.
bool is_direct(const UserBody& u) {
  const auto is_identity = [](const Pose<double>& p) { return to_eigen(p.R) == Eigen::Matrix3d::Identity(); };
  return u.parent < 0 && u.nq >= 4 && u.q_names[0] == "qw" && is_identity(u.onode) && is_identity(u.pnode);
}

NodeState state_of(lua_State* L, Scenario& s, const std::string& node, const char* what) {
  expect_state(L, s, what);
  return s.sim->observe().node(s.model->find_node(node));
}
NodeState body_state(lua_State* L, Handle& h, const char* what) {
  return state_of(L, *h.scenario, h.user().name, what);
}

int body_attitude(lua_State* L) {
  Handle& h = self<Kind::body>(L);
  const UserBody& u = h.user();
  if (!is_direct(u)) return push_quaternion(L, body_state(L, h, "the attitude of a body").R_WN);
  for (int i = 0; i < 4; ++i) lua_pushnumber(L, h.scenario->q[u.q + i]);
  return 4;
}
int body_rate(lua_State* L) {
  Handle& h = self<Kind::body>(L);
  const UserBody& u = h.user();
  if (!is_direct(u)) return push3(L, body_state(L, h, "the rate of a body").velocity.head<3>());
  for (int i = 0; i < 3; ++i) lua_pushnumber(L, h.scenario->v[u.v + i]);
  return 3;
}
int body_position(lua_State* L) {
  return push3(L, body_state(L, self<Kind::body>(L), "the position of a body").position);
}
int body_velocity(lua_State* L) {
  const NodeState n = body_state(L, self<Kind::body>(L), "the velocity of a body");
  return push3(L, n.R_WN * n.velocity.tail<3>());
}
int body_mass(lua_State* L) {
  lua_pushnumber(L, self<Kind::body>(L).user().mass);
  return 1;
}

// ---- hinges ----

int hinge_q(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  const UserBody& u = h.user();
  lua_pushnumber(L, h.scenario->q[u.q + component(L, 2, u.q_names, u)]);
  return 1;
}
int hinge_v(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  const UserBody& u = h.user();
  lua_pushnumber(L, h.scenario->v[u.v + component(L, 2, u.v_names, u)]);
  return 1;
}

bool is_prescribed(const Model& m, int v) { return m.has_prescribed() && m.prescribed[static_cast<std::size_t>(v)]; }

int hinge_force(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  Scenario& s = *h.scenario;
  const UserBody& u = h.user();
  expect_state(L, s, "a command");
  const double x = command(L, 2, s, "force on hinge", u.name);
  const int v = u.v + component(L, 3, u.v_names, u);
  if (is_prescribed(*s.model, v))
    refuse(L, Code::lua_argument, "hinge of " + u.name, "a component that is free to move", "a prescribed one",
           "its motion is given by :profile{...}; :applied() tells the force it needs");
  s.sim->set_force(v, x);
  return 0;
}
int hinge_applied(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "the force on a hinge");
  const int v = h.user().v + component(L, 2, h.user().v_names, h.user());
  if (!is_prescribed(*s.model, v)) {
    lua_pushnumber(L, s.sim->force(v));
    return 1;
  }
  s.sim->observe().prescribed_forces(s.scratch.data());
  lua_pushnumber(L, s.scratch[static_cast<std::size_t>(v)]);
  return 1;
}
int hinge_reaction(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  expect_state(L, *h.scenario, "the reaction of a hinge");
  const Force<double> f = h.scenario->sim->observe().hinge_wrench(h.index);
  for (double x : {f.n.x, f.n.y, f.n.z, f.f.x, f.f.y, f.f.z}) lua_pushnumber(L, x);
  return 6;
}

/// {{t, rate}, ...} with rising t.
std::vector<std::pair<double, double>> rate_points(lua_State* L, LuaTable& t, const std::string& unit) {
  std::vector<std::pair<double, double>> points;
  lua_getfield(L, 2, "rate_table");
  const int table = lua_gettop(L);
  const auto number = [&](lua_Integer i, const char* as) {
    const int type = lua_rawgeti(L, -1, i);
    double x = std::nan("");
    if (type == LUA_TNUMBER) x = lua_tonumber(L, -1);
    if (type == LUA_TSTRING) {
      const auto value = parse_quantity(lua_tostring(L, -1), as);
      if (const double* got = std::get_if<double>(&value)) x = *got;
    }
    lua_pop(L, 1);
    return x;
  };
  bool good = lua_istable(L, table) && lua_rawlen(L, table) > 0;
  for (lua_Integer i = 1; good && i <= static_cast<lua_Integer>(lua_rawlen(L, table)); ++i) {
    good = lua_rawgeti(L, table, i) == LUA_TTABLE && lua_rawlen(L, -1) == 2;
    if (good) points.emplace_back(number(1, "s"), number(2, unit.c_str()));
    good = good && std::isfinite(points.back().first) && std::isfinite(points.back().second) &&
           (i == 1 || points.back().first > points[points.size() - 2].first);
    lua_pop(L, 1);
  }
  lua_pop(L, 1);
  if (!good)
    t.reject("rate_table", fmt::format("{{{{t, rate}}, ...}} in s and {}, at least one point, t rising", unit));
  return points;
}

int hinge_profile(lua_State* L) {
  const Handle& h = self<Kind::hinge>(L);
  Scenario& s = *h.scenario;
  const UserBody& u = h.user();
  expect_state(L, s, "a profile");
  lua_settop(L, 2);
  DiagnosticSink sink;
  LuaTable t(L, 2, "profile of " + u.name, sink);
  sink.throw_if_any();
  t.has("component");
  lua_getfield(L, 2, "component");
  const int c = component(L, lua_gettop(L), u.v_names, u), v = u.v + c;
  lua_pop(L, 1);
  const std::string &rate = u.v_units[static_cast<std::size_t>(c)], unit = rate.substr(0, rate.find('/'));
  if (!is_prescribed(*s.model, v))
    refuse(L, Code::lua_argument, "profile of " + u.name, "a component that is prescribed", "one that is free to move",
           fmt::format("say so in the vehicle: bodies.{}.hinge.prescribed: [{}]", u.name,
                       u.v_names[static_cast<std::size_t>(c)]));
  MotionProfile profile;
  if (int(t.has("rate_table")) + int(t.has("sine")) + int(t.has("hold")) != 1) {
    t.reject("rate_table", "exactly one of rate_table, sine, hold");
  } else if (t.has("rate_table")) {
    profile = MotionProfile::rate_table(rate_points(L, t, rate));
  } else if (const auto hold = t.number("hold", rate)) {
    profile = MotionProfile::hold(*hold);
  } else if (auto sine = t.table("sine")) {
    sine->require({"amplitude", "frequency"});
    profile =
        MotionProfile::sine(sine->number("amplitude", unit).value_or(0.0),
                            sine->number("frequency", "Hz").value_or(0.0), sine->number("phase", "rad").value_or(0.0));
    sine->finish();
  }
  t.finish();
  sink.throw_if_any();
  s.sim->prescribe(v, std::move(profile));
  return 0;
}

// ---- modes ----

int mode(lua_State* L, const UserBody& u) {
  int is_integer = 0;
  const lua_Integer i = lua_tointegerx(L, 2, &is_integer);
  if (!is_integer || i < 1 || i > u.n_modes)
    refuse(L, Code::unknown_name, "modes of " + u.name, fmt::format("a mode: 1 to {}", u.n_modes),
           describe_value(L, 2));
  return static_cast<int>(i) - 1;
}
int modes_eta(lua_State* L) {
  const Handle& h = self<Kind::modes>(L);
  lua_pushnumber(L, h.scenario->q[h.user().eta + mode(L, h.user())]);
  return 1;
}
int modes_etadot(lua_State* L) {
  const Handle& h = self<Kind::modes>(L);
  lua_pushnumber(L, h.scenario->v[h.user().etadot + mode(L, h.user())]);
  return 1;
}
int modes_count(lua_State* L) {
  lua_pushinteger(L, self<Kind::modes>(L).user().n_modes);
  return 1;
}
int modes_frequency(lua_State* L) {
  const Handle& h = self<Kind::modes>(L);
  const int j = mode(L, h.user());
  const SystemSpec& spec = *h.scenario->model->spec;
  const ModalData& d = *spec.bodies[static_cast<std::size_t>(h.index)].modal;
  lua_pushnumber(L, std::sqrt(d.K(j, j) / d.integrals.I6(j, j)) / (2.0 * std::numbers::pi));
  return 1;
}

// ---- nodes and loads ----

NodeState node_state(lua_State* L, const Handle& h, const char* what) {
  expect_state(L, *h.scenario, what);
  return h.scenario->sim->observe().node(h.index);
}
int node_position(lua_State* L) {
  return push3(L, node_state(L, self<Kind::node>(L), "the position of a node").position);
}
int node_attitude(lua_State* L) {
  return push_quaternion(L, node_state(L, self<Kind::node>(L), "the attitude of a node").R_WN);
}
int node_rate(lua_State* L) {
  return push3(L, node_state(L, self<Kind::node>(L), "the rate of a node").velocity.head<3>());
}
int node_velocity(lua_State* L) {
  const NodeState n = node_state(L, self<Kind::node>(L), "the velocity of a node");
  return push3(L, n.R_WN * n.velocity.tail<3>());
}
int node_acceleration(lua_State* L) {
  const NodeState n = node_state(L, self<Kind::node>(L), "the acceleration of a node");
  return push3(L, n.R_WN * n.acceleration.tail<3>());
}

int node_specific_force(lua_State* L) {
  return push3(L, node_state(L, self<Kind::node>(L), "the specific force at a node").specific_force);
}
int node_angular_acceleration(lua_State* L) {
  return push3(L, node_state(L, self<Kind::node>(L), "the acceleration of a node").acceleration.head<3>());
}

void push_handle(lua_State* L, Kind kind, int index, Scenario& s) {
  auto* h = static_cast<Handle*>(lua_newuserdatauv(L, sizeof(Handle), 0));
  *h = {kind, index, &s};
  luaL_setmetatable(L, kTypes[static_cast<int>(kind)]);
}

int node_load(lua_State* L) {
  const Handle& h = self<Kind::node>(L);
  Scenario& s = *h.scenario;
  expect_setup(L, s, "load", true);
  lua_settop(L, 2);
  if (lua_isnil(L, 2)) {
    lua_newtable(L);
    lua_replace(L, 2);
  }
  DiagnosticSink sink;
  LuaTable t(L, 2, "load", sink);
  const bool world_axes = t.choice("axes", {"node", "world"}).value_or("node") == "world";
  t.finish();
  sink.throw_if_any();
  s.loads.push_back({h.index, world_axes});
  CompileOptions options;  // a scene without loads has no op for them
  options.world_wrenches = std::any_of(s.loads.begin(), s.loads.end(), [](const Load& l) { return l.world_axes; });
  s.use_model(compile(s.model->spec, s.registry, options));
  push_handle(L, Kind::load, static_cast<int>(s.loads.size()) - 1, s);
  return 1;
}

int load_set(lua_State* L) {
  const Handle& h = self<Kind::load>(L);
  Scenario& s = *h.scenario;
  expect_state(L, s, "a command");
  const std::string& node =
      s.model->nodes[static_cast<std::size_t>(s.loads[static_cast<std::size_t>(h.index)].node)].name;
  double x[6];
  for (int i = 0; i < 6; ++i) x[i] = command(L, i + 2, s, "load on node", node);
  s.sim->set_wrench(h.index, {{x[0], x[1], x[2]}, {x[3], x[4], x[5]}});
  return 0;
}

// ---- the vehicle ----

template <class Objects>
int find(lua_State* L, const Objects& objects, Code code, const char* key_path, const char* what) {
  std::vector<std::string> names;
  for (const auto& o : objects) names.push_back(o.name);
  if (lua_type(L, 2) != LUA_TSTRING)
    refuse(L, Code::lua_argument, key_path, std::string("the name of ") + what, describe_value(L, 2));
  const std::string name = lua_tostring(L, 2);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    refuse(L, code, key_path, fmt::format("{}: {}", what, listed(names)), in_quotes(name), did_you_mean(name, names));
  return static_cast<int>(found - names.begin());
}

template <Kind kKind>
int vehicle_part(lua_State* L) {
  Handle& h = self<Kind::vehicle>(L);
  Scenario& s = *h.scenario;
  const Model& m = *s.model;
  const int index = kKind == Kind::node ? find(L, m.nodes, Code::unknown_node, "vehicle:node", "a node of the vehicle")
                                        : find(L, m.user, Code::unknown_body, "vehicle:body", "a body of the vehicle");
  if (kKind == Kind::modes && m.user[static_cast<std::size_t>(index)].n_modes == 0)
    refuse(L, Code::unknown_name, "vehicle:modes", "a flexible body", describe_value(L, 2));
  push_handle(L, kKind, index, s);
  return 1;
}
int vehicle_mass(lua_State* L) {
  double mass = 0.0;
  for (const UserBody& u : self<Kind::vehicle>(L).scenario->model->user) mass += u.mass;
  lua_pushnumber(L, mass);
  return 1;
}

/// Studies about the present state.
template <int (*kPush)(lua_State*, Scenario&)>
int vehicle_study(lua_State* L) {
  Scenario& s = *self<Kind::vehicle>(L).scenario;
  return at_script_line(L, [&s](lua_State* l) { return kPush(l, s); });
}

/// hinge "rod": angle
int handle_text(lua_State* L) {
  const auto& h = *static_cast<Handle*>(lua_touserdata(L, 1));
  const Model& m = *h.scenario->model;
  const char* word = kWords[static_cast<int>(h.kind)];
  const auto named = [&](const std::string& name, const std::string& rest = {}) { return fmt::format("{} \"{}\"{}", word, name, rest); };
  const auto node = [&](int i) { return m.nodes[static_cast<std::size_t>(i)].name; };
  std::string text;
  switch (h.kind) {
    case Kind::vehicle: {
      std::vector<std::string> names;
      for (const UserBody& u : m.user) names.push_back(u.name);
      text = fmt::format("vehicle: {}", listed(names));
      break;
    }
    case Kind::hinge:
      text = named(h.user().name, ": " + (h.user().nq > 0 ? listed(h.user().q_names) : "locked"));
      break;
    case Kind::modes:
      text = named(h.user().name, fmt::format(": {}", h.user().n_modes));
      break;
    case Kind::node:
      text = named(node(h.index));
      break;
    case Kind::load:
      text = named(node(h.scenario->loads[static_cast<std::size_t>(h.index)].node));
      break;
    default:
      text = named(h.user().name);
  }
  lua_pushlstring(L, text.data(), text.size());
  return 1;
}

// ---- tables of methods ----

template <lua_CFunction kFunction>
int method(lua_State* L) {
  return LuaHost::guarded(L, kFunction);
}

struct Method {
  Kind kind;
  const char* name;
  lua_CFunction function;
};
constexpr Method kMethods[] = {
    {Kind::vehicle, "body", method<vehicle_part<Kind::body>>},
    {Kind::vehicle, "hinge", method<vehicle_part<Kind::hinge>>},
    {Kind::vehicle, "modes", method<vehicle_part<Kind::modes>>},
    {Kind::vehicle, "node", method<vehicle_part<Kind::node>>},
    {Kind::vehicle, "mass", method<vehicle_mass>},
    {Kind::vehicle, "operators", method<vehicle_study<push_operators>>},
    {Kind::vehicle, "linearize", method<vehicle_study<push_linear_model>>},
    {Kind::vehicle, "system_modes", method<vehicle_study<push_modes>>},
    {Kind::vehicle, "derivatives", method<vehicle_study<push_derivatives>>},
    {Kind::vehicle, "inverse_kinematics", method<vehicle_study<push_inverse_kinematics>>},
    {Kind::body, "attitude", method<body_attitude>},
    {Kind::body, "rate", method<body_rate>},
    {Kind::body, "position", method<body_position>},
    {Kind::body, "velocity", method<body_velocity>},
    {Kind::body, "mass", method<body_mass>},
    {Kind::hinge, "angle", method<hinge_q>},
    {Kind::hinge, "q", method<hinge_q>},
    {Kind::hinge, "rate", method<hinge_v>},
    {Kind::hinge, "v", method<hinge_v>},
    {Kind::hinge, "torque", method<hinge_force>},
    {Kind::hinge, "force", method<hinge_force>},
    {Kind::hinge, "applied", method<hinge_applied>},
    {Kind::hinge, "reaction", method<hinge_reaction>},
    {Kind::hinge, "profile", method<hinge_profile>},
    {Kind::modes, "eta", method<modes_eta>},
    {Kind::modes, "etadot", method<modes_etadot>},
    {Kind::modes, "count", method<modes_count>},
    {Kind::modes, "frequency", method<modes_frequency>},
    {Kind::node, "position", method<node_position>},
    {Kind::node, "attitude", method<node_attitude>},
    {Kind::node, "rate", method<node_rate>},
    {Kind::node, "velocity", method<node_velocity>},
    {Kind::node, "acceleration", method<node_acceleration>},
    {Kind::node, "angular_acceleration", method<node_angular_acceleration>},
    {Kind::node, "specific_force", method<node_specific_force>},
    {Kind::node, "load", method<node_load>},
    {Kind::load, "set", method<load_set>},
};

/// __index of the method tables: a method that does not exist.
int unknown_method(lua_State* L) {
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, 1); lua_pop(L, 1)) names.emplace_back(lua_tostring(L, -2));
  std::sort(names.begin(), names.end());
  const std::string name = lua_type(L, 2) == LUA_TSTRING ? lua_tostring(L, 2) : luaL_typename(L, 2);
  refuse(L, Code::unknown_name, "method", "one of: " + listed(names), in_quotes(name), did_you_mean(name, names));
}

}  // namespace

void make_handle_type(lua_State* L, const char* type, const std::vector<luaL_Reg>& methods, lua_CFunction text) {
  luaL_newmetatable(L, type);
  lua_newtable(L);
  for (const luaL_Reg& m : methods) {
    lua_pushcfunction(L, m.func);
    lua_setfield(L, -2, m.name);
  }
  lua_newtable(L);
  lua_pushcfunction(L, method<unknown_method>);
  lua_setfield(L, -2, "__index");
  lua_setmetatable(L, -2);
  lua_setfield(L, -2, "__index");
  lua_pushcfunction(L, text);
  lua_setfield(L, -2, "__tostring");
  lua_pushboolean(L, 0);
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
}

void bind_handles(Scenario& s) {
  s.lua.protect([](lua_State* L) {
    for (int kind = 0; kind < static_cast<int>(Kind::n_kinds); ++kind) {
      std::vector<luaL_Reg> methods;
      for (const Method& m : kMethods)
        if (static_cast<int>(m.kind) == kind) methods.push_back({m.name, m.function});
      make_handle_type(L, kTypes[kind], methods, method<handle_text>);
    }
  });
}

void push_vehicle(lua_State* L, Scenario& s) { push_handle(L, Kind::vehicle, 0, s); }

}  // namespace cardan
