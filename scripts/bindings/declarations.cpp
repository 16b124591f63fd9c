// What happens during the mission, as a script declares it: controllers, phases, events, signals, checks.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/units.hpp"
#include "core/io/run_columns.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {
namespace {

/// The table of a declaration: its name, and at the end every fault at once.
class Declaration {
 public:
  Declaration(lua_State* L, Scenario& s, const char* what) : s_(s), table_(checked(L, s, what), 1, what, sink_) {}

  LuaTable& table() { return table_; }
  std::string name() {
    name_ = table_.text("name").value_or("");
    if (name_.empty())
      table_.reject("name", "a name");
    else if (s_.names.contains({table_.path(), name_}))
      table_.reject("name", fmt::format("a name that no other {} has", table_.path()));
    return name_;
  }
  LuaFunction function(const char* key, bool required) {
    auto f = table_.function(key);
    if (required) table_.require({key});
    return f ? std::move(*f) : LuaFunction();
  }
  void finish() {
    table_.finish();
    sink_.throw_if_any();
    s_.names.insert({table_.path(), name_});
  }

 private:
  static lua_State* checked(lua_State* L, const Scenario& s, const char* what) {
    expect_setup(L, s, what, true);
    return L;
  }
  Scenario& s_;
  DiagnosticSink sink_;
  LuaTable table_;
  std::string name_;
};

int controller(lua_State* L, Scenario& s) {
  Declaration d(L, s, "controller");
  Controller c;
  c.name = d.name();
  LuaTable& t = d.table();
  const Located here{"controller", LuaHost::caller(L)};
  const bool both = t.has("rate") == t.has("period");
  const auto rate = t.number("rate", "Hz"), period = t.number("period", "s");
  if (both)
    t.reject("rate", "a rate, or a period");
  else if (rate || period)  // else what stands there was refused
    c.period = rate ? period_from_hertz(*rate, here) : period_from_seconds(*period, here);
  c.at = {fmt::format("controller {}.{}", c.name, rate ? "rate" : "period"), here.mark};
  c.step = d.function("step", true);
  d.finish();
  s.controllers.push_back(std::move(c));
  return 0;
}

int phase(lua_State* L, Scenario& s) {
  Declaration d(L, s, "phase");
  Phase p;
  p.name = d.name();
  const auto duration = d.table().number("duration", "s");
  if (duration) p.duration = *duration;
  if (duration && !(*duration >= 0.0)) d.table().reject("duration", "a time >= 0");
  p.until = d.function("until_", false);
  p.enter = d.function("enter", false);
  p.exit = d.function("exit_", false);
  p.next = d.table().text("next").value_or("");
  p.declared = LuaHost::caller(L);
  d.finish();
  s.phases.push_back(std::move(p));
  return 0;
}

int event(lua_State* L, Scenario& s) {
  Declaration d(L, s, "event");
  ScriptEvent e;
  e.name = d.name();
  e.when = d.function("when", true);
  e.action = d.function("action", false);
  const std::string direction = d.table().choice("direction", {"rising", "falling", "both"}).value_or("both");
  e.direction = direction == "rising" ? 1 : direction == "falling" ? -1 : 0;
  e.once = d.table().flag("once").value_or(false);
  if (e.once && e.direction == 0) d.table().reject("once", "true beside direction = \"rising\" or \"falling\"");
  d.finish();
  s.events.push_back(std::move(e));
  return 0;
}

Measure measure(Declaration& d) {
  Measure m;
  m.name = d.name();
  m.unit = d.table().text("unit").value_or("1");
  if (!parse_unit(m.unit)) d.table().reject("unit", "a unit: deg, N m, 1", unit_hint(m.unit));
  m.value = d.function("value", true);
  return m;
}

int figure(lua_State* L, Scenario& s) {
  Declaration d(L, s, "figure");
  Measure m = measure(d);
  d.finish();
  s.figures.push_back(std::move(m));
  return 0;
}

int check(lua_State* L, Scenario& s) {
  Declaration d(L, s, "check");
  Measure m = measure(d);
  LuaTable& t = d.table();
  const std::string unit = m.unit == "1" ? "" : " " + m.unit;
  // Limits are numbers in the unit of the check.
  if (const auto x = t.number("below")) m.high = *x, m.condition = fmt::format("below {:.6g}{}", *x, unit);
  if (const auto x = t.number("above")) m.low = *x, m.condition = fmt::format("above {:.6g}{}", *x, unit);
  if (const auto x = t.numbers("within", 2)) {
    m.low = (*x)[0], m.high = (*x)[1];
    m.condition = fmt::format("within {:.6g} ... {:.6g}{}", m.low, m.high, unit);
    if (!(m.low <= m.high)) t.reject("within", "{smallest, largest}");
  }
  if (auto equal = t.table("equal", "{x, tolerance = ...}")) {
    const double x = equal->first().value_or(0.0), tolerance = equal->number("tolerance").value_or(0.0);
    if (!(tolerance >= 0.0)) equal->reject("tolerance", "a number >= 0");
    equal->finish();
    m.low = x - tolerance, m.high = x + tolerance;
    m.condition = fmt::format("equal to {:.6g} within {:.3g}{}", x, tolerance, unit);
  }
  if (t.has("below") + t.has("above") + t.has("within") + t.has("equal") != 1)
    t.reject("below", "exactly one of below, above, within, equal");
  d.finish();
  s.checks.push_back(std::move(m));
  return 0;
}

/// The function that stores the numbers of one signal: upvalues are the signal and its name.
int store(lua_State* L) {
  auto& signal = *static_cast<Signal*>(lua_touserdata(L, lua_upvalueindex(1)));
  if (signal.scenario->in_event_function)
    refuse(L, Code::lua_argument, signal.channel.path, "signals stored by controllers, phases and actions",
           "one stored in an event's `when`", "it is evaluated at trial states that are not part of the motion");
  const auto n = static_cast<int>(signal.values.size());
  if (lua_gettop(L) != n)
    refuse(L, Code::lua_argument, signal.channel.path, fmt::format("{} number{}", n, n == 1 ? "" : "s"),
           lua_gettop(L) == 1 ? describe_value(L, 1) : fmt::format("{} values", lua_gettop(L)),
           lua_istable(L, 1) ? "numbers one by one: store(table.unpack(x))" : "");
  for (int i = 1; i <= n; ++i) {
    if (lua_type(L, i) != LUA_TNUMBER) refuse(L, Code::lua_argument, signal.channel.path, "a number", describe_value(L, i));
    const double x = lua_tonumber(L, i);
    signal.values[static_cast<std::size_t>(i) - 1] = x;
    if (!std::isfinite(x) && signal.scenario->sim)  // recorded as it is: a division by zero at one tick need not end the run
      signal.scenario->sim->warn(Code::mission_doubt, {"signals." + signal.channel.path, LuaHost::caller(L)},
                                 fmt::format("signal {} is {}", signal.channel.path,
                                             std::isnan(x) ? "nan"
                                             : x > 0       ? "inf"
                                                           : "-inf"),
                                 "a division by zero, or the root of a negative number?");
  }
  return 0;
}

bool is_channel_path(const std::string& path) {
  return !path.empty() && path.front() != '/' && path.back() != '/' && path.find("//") == std::string::npos &&
         std::all_of(path.begin(), path.end(),
                     [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == '/'; });
}

/// persist{...}: the table itself, which is in every checkpoint.
int persist(lua_State* L, Scenario& s) {
  expect_setup(L, s, "persist", false);
  if (!lua_istable(L, 1) || lua_gettop(L) != 1)
    refuse(L, Code::lua_argument, "persist", "one table", lua_gettop(L) == 0 ? "nothing" : describe_value(L, 1),
           "local memory = persist { integral = 0.0 }, and then memory.integral");
  s.persistent.declare(L, 1);
  return 1;
}

int signals(lua_State* L, Scenario& s) {
  expect_setup(L, s, "signals", false);
  DiagnosticSink sink;
  LuaTable all(L, 1, "signals", sink);
  sink.throw_if_any();
  std::vector<std::string> paths;
  for (lua_pushnil(L); lua_next(L, 1); lua_pop(L, 1)) paths.emplace_back(lua_type(L, -2) == LUA_TSTRING ? lua_tostring(L, -2) : "");
  std::sort(paths.begin(), paths.end());
  lua_newtable(L);
  const int out = lua_gettop(L);
  for (const std::string& path : paths) {
    auto signal = std::make_unique<Signal>();
    signal->scenario = &s;
    signal->declared = LuaHost::caller(L);
    Channel& c = signal->channel;
    c.path = path;
    if (!is_channel_path(path))
      refuse(L, Code::lua_argument, "signals", "a name of letters, digits, `_`, `-`, with `/` between folders: pointing/error",
             in_quotes(path));
    auto t = all.table(path);
    if (!t) continue;
    c.unit = t->text("unit").value_or("1");
    if (!parse_unit(c.unit)) t->reject("unit", "a unit: deg, N m, 1", unit_hint(c.unit));
    c.frame = t->text("frame").value_or("");
    c.meaning = t->text("meaning").value_or("");
    c.components = t->texts("components").value_or(std::vector<std::string>{path.substr(path.rfind('/') + 1)});
    if (c.components.empty()) t->reject("components", "at least one name");
    c.unit = unit_of_channel(std::vector<std::string>(c.components.size(), c.unit));
    c.commands = t->text("commands").value_or("");
    if (!c.commands.empty() && !is_attitude(c.components))
      t->reject("components", R"({ "w", "x", "y", "z" } of what commands an attitude)");
    t->finish();
    signal->values.assign(c.components.size(), std::nan(""));
    lua_pushlightuserdata(L, signal.get());
    lua_pushcclosure(L, method<store>, 1);
    lua_setfield(L, out, path.c_str());
    s.signals.push_back(std::move(signal));
  }
  all.finish();
  sink.throw_if_any();
  lua_pushvalue(L, out);
  return 1;
}

int stop(lua_State* L, Scenario& s) {
  if (s.stage != Scenario::Stage::run || s.in_event_function)
    refuse(L, Code::lua_argument, "stop", "a call from a controller, a sequence, a phase or an event's action", "one from elsewhere");
  s.stopped_by = s.actor;
  s.sim->stop();
  return 0;
}

}  // namespace

void bind_declarations(Scenario& s) {
  const auto bind = [&s](const char* name, int (*f)(lua_State*, Scenario&), int arguments = 1) {
    s.lua.bind(name, limited(arguments, [&s, f](lua_State* L) { return f(L, s); }));
  };
  bind("controller", controller);
  bind("phase", phase);
  bind("event", event);
  bind("check", check);
  bind("figure", figure);
  bind("signals", signals);
  bind("persist", persist);
  bind("stop", stop, 0);
}

}  // namespace cardan
