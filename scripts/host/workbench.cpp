#include "scripts/host/workbench.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scripts/host/bind_operators.hpp"
#include "scripts/host/lua_table.hpp"

namespace cardan {
namespace {

constexpr char kType[] = "cardan.sim";

void append(Labels& labels, const std::string& body, const std::vector<std::string>& names, const std::vector<std::string>& units) {
  for (const std::string& name : names) labels.names.push_back(body + "." + name);
  labels.units.insert(labels.units.end(), units.begin(), units.end());
}
void append_modes(Labels& labels, const UserBody& u, const char* name, const char* unit) {
  for (int j = 1; j <= u.n_modes; ++j) labels.names.push_back(fmt::format("{}.{}_{}", u.name, name, j));
  labels.units.insert(labels.units.end(), static_cast<std::size_t>(u.n_modes), unit);
}

// ---- methods of sim ----

Workbench& self(lua_State* L) {
  auto* bench = static_cast<Workbench**>(luaL_testudata(L, 1, kType));
  if (!bench) refuse(L, Code::lua_argument, "sim", "sim before a colon", describe_value(L, 1), "methods are called with a colon: sim:q()");
  return **bench;
}

int t(lua_State* L) {
  lua_pushnumber(L, self(L).scenario().sim->time());
  return 1;
}
int q(lua_State* L) {
  const Scenario& s = self(L).scenario();
  push_vector(L, Eigen::Map<const Eigen::VectorXd>(s.q, s.model->nq), coordinate_labels(*s.model));
  return 1;
}
int v(lua_State* L) {
  const Scenario& s = self(L).scenario();
  push_vector(L, Eigen::Map<const Eigen::VectorXd>(s.v, s.model->nv), velocity_labels(*s.model));
  return 1;
}
int vdot(lua_State* L) {
  const Scenario& s = self(L).scenario();
  if (s.in_event_function) refuse(L, Code::lua_argument, "sim:vdot", "coordinates, inside of an event's `when`", "v'");
  Labels labels = velocity_labels(*s.model);
  for (std::string& unit : labels.units) unit = unit.ends_with("/s") ? unit + "^2" : unit + "/s";
  for (std::string& name : labels.names) name += "'";
  push_vector(L, s.sim->vdot(), std::move(labels));
  return 1;
}

double finite(lua_State* L, int index, const char* what) {
  if (lua_type(L, index) != LUA_TNUMBER || !std::isfinite(lua_tonumber(L, index)))
    refuse(L, Code::lua_argument, what, "a time in s", describe_value(L, index));
  return lua_tonumber(L, index);
}

/// sim:state() -> {t, q, v};  sim:state{t = , q = , v = } sets what is given.
int state(lua_State* L) {
  Workbench& bench = self(L);
  Scenario& s = bench.scenario();
  if (lua_isnoneornil(L, 2)) {
    lua_newtable(L);
    lua_pushnumber(L, s.sim->time());
    lua_setfield(L, -2, "t");
    q(L);
    lua_setfield(L, -2, "q");
    v(L);
    lua_setfield(L, -2, "v");
    return 1;
  }
  if (bench.is_running())
    refuse(L, Code::lua_argument, "sim:state", "a call between runs", "one from a controller, a phase or an event");
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
  bench.set_state(std::move(state));
  return 0;
}

int operators(lua_State* L) { return push_operators(L, self(L).scenario()); }

int vehicle(lua_State* L) {
  push_vehicle(L, self(L).scenario());
  return 1;
}

/// sim:run_to(t) -> the time that was reached
int run_to(lua_State* L) {
  Workbench& bench = self(L);
  Scenario& s = bench.scenario();
  const double to = finite(L, 2, "sim:run_to"), now = s.sim->time();
  if (bench.is_running()) refuse(L, Code::lua_argument, "sim:run_to", "a call between runs", "one from a controller, a phase or an event");
  if (!(to >= now))
    refuse(L, Code::lua_argument, "sim:run_to", fmt::format("a time from {} s on", now), describe_value(L, 2), "sim:state{t = ...} goes back");
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
  const Scenario& s = self(L).scenario();
  const std::string& title = s.mission.title.empty() ? s.model->name : s.mission.title;
  lua_pushstring(L, fmt::format("sim: {}{}t = {} s, {} in q, {} in v", title, title.empty() ? "" : ", ", s.sim->time(),
                                s.model->nq, s.model->nv)
                        .c_str());
  return 1;
}

template <lua_CFunction kFunction>
int method(lua_State* L) {
  return LuaHost::guarded(L, kFunction);
}

const std::vector<luaL_Reg> kMethods = {
    {"t", method<t>},         {"q", method<q>},           {"v", method<v>},          {"vdot", method<vdot>},
    {"operators", method<operators>}, {"state", method<state>}, {"vehicle", method<vehicle>}, {"run_to", method<run_to>}};

}  // namespace

Labels coordinate_labels(const Model& m) {
  Labels all;
  for (const UserBody& u : m.user) {
    append(all, u.name, u.q_names, u.q_units);
    append_modes(all, u, "eta", "1");
  }
  return all;
}

Labels velocity_labels(const Model& m) {
  Labels all;
  for (const UserBody& u : m.user) {
    append(all, u.name, u.v_names, u.v_units);
    append_modes(all, u, "etadot", "1/s");
  }
  return all;
}

Workbench::Workbench(Scenario& scenario) : s_(scenario) {
  s_.lua.protect([this](lua_State* L) {
    make_handle_type(L, kType, kMethods, method<text>);
    *static_cast<Workbench**>(lua_newuserdatauv(L, sizeof(Workbench*), 0)) = this;
    luaL_setmetatable(L, kType);
    lua_setglobal(L, "sim");
  });
}

void Workbench::set_state(State state) {
  s_.model->normalise(state.q.data());
  s_.use_model(s_.model);  // a simulation that has not begun, without what the run had put into it
  run_.reset();
  s_.sim->set_state(state);
  s_.look_at_state();
  s_.stage = Scenario::Stage::setup;
  s_.phase = {};
}

void Workbench::run_to(double t, const std::function<void(double)>& between_steps) {
  struct Running {
    bool& flag;
    explicit Running(bool& f) : flag(f) { flag = true; }
    ~Running() { flag = false; }
  } const scope(running_);
  if (!run_) run_ = std::make_unique<MissionRun>(s_, recorder_, std::vector<Output>());
  run_->run(t, between_steps);
}

}  // namespace cardan
