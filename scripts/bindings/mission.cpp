// mission { ... }: how long, by which integrator, what is recorded.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "core/base/units.hpp"
#include "core/io/yaml_reader.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"

namespace cardan {
namespace {

/// `--set mission.integrator.method=cvode_bdf`: into the table, before it is read.
void apply_settings(lua_State* L, int table, Scenario& s) {
  for (Setting& set : s.settings) {
    if (!set.key.starts_with("mission.")) continue;
    set.used = true;
    lua_pushvalue(L, table);
    std::string rest = set.key.substr(std::strlen("mission."));
    for (std::size_t dot; (dot = rest.find('.')) != std::string::npos; rest = rest.substr(dot + 1)) {
      const std::string key = rest.substr(0, dot);
      if (lua_getfield(L, -1, key.c_str()) != LUA_TTABLE) {
        lua_pop(L, 1);
        lua_newtable(L);
        lua_pushvalue(L, -1);
        lua_setfield(L, -3, key.c_str());
      }
      lua_remove(L, -2);
    }
    if (set.value == "true" || set.value == "false")
      lua_pushboolean(L, set.value == "true");
    else if (const auto number = parse_number(set.value))
      lua_pushnumber(L, *number);
    else
      lua_pushlstring(L, set.value.data(), set.value.size());
    lua_setfield(L, -2, rest.c_str());
    lua_pop(L, 1);
  }
}

void read_integrator(LuaTable& t, MissionSpec& m) {
  SimulationOptions& options = m.simulation;
  IntegratorOptions& i = options.integrator;
  const auto method = t.text("method");
  const auto relative = t.number("relative");
  if (method) i.method = *method;
  if (relative) i.relative_tolerance = *relative;
  if (!method) m.defaults_used.emplace_back("mission.integrator.method", i.method);
  const auto step = t.number("step", "s");
  if (step) i.fixed_step = *step;
  if (step && !(*step > 0.0)) t.reject("step", "a time > 0");  // 0 stands for "not given" in the options
  if (!relative && !step) m.defaults_used.emplace_back("mission.integrator.relative", fmt::format("{:g}", i.relative_tolerance));
  if (const auto x = t.text("linear_solver"))
    i.linear_solver = *x;
  else if (is_implicit(i.method))
    for (const MethodKind& kind : integration_methods())
      if (kind.name == i.method) m.defaults_used.emplace_back("mission.integrator.linear_solver", kind.linear_solvers.front());
  if (const auto x = t.number("absolute")) {
    options.absolute_tolerance = *x;
    if (!(*x > 0.0 && *x <= 1.0)) t.reject("absolute", "a number > 0 and at most 1");
  }
  if (auto kinds = t.table("tolerances")) {
    TolerancesByKind& by = options.tolerances;
    const auto read = [&](const char* key, const char* unit, double& to) {
      const auto x = kinds->number(key, unit);
      if (x && !(*x > 0.0)) kinds->reject(key, fmt::format("a number > 0 {}", unit));
      if (x) to = *x;
    };
    read("angle", "rad", by.angle), read("position", "m", by.position), read("rate", "rad/s", by.rate);
    read("velocity", "m/s", by.velocity), read("modes", "1", by.modes);
    kinds->finish();
  }
  if (const auto x = t.number("initial_step", "s")) i.initial_step = *x;
  if (const auto x = t.number("max_step", "s")) i.max_step = *x;
  t.finish();
}

/// Options that do not fit are refused here, with the place.
void expect_legal(lua_State* L, const IntegratorOptions& options) {
  try {
    check_options(options);
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all) {
      d.at.key_path = d.at.key_path.empty() ? "mission.integrator" : "mission." + d.at.key_path;
      d.at.mark = LuaHost::caller(L);
    }
    throw InputError(std::move(all));
  }
}

/// What one call of a controller, an event, ... may spend.
void read_budget(LuaTable& t, Scenario& s) {
  LuaBudget budget = s.lua.call_budget();
  if (const auto steps = t.number("steps")) {
    if (*steps >= 1000.0 && *steps <= 1e15)
      budget.steps = static_cast<std::int64_t>(*steps);
    else
      t.reject("steps", "a number of steps from 1000 to 1e15");
  }
  if (const auto time = t.number("time", "s")) {
    if (*time > 0.0 && *time <= 1e9)
      budget.seconds = *time;
    else
      t.reject("time", "a time > 0 s, at most 1e9 s");
  }
  t.finish();
  s.lua.set_call_budget(budget);
}

void read_output(LuaTable& t, lua_State* L, Scenario& s) {
  const Model& m = *s.model;
  const SourceMark here = LuaHost::caller(L);
  if (t.has("rate") && t.has("period")) t.reject("period", "rate or period, not both");
  if (!t.has("rate") && !t.has("period")) s.mission.defaults_used.emplace_back("mission.output.rate", "10 Hz");
  if (const auto rate = t.number("rate", "Hz")) s.mission.output_period = period_from_hertz(*rate, {t.path() + ".rate", here});
  if (const auto period = t.number("period", "s")) s.mission.output_period = period_from_seconds(*period, {t.path() + ".period", here});
  const auto all = [&](const char* key, Code code, const auto& objects, std::vector<int>& out, const char* what) {
    std::vector<std::string> names;
    for (const auto& o : objects) names.push_back(o.name);
    const auto wanted = t.texts(key);
    for (const std::string& name : wanted ? *wanted : std::vector<std::string>{}) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end())
        refuse(L, code, t.path() + "." + key, fmt::format("{}: {}", what, listed(names)), in_quotes(name), did_you_mean(name, names));
      const auto index = static_cast<int>(found - names.begin());
      if (std::find(out.begin(), out.end(), index) != out.end())
        refuse(L, Code::duplicate_name, t.path() + "." + key, "each name once", in_quotes(name));
      out.push_back(index);
    }
  };
  s.mission.simulation.between_steps = t.flag("between_steps").value_or(false);
  all("reactions", Code::unknown_body, m.user, s.mission.reactions, "a body of the vehicle");
  all("nodes", Code::unknown_node, m.nodes, s.mission.nodes, "a node of the vehicle");
  t.finish();
}

/// A tenth of the duration, in whole periods of the output.
Rational usual_checkpoint_period(const MissionSpec& m) {
  const Rational& output = m.output_period;
  const double rows = m.duration * static_cast<double>(output.denominator) / static_cast<double>(output.numerator);
  const auto most = static_cast<double>(Rational::kLargest / output.numerator);
  const auto n = static_cast<std::int64_t>(std::clamp(std::ceil(0.1 * rows), 1.0, std::max(most, 1.0))) * output.numerator;
  const std::int64_t common = std::gcd(n, output.denominator);
  return {n / common, output.denominator / common};
}

void read_checkpoint(LuaTable& t, lua_State* L, MissionSpec& m) {
  const auto period = t.number("period", "s");
  const bool never = t.flag("never").value_or(false);
  if (never && period) t.reject("period", "period or never, not both");
  if (period && *period > 0.0)
    m.checkpoint_period = period_from_seconds(*period, {t.path() + ".period", LuaHost::caller(L)});
  else if (period)
    t.reject("period", "a time > 0");
  else if (!never)
    m.checkpoint_period = usual_checkpoint_period(m);
  if (!never && !period) m.defaults_used.emplace_back("mission.checkpoint.period", fmt::format("{:.10g} s", m.checkpoint_period->value()));
  t.finish();
}

int declare(lua_State* L, Scenario& s) {
  lua_remove(L, 1);  // the table `mission`, which is called
  expect_setup(L, s, "mission", true);
  if (s.mission.declared) refuse(L, Code::lua_argument, "mission", "one mission", "a second one");
  s.mission.declared = true;
  DiagnosticSink sink;
  if (lua_istable(L, 1)) apply_settings(L, 1, s);
  LuaTable t(L, 1, "mission", sink);
  sink.throw_if_any();  // no table
  t.require({"duration"});
  s.mission.title = t.text("title").value_or("");
  s.mission.duration = t.number("duration", "s").value_or(1.0);
  if (!(s.mission.duration > 0.0)) t.reject("duration", "a time > 0");
  const auto part = [&](const char* key, const char* example) {  // an absent table is an empty one: its defaults are used
    if (!t.has(key)) {
      lua_newtable(L);
      lua_setfield(L, 1, key);
    }
    return t.table(key, fmt::format("a table, such as {{ {} }}", example));
  };
  if (const auto dynamics = t.choice("dynamics", dynamics_names()))
    s.mission.simulation.dynamics = static_cast<Dynamics>(std::ranges::find(dynamics_names(), *dynamics) - dynamics_names().begin());
  if (auto i = part("integrator", "method = \"dop853\"")) read_integrator(*i, s.mission);
  if (auto o = part("output", "rate = \"10 Hz\"")) read_output(*o, L, s);
  if (auto c = part("checkpoint", "period = \"1 min\"")) read_checkpoint(*c, L, s.mission);
  const auto ledger = t.flag("ledger");
  s.mission.simulation.ledger = ledger.value_or(true);
  if (!ledger) s.mission.defaults_used.emplace_back("mission.ledger", "true");
  if (auto budget = t.table("budget")) read_budget(*budget, s);
  t.finish();
  sink.throw_if_any();
  expect_legal(L, s.mission.simulation.integrator);
  s.mission.simulation.seed = s.seed;
  s.sim->set_options(s.mission.simulation);
  return 0;
}

/// What `--set` has given is wrong there, not in the line of the script, which says something else.
int mission(lua_State* L, Scenario& s) try { return declare(L, s); } catch (const InputError& e) {
  std::vector<Diagnostic> all = e.diagnostics();
  for (Diagnostic& d : all)
    for (const Setting& set : s.settings)  // the last one counts
      if (d.at.key_path == set.key || d.at.key_path.starts_with(set.key + ".")) d.at.mark = setting_mark(set.key, set.value);
  throw InputError(std::move(all));
}

}  // namespace

/// mission.enter(name): that phase begins, the present one ends.
int enter(lua_State* L, Scenario& s) {
  if (s.stage != Scenario::Stage::run || s.in_event_function)
    refuse(L, Code::lua_argument, "mission.enter", "a call from a controller, a sequence, a phase or an event's action",
           "one from elsewhere");
  const std::vector<std::string> known = names_of(s.phases);
  const std::string wanted = lua_type(L, 1) == LUA_TSTRING ? lua_tostring(L, 1) : "";
  const std::size_t index = index_of_phase(s.phases, wanted);
  if (index == known.size())
    refuse(L, Code::lua_argument, "mission.enter",
           known.empty() ? "phases, declared by phase{...}" : fmt::format("a phase: {}", listed(known)),
           known.empty() ? "none" : describe_value(L, 1), did_you_mean(wanted, known));
  s.wanted_phase = index;
  return 0;
}

/// `mission { ... }` declares; `mission.phase()`, `mission.phase_time()` and `mission.time()` ask; `mission.enter` changes the phase.
void bind_mission(Scenario& s) {
  const auto bind = [&s](const char* name, int arguments, auto function) { s.lua.bind(name, limited(arguments, function)); };
  bind("mission.phase", 0, [&s](lua_State* L) {
    lua_pushlstring(L, s.phase.data(), s.phase.size());
    return 1;
  });
  bind("mission.phase_time", 0, [&s](lua_State* L) {
    lua_pushnumber(L, s.phase.empty() ? 0.0 : s.time() - s.phase_begun);
    return 1;
  });
  bind("mission.enter", 1, [&s](lua_State* L) { return enter(L, s); });
  bind("mission.time", 0, [&s](lua_State* L) {
    lua_pushnumber(L, s.time());
    return 1;
  });
  s.lua.protect([&s](lua_State* L) {
    lua_getglobal(L, "mission");
    lua_newtable(L);
    s.lua.push(L, [&s](lua_State* state) { return mission(state, s); });
    lua_setfield(L, -2, "__call");
    lua_setmetatable(L, -2);
  });
}

}  // namespace cardan
