// The global `sim`: the scene as it stands, in a mission and at the workbench.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/dynamics/loops.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/bindings/labels.hpp"
#include "scripts/bindings/linear.hpp"
#include "scripts/bindings/operator_methods.hpp"
#include "scripts/bindings/operators.hpp"
#include "scripts/bindings/sim.hpp"
#include "scripts/bindings/studies.hpp"
#include "scripts/lua/table.hpp"
#include "scripts/mission/workbench.hpp"

namespace cardan {
namespace {

constexpr char kType[] = "cardan.sim";

// ---- methods of sim ----

/// The scene; its workbench is null in a mission.
struct Sim {
  Scenario* scenario;
  Workbench* bench;
};

Sim& sim(lua_State* L) {
  auto* s = static_cast<Sim*>(luaL_testudata(L, 1, kType));
  if (!s) refuse(L, Code::lua_argument, "sim", "sim before a colon", describe_value(L, 1), "methods are called with a colon: sim:q()");
  return *s;
}
Scenario& scene(lua_State* L) {
  Scenario& s = *sim(L).scenario;
  if (!s.sim) refuse(L, Code::lua_argument, "sim", "a call after `vehicle`", "one before it");
  return s;
}
Workbench& workbench(lua_State* L, const char* what) {
  if (!sim(L).bench)
    refuse(L, Code::lua_argument, what, "a call at the workbench", "one in a mission",
           "a mission sets its state by initial{...} and runs by itself");
  return *sim(L).bench;
}

int t(lua_State* L) {
  lua_pushnumber(L, scene(L).time());
  return 1;
}
int q(lua_State* L) {
  const Scenario& s = scene(L);
  push_vector(L, Eigen::Map<const Eigen::VectorXd>(s.q, s.model->nq), coordinate_labels(*s.model));
  return 1;
}
int v(lua_State* L) {
  const Scenario& s = scene(L);
  push_vector(L, Eigen::Map<const Eigen::VectorXd>(s.v, s.model->nv), velocity_labels(*s.model));
  return 1;
}
int vdot(lua_State* L) {
  const Scenario& s = scene(L);
  s.expect_closed();
  if (s.in_event_function) refuse(L, Code::lua_argument, "sim:vdot", "coordinates, inside of an event's `when`", "v'");
  Labels labels = velocity_labels(*s.model);
  for (std::string& unit : labels.units) unit = unit.ends_with("/s") ? unit + "^2" : unit + "/s";
  for (std::string& name : labels.names) name += "'";
  push_vector(L, s.sim->vdot(), std::move(labels));
  return 1;
}

/// Of each hinge with a quaternion: no rotation belongs to the zero quaternion, and squares of what is far from 1 leave the range
/// of numbers.
void expect_quaternions(lua_State* L, const Model& m, const Eigen::VectorXd& q) {
  for (const UserBody& u : m.user) {
    if (!u.has_attitude()) continue;
    const double norm = q.segment(u.q, 4).stableNorm();
    if (!(norm >= 1e-6 && norm <= 1e6))
      refuse(L, Code::non_unit_quaternion, "sim:state.q",
             fmt::format("a quaternion of body {} with a length from 1e-6 to 1e6; it is normalised", u.name),
             fmt::format("length {:.6g}", norm));
  }
}

constexpr double kOpen = 1e-6;  // of the size of a loop, as at a start

/// Loops that are closed stay so: q that opens one is refused, and v that does; v that is not given becomes the nearest that goes with q.
/// Where lengths are given as functions of time the run looks, which knows them.
void keep_loops(lua_State* L, const Model& m, State& state, bool v_given) {
  if (m.loops.empty() || std::ranges::any_of(m.loops.all, [](const Loop& loop) { return loop.drive >= 0; })) return;
  LoopProjection projection(m);
  State closed = state;
  projection.close(closed.q.data(), closed.v.data());
  const auto refuse_open = [&](const char* what, const char* expected, double open, const char* unit) {
    refuse(L, Code::open_start, what, expected, fmt::format("a loop open by {:.3g}{} of its size", open, unit),
           "initial{...} and sim:inverse_kinematics{...} close loops; rates that are not given are found");
  };
  if (!(projection.distance() <= kOpen)) refuse_open("sim:state.q", "coordinates that leave the loops closed", projection.distance(), "");
  if (!v_given)
    state.v = closed.v;
  else if (!(projection.rate() <= kOpen * std::max(1.0, state.v.cwiseAbs().maxCoeff())))
    refuse_open("sim:state.v", "rates that keep the loops closed", projection.rate(), "/s");
}

/// sim:state() -> {t, q, v};  sim:state{t = , q = , v = } sets what is given.
int state(lua_State* L) {
  Scenario& s = scene(L);
  if (lua_isnoneornil(L, 2)) {
    lua_newtable(L);
    lua_pushnumber(L, s.time());
    lua_setfield(L, -2, "t");
    q(L);
    lua_setfield(L, -2, "q");
    v(L);
    lua_setfield(L, -2, "v");
    return 1;
  }
  Workbench& bench = workbench(L, "sim:state{...}");
  if (bench.is_running())
    refuse(L, Code::lua_argument, "sim:state", "a call between runs", "one from a controller, a sequence, a phase or an event");
  DiagnosticSink sink;
  LuaTable table(L, 2, "sim:state", sink);
  State state = s.sim->state();
  const auto read = [&](const char* key, Eigen::VectorXd& x) {
    if (!table.has(key)) return;
    lua_getfield(L, 2, key);
    x = to_vector(L, -1, x.size(), std::string("sim:state.") + key);
    lua_pop(L, 1);
    if (!x.allFinite()) table.reject(key, "finite numbers");
  };
  if (const auto time = table.number("t", "s")) state.t = *time;
  read("q", state.q);
  read("v", state.v);
  table.finish();
  sink.throw_if_any();
  expect_quaternions(L, *s.model, state.q);
  s.model->normalise(state.q.data());
  if (!state.q.allFinite()) refuse(L, Code::bad_initial_state, "sim:state.q", "coordinates that can be normalised", "some that cannot");
  if (table.has("q") || table.has("v")) keep_loops(L, *s.model, state, table.has("v"));
  bench.set_state(std::move(state));
  return 0;
}

/// Studies about the present state.
template <int (*kPush)(lua_State*, Scenario&)>
int study_of_scene(lua_State* L) {
  Scenario& s = scene(L);
  s.expect_closed();
  return at_script_line(L, [&s](lua_State* l) { return kPush(l, s); });
}

int vehicle(lua_State* L) {
  push_vehicle(L, scene(L));
  return 1;
}

/// sim:run_to(t) -> the time that was reached
int run_to(lua_State* L) {
  Workbench& bench = workbench(L, "sim:run_to");
  Scenario& s = bench.scenario();
  const double to = seconds_at(L, 2, "sim:run_to"), now = s.sim->time();
  if (bench.is_running())
    refuse(L, Code::lua_argument, "sim:run_to", "a call between runs", "one from a controller, a sequence, a phase or an event");
  if (!(to >= now))
    refuse(L, Code::lua_argument, "sim:run_to", fmt::format("a time from {} s on", now), describe_value(L, 2),
           "sim:state{t = ...} goes back");
  if (s.sim->stopped())
    refuse(L, Code::lua_argument, "sim:run_to", "a run that goes on", "one that stop() has ended", "sim:state{...} begins another");
  try {
    bench.run_to(to, [L](double) { LuaHost::charge(L, 0); });
  } catch (const NumericsError& e) {
    RunFailure f = e.failure();
    f.what += "\n  stack:    " + LuaHost::traceback(L);
    throw NumericsError(f);
  }
  return t(L);
}

int text(lua_State* L) {
  const Scenario& s = scene(L);
  const std::string& title = s.mission.title.empty() ? s.model->name : s.mission.title;
  lua_pushstring(
      L, fmt::format("sim: {}{}t = {} s, {} in q, {} in v", title, title.empty() ? "" : ", ", s.time(), s.model->nq, s.model->nv).c_str());
  return 1;
}

const std::vector<luaL_Reg> kMethods = {{"t", method<t, 0>},
                                        {"q", method<q, 0>},
                                        {"v", method<v, 0>},
                                        {"vdot", method<vdot, 0>},
                                        {"operators", method<study_of_scene<push_operators>, 1>},
                                        {"linearize", method<study_of_scene<push_linear_model>, 1>},
                                        {"system_modes", method<study_of_scene<push_modes>, 1>},
                                        {"derivatives", method<study_of_scene<push_derivatives>, 1>},
                                        {"inverse_kinematics", method<study_of_scene<push_inverse_kinematics>, 1>},
                                        {"equilibrium", method<study_of_scene<push_equilibrium>, 1>},
                                        {"closed_system", method<study_of_scene<push_closed_system>, 0>},
                                        {"state", method<state, 1>},
                                        {"vehicle", method<vehicle, 0>},
                                        {"run_to", method<run_to, 1>}};

}  // namespace

void bind_sim(Scenario& scenario, Workbench* bench) {
  scenario.lua.protect([&](lua_State* L) {
    if (luaL_getmetatable(L, kType) == LUA_TNIL) make_handle_type(L, kType, kMethods, method<text>);
    *static_cast<Sim*>(lua_newuserdatauv(L, sizeof(Sim), 0)) = {&scenario, bench};
    luaL_setmetatable(L, kType);
    lua_setglobal(L, "sim");
  });
}

}  // namespace cardan
