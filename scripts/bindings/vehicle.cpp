// plugin "...", vehicle "...", and what can be asked of a vehicle.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "bodies/vehicle/load_vehicle.hpp"
#include "core/base/activity.hpp"
#include "core/base/units.hpp"
#include "core/io/sha256.hpp"
#include "core/model/model_map.hpp"
#include "core/model/params.hpp"
#include "core/model/validate.hpp"
#include "scripts/bindings/handle.hpp"
#include "scripts/bindings/linear.hpp"
#include "scripts/bindings/operator_methods.hpp"
#include "scripts/bindings/operators.hpp"
#include "scripts/bindings/studies.hpp"
#include "scripts/bindings/topology.hpp"

namespace cardan {
namespace {

/// Refuses a file that is not the one of the run that is repeated.
void expect_recorded(const Scenario& s, const std::string& name, const std::string& path, const Located& at) {
  const auto recorded = s.recorded->hashes.find(name);
  std::error_code ignored;
  const std::string now = std::filesystem::is_regular_file(path, ignored) ? sha256_of_file(path) : "no file at " + in_quotes(path);
  if (recorded == s.recorded->hashes.end() || recorded->second != now)
    refuse(Code::changed_input, at,
           fmt::format("{} with the SHA-256 that {} tells: {}", name, s.recorded->results,
                       recorded == s.recorded->hashes.end() ? "none" : recorded->second),
           now, "put the file of that run back");
}

/// Files that the vehicle names: of modes, of parameters.
void note_files(Scenario& s, const SystemSpec& spec) {
  const auto note = [&](const std::string& name, const std::string& path, const Located& at) {
    if (std::ranges::any_of(s.modal_files, [&](const InputFile& f) { return f.name == name; })) return;
    if (s.recorded) expect_recorded(s, name, path, at);
    if (std::error_code ignored; std::filesystem::is_regular_file(path, ignored))  // else refused by who reads it
      s.modal_files.push_back({name, sha256_of_file(path), {}});
  };
  for (const BodySpec& b : spec.bodies) {
    const auto note_key = [&](const DocNode* around, const char* key, const std::string& path) {
      const DocNode* file = around ? around->find(key) : nullptr;
      if (file && file->kind == DocNode::Kind::scalar) note(file->text, beside(file->mark, file->text), {path + "." + key, file->mark});
    };
    note_key(b.modal_source.get(), "file", body_path(b) + ".modal");
    const auto part = [&](const char* key) { return b.modal_source ? b.modal_source->find(key) : nullptr; };
    for (const char* key : {"nodes", "mass", "stiffness", "damping"}) note_key(part("matrices"), key, body_path(b) + ".modal.matrices");
    note_key(part("solid"), "mesh", body_path(b) + ".modal.solid");
    for (const ParamValues* params : {&b.params, &b.hinge.params})
      for (const auto& [key, value] : *params)
        if (!value.file.empty()) note(value.file, beside(value.at.mark, value.file), value.at);
  }
}

std::string file_name(lua_State* L, const char* function) {
  if (lua_type(L, 1) != LUA_TSTRING) refuse(L, Code::lua_argument, function, "the name of a file", describe_value(L, 1));
  return lua_tostring(L, 1);
}

int plugin(lua_State* L, Scenario& s) {
  expect_setup(L, s, "plugin", false);
  const std::string name = file_name(L, "plugin");
  if (s.model) refuse(L, Code::lua_argument, "plugin", "plugins before the vehicle", in_quotes(name));
  const std::string path =
      ((s.folder.empty() ? std::filesystem::path(".") : s.folder) / name).string();  // with a slash: not a system library
  if (s.recorded) expect_recorded(s, name, path, {"plugin", LuaHost::caller(L)});    // before anything in it can run
  load_plugin(path, s.registry, {"plugin", LuaHost::caller(L)});
  s.plugins.push_back({name, sha256_of_file(path), {}});
  return 0;
}

/// The key path inside the vehicle of a --set; empty: it is about something else. As in messages, or with "vehicle." before it.
std::string_view vehicle_path(std::string_view key) {
  if (key.starts_with("vehicle.")) return key.substr(std::strlen("vehicle."));
  constexpr const char* kParts[] = {"bodies.", "gravity.", "devices.", "fields.", "loops."};
  return std::ranges::any_of(kParts, [key](const char* part) { return key.starts_with(part); }) ? key : std::string_view();
}

/// The number at the top of the stack with all its bits, or the text.
std::string exact_text(lua_State* L) {
  return lua_isinteger(L, -1) || lua_type(L, -1) == LUA_TSTRING ? luaL_tolstring(L, -1, nullptr) : fmt::format("{}", lua_tonumber(L, -1));
}

/// { ["bodies.tank.mass"] = "3 kg", ["bodies.tank.com"] = {0, 0, 0.1} } at `index`: numbers in SI. In the order of the keys, whatever the
/// table's.
std::map<std::string, std::string> vehicle_values(lua_State* L, int index, const char* whose) {
  const auto wrong = [&](const char* expected = "key paths of the vehicle with a text, a number, an array of these, true or false each") {
    refuse(L, Code::lua_argument, whose, expected, describe_value(L, -1), "{ [\"bodies.tank.mass\"] = \"3 kg\" }");
  };
  std::map<std::string, std::string> out;
  lua_pushvalue(L, index);
  if (!lua_istable(L, -1)) wrong("a table of key paths");
  const int table = lua_gettop(L);
  for (lua_pushnil(L); lua_next(L, table) != 0; lua_settop(L, table + 1)) {
    if (lua_type(L, -2) != LUA_TSTRING) wrong();
    const std::string_view key = lua_tostring(L, -2), path = vehicle_path(key);
    std::string& value = out[std::string(path.empty() ? key : path)];  // any key of the file: there are no parameters here
    if (lua_type(L, -1) == LUA_TSTRING || lua_type(L, -1) == LUA_TNUMBER) {
      value = exact_text(L);
    } else if (lua_isboolean(L, -1)) {
      value = lua_toboolean(L, -1) != 0 ? "true" : "false";
    } else if (lua_istable(L, -1) && lua_rawlen(L, -1) > 0 && count_keys(L, -1) == lua_rawlen(L, -1)) {
      const int list = lua_gettop(L);
      for (lua_Integer i = 1; i <= static_cast<lua_Integer>(lua_rawlen(L, list)); ++i, lua_settop(L, list)) {
        const int type = lua_rawgeti(L, list, i);
        if (type != LUA_TNUMBER && type != LUA_TSTRING) wrong();
        std::string entry = exact_text(L);
        if (type == LUA_TSTRING) {  // in the quotes of YAML, in which only they are written twice
          for (std::size_t at = 0; (at = entry.find('\'', at)) != std::string::npos; at += 2) entry.insert(at, 1, '\'');
          entry = '\'' + entry + '\'';
        }
        value += (i == 1 ? "[" : ", ") + entry;
      }
      value += "]";
    } else {
      wrong();
    }
  }
  lua_pop(L, 1);
  return out;
}

int vehicle(lua_State* L, Scenario& s) {
  expect_setup(L, s, "vehicle", false);
  const std::string name = file_name(L, "vehicle");
  if (s.model) refuse(L, Code::lua_argument, "vehicle", "one vehicle", "a second one", "a vehicle may hold several free bodies");
  Overrides given;
  if (!lua_isnoneornil(L, 2))
    for (const auto& value : vehicle_values(L, 2, "vehicle")) given.push_back(value);
  const Overrides of_script = given;
  for (Setting& set : s.settings)
    if (const std::string_view path = vehicle_path(set.key); !path.empty()) {
      given.emplace_back(path, set.value);
      set.used = true;
    }
  const std::string path = (s.folder / name).string();
  const std::string* kept = s.lua.options().stored ? s.lua.options().stored(name) : nullptr;
  std::error_code unusable;  // a name too long for a file, say
  if (!kept && (s.recorded || !std::filesystem::is_regular_file(path, unusable)))
    refuse(L, Code::file_not_found, "vehicle", "a vehicle in YAML, relative to the scenario", in_quotes(path));
  const Activity activity("the vehicle " + name);
  std::shared_ptr<SystemSpec> spec;
  try {
    spec = std::make_shared<SystemSpec>(kept ? vehicle_from_text(*kept, path, s.registry, given) : read_vehicle(path, s.registry, given));
  } catch (const InputError& e) {
    std::vector<Diagnostic> all = e.diagnostics();
    for (Diagnostic& d : all)
      for (const auto& [key, value] : of_script)
        if (d.at.mark.file == setting_mark(key, value).file) d.at.mark = LuaHost::caller(L);
    throw InputError(all);
  }
  s.inputs.push_back({name, sha256(spec->source_text), spec->source_text});
  note_files(s, *spec);
  s.modes_from_cache = make_modes(*spec, ModeCache::of_user());
  s.vehicle_file = path;
  s.changes.begin(std::move(given), spec);
  try {
    s.use_model(compile(spec, s.registry, s.compile_options()));
  } catch (const InputError& e) {
    if (!std::ranges::all_of(e.diagnostics(), [](const Diagnostic& d) { return d.code == Code::open_start; })) throw;
    s.open_start = e.diagnostics();  // initial{} may close it
    s.use_model(compile(s.described(), s.registry, s.compile_options()));
  }
  push_vehicle(L, s);
  return 1;
}

/// vehicle:change { ["bodies.tank.mass"] = "3 kg" }: the vehicle's text with these values, from the end of this instant on.
int vehicle_change(lua_State* L) {
  Scenario& s = *self<Kind::vehicle>(L).scenario;
  expect_state(L, s, "a change of the vehicle");
  std::vector<VehicleChanges::Wish> values;
  for (const auto& [key, value] : vehicle_values(L, 2, "vehicle:change"))
    values.push_back({key, value, {}, LuaHost::caller(L), LuaHost::traceback(L)});
  if (!values.empty()) s.changes.want(values);
  return 0;
}

template <class Objects>
int find(lua_State* L, const Objects& objects, Code code, const char* key_path, const char* what) {
  if (lua_type(L, 2) != LUA_TSTRING) refuse(L, Code::lua_argument, key_path, std::string("the name of ") + what, describe_value(L, 2));
  const std::string name = lua_tostring(L, 2);
  const auto found = std::find_if(objects.begin(), objects.end(), [&](const auto& o) { return o.name == name; });
  if (found == objects.end()) {
    std::vector<std::string> names;
    for (const auto& o : objects) names.push_back(o.name);
    refuse(L, code, key_path, fmt::format("{}: {}", what, listed(names)), in_quotes(name), did_you_mean(name, names));
  }
  return static_cast<int>(found - objects.begin());
}

template <Kind kKind>
int vehicle_part(lua_State* L) {
  Handle& h = self<Kind::vehicle>(L);
  Scenario& s = *h.scenario;
  const Model& m = *s.model;
  constexpr const char* of_body = kKind == Kind::hinge ? "vehicle:hinge" : kKind == Kind::modes ? "vehicle:modes" : "vehicle:body";
  const int index = kKind == Kind::node     ? find(L, m.nodes, Code::unknown_node, "vehicle:node", "a node of the vehicle")
                    : kKind == Kind::device ? find(L, m.devices.all, Code::unknown_name, "vehicle:device", "a device of the vehicle")
                    : kKind == Kind::loop   ? find(L, m.spec->loops, Code::unknown_name, "vehicle:loop", "a loop of the vehicle")
                                            : find(L, m.user, Code::unknown_body, of_body, "a body of the vehicle");
  if (kKind == Kind::modes && m.user[static_cast<std::size_t>(index)].n_modes == 0)
    refuse(L, Code::unknown_name, "vehicle:modes", "a flexible body", describe_value(L, 2));
  if (kKind == Kind::loop) return push_handle(L, kKind, index, s), 1;  // those of a vehicle are always the same
  const ModelMap& now = s.sim->now();
  push_handle(L, kKind, id_of(kKind == Kind::node ? now.node : kKind == Kind::device ? now.device : now.body, index), s);
  return 1;
}
int vehicle_mass(lua_State* L) {
  double mass = 0.0;
  for (const UserBody& u : self<Kind::vehicle>(L).scenario->present().user) mass += u.mass;
  lua_pushnumber(L, mass);
  return 1;
}

/// Studies about the present state.
template <int (*kPush)(lua_State*, Scenario&)>
int vehicle_study(lua_State* L) {
  Scenario& s = *self<Kind::vehicle>(L).scenario;
  s.expect_closed();
  return at_script_line(L, [&s](lua_State* l) { return kPush(l, s); });
}

}  // namespace

const std::vector<luaL_Reg>& vehicle_methods() {
  static const std::vector<luaL_Reg> all = [] {
    std::vector<luaL_Reg> own = {{"body", method<vehicle_part<Kind::body>, 1>},
                                 {"hinge", method<vehicle_part<Kind::hinge>, 1>},
                                 {"modes", method<vehicle_part<Kind::modes>, 1>},
                                 {"node", method<vehicle_part<Kind::node>, 1>},
                                 {"device", method<vehicle_part<Kind::device>, 1>},
                                 {"loop", method<vehicle_part<Kind::loop>, 1>},
                                 {"mass", method<vehicle_mass, 0>},
                                 {"change", method<vehicle_change, 1>},
                                 {"operators", method<vehicle_study<push_operators>>},
                                 {"linearize", method<vehicle_study<push_linear_model>>},
                                 {"system_modes", method<vehicle_study<push_modes>>},
                                 {"derivatives", method<vehicle_study<push_derivatives>>},
                                 {"inverse_kinematics", method<vehicle_study<push_inverse_kinematics>>},
                                 {"equilibrium", method<vehicle_study<push_equilibrium>>},
                                 {"closed_system", method<vehicle_study<push_closed_system>>}};
    own.insert(own.end(), topology_methods().begin(), topology_methods().end());
    return own;
  }();
  return all;
}

void bind_vehicle(Scenario& s) {
  s.lua.bind("plugin", [&s](lua_State* L) { return plugin(L, s); });
  s.lua.bind("vehicle", [&s](lua_State* L) { return vehicle(L, s); });
}

}  // namespace cardan
