// What a script declares first: parameters, plugins, the vehicle, the mission and the initial state.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "core/base/activity.hpp"
#include "core/base/units.hpp"
#include "core/io/sha256.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/schema.hpp"
#include "core/model/validate.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/lua/table.hpp"
#include "bodies/vehicle/modal_from_spec.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {
namespace {

// ---- parameters ----

/// "30 deg" -> 0.52 and an angle. Empty if the text does not begin like a number.
struct Quantity {
  double value;
  Dimension dimension;
};
std::optional<Quantity> read_quantity(const std::string& text, QuantityFault& fault) {
  for (std::size_t cut = text.size(); cut > 0; --cut) {
    const auto number = parse_number(std::string_view(text).substr(0, cut));
    if (!number) continue;
    const std::size_t unit_at = text.find_first_not_of(' ', cut);
    if (unit_at == std::string::npos) return Quantity{*number, {}};
    if (const auto unit = parse_unit(std::string_view(text).substr(unit_at)))
      return Quantity{*number * unit->factor, unit->dimension};
  }
  fault = std::get<QuantityFault>(parse_quantity(text, "1"));
  fault.expected = "a number with a unit, or a text that does not begin like a number";
  return {};
}

/// "6 N m/rad": a value in SI with its unit.
std::string with_unit(const std::string& value, const Dimension& dimension) {
  const std::string text = describe(dimension);
  const std::size_t open = text.find('[');
  return open == std::string::npos ? value : value + " " + text.substr(open + 1, text.size() - open - 2);
}

bool begins_like_a_number(const std::string& text) { return text.find_first_of("0123456789+-.") == 0; }

/// One parameter: what the script gives, replaced by what the command line gives. Pushes its value.
class ParameterReader {
 public:
  ParameterReader(lua_State* L, Scenario& s, DiagnosticSink& sink) : L_(L), s_(s), sink_(sink) {}

  void read(const std::string& name, int value) {
    name_ = name;
    const Setting* set = setting();
    switch (lua_type(L_, value)) {
      case LUA_TBOOLEAN:
        push_flag(set, lua_toboolean(L_, value) != 0);
        break;
      case LUA_TTABLE:
        push_numbers(set, value);
        break;
      case LUA_TSTRING:
        if (!begins_like_a_number(lua_tostring(L_, value))) {
          const std::string text = set ? set->value : lua_tostring(L_, value);
          note(text);
          lua_pushlstring(L_, text.data(), text.size());
          break;
        }
        [[fallthrough]];
      case LUA_TNUMBER: {
        const Quantity given = quantity(value, name);
        const double x = set ? replaced(set->value, given.dimension) : given.value;
        note(with_unit(fmt::format("{}", x), given.dimension));
        lua_pushnumber(L_, x);
        break;
      }
      default:
        report(name, Code::wrong_type, "a number, a text, an array of numbers, true or false",
               describe_value(L_, value));
        lua_pushnil(L_);
    }
  }

 private:
  Setting* setting() {
    const auto found =
        std::find_if(s_.settings.rbegin(), s_.settings.rend(), [&](const Setting& x) { return x.key == name_; });
    if (found == s_.settings.rend()) return nullptr;
    for (Setting& x : s_.settings) x.used = x.used || x.key == name_;
    return &*found;
  }
  void note(std::string value) { s_.parameters.emplace_back("parameters." + name_, std::move(value)); }

  void report(const std::string& path, Code code, std::string expected, std::string got, std::string hint = {}) {
    sink_.report(code, {"parameters." + path, LuaHost::caller(L_)}, std::move(expected), std::move(got),
                 std::move(hint));
  }
  void report_setting(Code code, std::string expected, std::string got, std::string hint = {}) {
    const Setting& set = *setting();
    sink_.report(code, {"parameters." + name_, {fmt::format("--set {}={}", set.key, set.value), 0, 0}},
                 std::move(expected), std::move(got), std::move(hint));
  }

  Quantity quantity(int index, const std::string& path) {
    QuantityFault fault;
    if (lua_type(L_, index) == LUA_TNUMBER && std::isfinite(lua_tonumber(L_, index)))
      return {lua_tonumber(L_, index), {}};
    if (lua_type(L_, index) != LUA_TSTRING) {
      report(path, Code::wrong_type, "a finite number, or a text with a unit", describe_value(L_, index));
    } else if (const auto x = read_quantity(lua_tostring(L_, index), fault)) {
      return *x;
    } else {
      report(path, fault.code, fault.expected, fault.got, fault.hint);
    }
    return {0.0, {}};
  }

  /// The command line's value: of the same dimension, or a bare number in SI.
  double replaced(const std::string& text, const Dimension& dimension) {
    QuantityFault fault;
    const auto x = read_quantity(text, fault);
    if (!x)
      report_setting(fault.code, describe(dimension), fault.got, fault.hint);
    else if (x->dimension != dimension && x->dimension != Dimension{})
      report_setting(Code::wrong_unit, describe(dimension),
                     fmt::format("{}: {}", in_quotes(text), describe(x->dimension)));
    else
      return x->value;
    return 0.0;
  }

  void push_flag(const Setting* set, bool flag) {
    if (set && set->value != "true" && set->value != "false")
      report_setting(Code::wrong_type, "true or false", in_quotes(set->value));
    if (set) flag = set->value == "true";
    note(flag ? "true" : "false");
    lua_pushboolean(L_, flag);
  }

  void push_numbers(const Setting* set, int table) {
    const auto size = static_cast<int>(lua_rawlen(L_, table));
    std::vector<Quantity> all;
    for (int i = 1; i <= size; ++i) {
      lua_rawgeti(L_, table, i);
      all.push_back(quantity(-1, fmt::format("{}[{}]", name_, i)));
      lua_pop(L_, 1);
    }
    if (all.empty()) report(name_, Code::wrong_type, "an array of numbers", "a table without them");
    if (set) {
      const DocNode list = parse_yaml(set->value, fmt::format("--set {}={}", set->key, set->value));
      if (list.kind != DocNode::Kind::list || list.items.size() != all.size())
        report_setting(Code::wrong_type, fmt::format("a list of {} numbers: [1, 0, 0]", all.size()),
                       in_quotes(set->value));
      else
        for (std::size_t i = 0; i < all.size(); ++i) all[i].value = replaced(list.items[i].text, all[i].dimension);
    }
    lua_createtable(L_, size, 0);
    std::string text;
    for (std::size_t i = 0; i < all.size(); ++i) {
      lua_pushnumber(L_, all[i].value);
      lua_rawseti(L_, -2, static_cast<lua_Integer>(i) + 1);
      text += fmt::format("{}{}", i > 0 ? ", " : "", all[i].value);
    }
    const bool alike = std::all_of(all.begin(), all.end(), [&](const Quantity& x) { return x.dimension == all[0].dimension; });
    note(alike && !all.empty() ? with_unit("[" + text + "]", all[0].dimension) : "[" + text + "]");
  }

  lua_State* L_;
  Scenario& s_;
  DiagnosticSink& sink_;
  std::string name_;
};

/// parameters { slew_angle = "30 deg", ... } -> table of numbers in SI that answers for unknown names.
int parameters(lua_State* L, Scenario& s) {
  expect_setup(L, s, "parameters", false);
  DiagnosticSink sink;
  LuaTable(L, 1, "parameters", sink);
  sink.throw_if_any();
  std::vector<std::string> names;
  for (lua_pushnil(L); lua_next(L, 1); lua_pop(L, 1)) {
    if (lua_type(L, -2) == LUA_TSTRING)
      names.emplace_back(lua_tostring(L, -2));
    else
      sink.report(Code::wrong_type, {"parameters", LuaHost::caller(L)}, "names and their values",
                  "a value without a name");
  }
  std::sort(names.begin(), names.end());
  lua_newtable(L);
  const int out = lua_gettop(L);
  ParameterReader reader(L, s, sink);
  for (const std::string& name : names) {
    if (std::find(s.parameter_names.begin(), s.parameter_names.end(), name) != s.parameter_names.end())
      sink.report(Code::duplicate_name, {"parameters." + name, LuaHost::caller(L)}, "each parameter once",
                  in_quotes(name));
    lua_getfield(L, 1, name.c_str());
    reader.read(name, lua_gettop(L));
    lua_setfield(L, out, name.c_str());
    lua_pop(L, 1);
    s.parameter_names.push_back(name);
  }
  sink.throw_if_any();
  lua_newtable(L);
  s.lua.push(L, [names](lua_State* state) -> int {
    const std::string name = luaL_tolstring(state, 2, nullptr);
    std::string known;
    for (const std::string& n : names) known += (known.empty() ? "" : ", ") + n;
    refuse(state, Code::unknown_name, "parameters." + name, "a parameter: " + known, in_quotes(name),
           did_you_mean(name, names));
  });
  lua_setfield(L, -2, "__index");
  lua_setmetatable(L, out);
  return 1;
}

// ---- plugin, vehicle ----

/// Refuses a file that is not the one of the run that is repeated.
void expect_recorded(const Scenario& s, const std::string& name, const std::string& path, const Located& at) {
  const auto recorded = s.recorded->hashes.find(name);
  std::error_code ignored;
  const std::string now = std::filesystem::is_regular_file(path, ignored) ? sha256_of_file(path) : "no file at " + in_quotes(path);
  if (recorded == s.recorded->hashes.end() || recorded->second != now)
    throw InputError(Diagnostic{Code::changed_input, at,
                                fmt::format("{} with the SHA-256 that {} tells: {}", name, s.recorded->results,
                                            recorded == s.recorded->hashes.end() ? "none" : recorded->second),
                                now, "put the file of that run back", {}, {}, 0});
}

/// The files that modes are read from.
void note_modal_files(Scenario& s, const SystemSpec& spec) {
  for (const BodySpec& b : spec.bodies) {
    const DocNode* file = b.modal_source ? b.modal_source->find("file") : nullptr;
    if (!file || file->kind != DocNode::Kind::scalar) continue;
    if (std::any_of(s.modal_files.begin(), s.modal_files.end(), [&](const InputFile& f) { return f.name == file->text; })) continue;
    const std::string path = (std::filesystem::path(file->mark.file).parent_path() / file->text).string();
    if (s.recorded) expect_recorded(s, file->text, path, {body_path(b) + ".modal.file", file->mark});
    if (std::error_code ignored; std::filesystem::is_regular_file(path, ignored))  // else refused by who reads it
      s.modal_files.push_back({file->text, sha256_of_file(path), {}});
  }
}

int plugin(lua_State* L, Scenario& s) {
  expect_setup(L, s, "plugin", false);
  const std::string name = luaL_checkstring(L, 1);
  if (s.model) refuse(L, Code::lua_argument, "plugin", "plugins before the vehicle", in_quotes(name));
  const std::string path = ((s.folder.empty() ? std::filesystem::path(".") : s.folder) / name)
                               .string();  // with a slash: not a system library
  if (s.recorded) expect_recorded(s, name, path, {"plugin", LuaHost::caller(L)});  // before anything in it can run
  load_plugin(path, s.registry, {"plugin", LuaHost::caller(L)});
  s.plugins.push_back({name, sha256_of_file(path), {}});
  return 0;
}

/// The key path inside the vehicle of a --set; empty: it is about something else. As in messages, or with "vehicle." before it.
std::string_view vehicle_path(std::string_view key) {
  if (key.starts_with("vehicle.")) return key.substr(std::strlen("vehicle."));
  return key.starts_with("bodies.") || key.starts_with("gravity.") ? key : std::string_view();
}

int vehicle(lua_State* L, Scenario& s) {
  expect_setup(L, s, "vehicle", false);
  const std::string name = luaL_checkstring(L, 1);
  if (s.model)
    refuse(L, Code::lua_argument, "vehicle", "one vehicle", "a second one", "a vehicle may hold several free bodies");
  Overrides overrides;
  for (Setting& set : s.settings)
    if (const std::string_view path = vehicle_path(set.key); !path.empty()) {
      overrides.emplace_back(path, set.value);
      set.used = true;
    }
  const std::string path = (s.folder / name).string();
  const std::string* kept = s.lua.options().stored ? s.lua.options().stored(name) : nullptr;
  std::error_code unusable;  // a name too long for a file, say
  if (!kept && (s.recorded || !std::filesystem::is_regular_file(path, unusable)))
    refuse(L, Code::file_not_found, "vehicle", "a vehicle in YAML, relative to the scenario", in_quotes(path));
  const Activity activity("the vehicle " + name);
  const auto spec = std::make_shared<SystemSpec>(kept ? vehicle_from_text(*kept, path, s.registry, overrides) : read_vehicle(path, s.registry, overrides));
  s.inputs.push_back({name, sha256(spec->source_text), spec->source_text});
  note_modal_files(s, *spec);
  s.modes_from_cache = make_modes(*spec, ModeCache::of_user());
  CompileOptions options;
  options.node_wrenches = false;  // until a load is declared
  s.use_model(compile(spec, s.registry, options));
  push_vehicle(L, s);
  return 1;
}

// ---- mission ----

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
  if (!relative && i.method != "rk4")
    m.defaults_used.emplace_back("mission.integrator.relative", fmt::format("{:g}", i.relative_tolerance));
  if (const auto x = t.text("linear_solver"))
    i.linear_solver = *x;
  else if (i.method == "cvode_bdf")
    m.defaults_used.emplace_back("mission.integrator.linear_solver", "dense");
  if (const auto x = t.number("absolute")) {
    options.absolute_tolerance = *x;
    if (!(*x > 0.0 && *x <= 1.0)) t.reject("absolute", "a number > 0 and at most 1");
  }
  if (const auto x = t.number("step", "s")) i.fixed_step = *x;
  if (const auto x = t.number("initial_step", "s")) i.initial_step = *x;
  if (const auto x = t.number("max_step", "s")) i.max_step = *x;
  t.finish();
}

/// Makes an integrator for one state, so that options that do not fit are refused here, with the place.
void expect_legal(lua_State* L, const IntegratorOptions& options) {
  OdeProblem ode;
  ode.n = 1;
  ode.absolute_tolerance = {1.0};
  ode.rhs = [](double, const double*, double* xdot) {
    *xdot = 0.0;
    return true;
  };
  try {
    make_integrator(std::move(ode), options);
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

std::string listed(const std::vector<std::string>& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

void read_output(LuaTable& t, lua_State* L, Scenario& s) {
  const Model& m = *s.model;
  const SourceMark here = LuaHost::caller(L);
  if (t.has("rate") && t.has("period")) t.reject("period", "rate or period, not both");
  if (!t.has("rate") && !t.has("period")) s.mission.defaults_used.emplace_back("mission.output.rate", "10 Hz");
  if (const auto rate = t.number("rate", "Hz"))
    s.mission.output_period = period_from_hertz(*rate, {t.path() + ".rate", here});
  if (const auto period = t.number("period", "s"))
    s.mission.output_period = period_from_seconds(*period, {t.path() + ".period", here});
  const auto all = [&](const char* key, Code code, const auto& objects, std::vector<int>& out, const char* what) {
    std::vector<std::string> names;
    for (const auto& o : objects) names.push_back(o.name);
    const auto wanted = t.texts(key);
    for (const std::string& name : wanted ? *wanted : std::vector<std::string>{}) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end())
        refuse(L, code, t.path() + "." + key, fmt::format("{}: {}", what, listed(names)), in_quotes(name),
               did_you_mean(name, names));
      const auto index = static_cast<int>(found - names.begin());
      if (std::find(out.begin(), out.end(), index) != out.end())
        refuse(L, Code::duplicate_name, t.path() + "." + key, "each name once", in_quotes(name));
      out.push_back(index);
    }
  };
  all("reactions", Code::unknown_body, m.user, s.mission.reactions, "a body of the vehicle");
  all("nodes", Code::unknown_node, m.nodes, s.mission.nodes, "a node of the vehicle");
  t.finish();
}

int mission(lua_State* L, Scenario& s) {
  lua_remove(L, 1);  // the table `mission`, which is called
  expect_setup(L, s, "mission", true);
  if (s.mission.declared) refuse(L, Code::lua_argument, "mission", "one mission", "a second one");
  s.mission.declared = true;
  DiagnosticSink sink;
  if (lua_istable(L, 1)) apply_settings(L, 1, s);
  LuaTable t(L, 1, "mission", sink);
  t.require({"duration"});
  s.mission.title = t.text("title").value_or("");
  s.mission.duration = t.number("duration", "s").value_or(1.0);
  if (!(s.mission.duration > 0.0)) t.reject("duration", "a time > 0");
  const auto part = [&](const char* key) {  // an absent table is an empty one: its defaults are used
    if (!t.has(key)) {
      lua_newtable(L);
      lua_setfield(L, 1, key);
    }
    return t.table(key);
  };
  if (auto i = part("integrator")) read_integrator(*i, s.mission);
  if (auto o = part("output")) read_output(*o, L, s);
  const auto ledger = t.flag("ledger");
  s.mission.simulation.ledger = ledger.value_or(true);
  if (!ledger) s.mission.defaults_used.emplace_back("mission.ledger", "true");
  if (auto budget = t.table("budget")) read_budget(*budget, s);
  t.finish();
  sink.throw_if_any();
  expect_legal(L, s.mission.simulation.integrator);
  s.sim->set_options(s.mission.simulation);
  return 0;
}

// ---- initial ----

/// Coordinates that are given as one array.
struct Group {
  std::array<const char*, 2> keys;
  std::array<const char*, 4> names;
  std::size_t size;
  const char* unit;
};
constexpr std::array<Group, 4> kGroups = {{{{"quaternion_wxyz", "attitude"}, {"qw", "qx", "qy", "qz"}, 4, "1"},
                                           {{"position", "position"}, {"x", "y", "z", ""}, 3, "m"},
                                           {{"angular_velocity", "rate"}, {"wx", "wy", "wz", ""}, 3, "rad/s"},
                                           {{"velocity", "velocity"}, {"vx", "vy", "vz", ""}, 3, "m/s"}}};

void read_coordinates(lua_State* L, LuaTable& t, DiagnosticSink& sink, const std::vector<std::string>& names,
                      const std::vector<std::string>& units, double* x) {
  for (std::size_t i = 0; i < names.size(); ++i)
    if (const auto value = t.number(names[i], units[i])) x[i] = *value;
  for (const Group& g : kGroups) {
    const auto first =
        std::search(names.begin(), names.end(), g.names.begin(), g.names.begin() + static_cast<std::ptrdiff_t>(g.size));
    if (first == names.end()) continue;
    double* at = x + (first - names.begin());
    for (const char* key : g.keys) {
      const auto values = t.numbers(key, g.size, g.unit);
      if (!values) continue;
      std::copy(values->begin(), values->end(), at);
      if (g.size != 4) continue;
      double norm = 0.0;
      for (double c : *values) norm += c * c;
      norm = std::sqrt(norm);
      if (std::abs(norm - 1.0) > 1e-6)
        sink.report(Code::non_unit_quaternion, {t.path() + "." + key, LuaHost::caller(L)},
                    "w, x, y, z of length 1 within 1e-6", fmt::format("length {:.6g}", norm));
      for (std::size_t i = 0; i < 4; ++i) at[i] /= norm;
    }
  }
}

void read_modes(LuaTable& t, const char* key, const char* unit, int n, double* x) {
  if (n == 0) return;
  if (const auto values = t.numbers(key, static_cast<std::size_t>(n), unit))
    std::copy(values->begin(), values->end(), x);
}

int initial(lua_State* L, Scenario& s) {
  expect_setup(L, s, "initial", true);
  DiagnosticSink sink;
  LuaTable all(L, 1, "initial", sink);
  State state = s.sim->state();
  for (const UserBody& u : s.model->user) {
    auto t = all.table(u.name);
    if (!t) continue;
    read_coordinates(L, *t, sink, u.q_names, u.q_units, state.q.data() + u.q);
    read_coordinates(L, *t, sink, u.v_names, u.v_units, state.v.data() + u.v);
    read_modes(*t, "eta", "1", u.n_modes, state.q.data() + u.eta);
    read_modes(*t, "etadot", "1/s", u.n_modes, state.v.data() + u.etadot);
    t->finish();
  }
  all.finish();
  sink.throw_if_any();
  s.sim->set_state(state);
  s.look_at_state();
  return 0;
}

}  // namespace

void bind_setup(Scenario& s) {
  const auto bind = [&s](const char* name, int (*f)(lua_State*, Scenario&)) {
    s.lua.bind(name, [&s, f](lua_State* L) { return f(L, s); });
  };
  bind("parameters", parameters);
  bind("plugin", plugin);
  bind("vehicle", vehicle);
  bind("initial", initial);
  // `mission { ... }` declares; `mission.phase()` and `mission.time()` ask.
  s.lua.bind("mission.phase", [&s](lua_State* L) {
    lua_pushlstring(L, s.phase.data(), s.phase.size());
    return 1;
  });
  s.lua.bind("mission.time", [&s](lua_State* L) {
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
