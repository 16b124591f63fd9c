#include "scripts/bindings/open.hpp"

#include <fmt/format.h>

#include <map>

#include "core/base/units.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/schema.hpp"
#include "scripts/bindings/bind.hpp"
#include "scripts/bindings/operators.hpp"
#include "scripts/bindings/sim.hpp"
#include "scripts/lua/matrix.hpp"
#include "scripts/mission/examine.hpp"

namespace cardan {
namespace {

[[noreturn]] void fail(const Scenario& s, Code code, std::string key_path, std::string expected, std::string got, std::string hint) {
  refuse(code, {std::move(key_path), {s.file.string()}}, std::move(expected), std::move(got), std::move(hint));
}

void expect_known(const Scenario& s) {
  for (const Setting& set : s.settings) {
    if (set.used) continue;
    std::string known;
    for (const std::string& name : s.parameter_names) known += name + ", ";
    refuse(Code::unknown_name, {set.key, setting_mark(set.key, set.value)},
           (known.empty() ? "" : "a parameter (" + known.substr(0, known.size() - 2) + "), ") +
               "bodies..., gravity... or another key path of the vehicle (vehicle....), or mission....",
           in_quotes(set.key), did_you_mean(set.key, s.parameter_names));
  }
}

/// What only the whole script can tell.
void expect_complete(const Scenario& s) {
  if (!s.model) fail(s, Code::empty_system, "vehicle", "a vehicle", "none", "begin with: local sat = vehicle \"vehicle.yaml\"");
  if (!s.mission.declared)
    fail(s, Code::missing_key, "mission", "a mission with its duration", "none", "mission { title = ..., duration = \"400 s\" }");
  expect_known(s);
}

/// Phases that others name are declared.
void expect_phases(const Scenario& s) {
  for (const Phase& p : s.phases)
    if (!p.next.empty() && index_of_phase(s.phases, p.next) == s.phases.size())
      refuse(Code::unknown_name, {fmt::format("phase {}.next", p.name), p.declared}, fmt::format("a phase: {}", listed(names_of(s.phases))),
             in_quotes(p.next), did_you_mean(p.next, names_of(s.phases)));
}

/// Signals share the tree of the results with what is recorded anyway: a name that is taken, or is the folder of another one.
void expect_channels(Scenario& s) {
  if (s.signals.empty()) return;
  std::map<std::string, int> paths;  // how often
  ++paths["reference/difference"];   // of --check-against-reference
  ++paths["time"];                   // whose hash stands beside theirs
  std::vector<std::string> attitudes;
  for (const Output& o : mission_outputs(s)) {
    ++paths[o.channel.path];
    if (is_attitude(o.channel.components) && o.channel.commands.empty()) attitudes.push_back(o.channel.path);
  }
  for (const auto& signal : s.signals) {
    const std::string &path = signal->channel.path, &commanded = signal->channel.commands;
    if (!commanded.empty() && std::ranges::find(attitudes, commanded) == attitudes.end())
      refuse(Code::unknown_name, {"signals." + path + ".commands", signal->declared},
             fmt::format("an attitude that is recorded: {}", listed(attitudes)), in_quotes(commanded), did_you_mean(commanded, attitudes));
    std::vector<std::string> names = signal->channel.components;
    std::ranges::sort(names);
    if (const auto twice = std::ranges::adjacent_find(names); twice != names.end())
      refuse(Code::duplicate_name, {"signals." + path + ".components", signal->declared}, "names, each once", in_quotes(*twice) + " twice");
    std::string other = paths[path] > 1 ? path : "";
    for (std::size_t slash = path.find('/'); slash != std::string::npos && other.empty(); slash = path.find('/', slash + 1))
      if (paths.contains(path.substr(0, slash))) other = path.substr(0, slash);
    const auto below = paths.lower_bound(path + "/");
    if (other.empty() && below != paths.end() && below->first.starts_with(path + "/")) other = below->first;
    if (!other.empty())
      refuse(Code::duplicate_name, {"signals." + path, signal->declared}, "a name of its own in the tree of the results",
             fmt::format("{} beside the channel {}", in_quotes(path), in_quotes(other)));
  }
}

/// quat, vec, allocation, elliptic, cmg, slosh, slew, orbit, pointing, estimation, filter.
void run_prelude(Scenario& s) {
  s.lua.run_text(
      "[cardan]",
      "for _, name in ipairs { 'quat', 'vec', 'allocation', 'elliptic', 'cmg', 'slosh', 'slew', 'orbit', 'pointing', 'estimation', "
      "'filter' } do _G[name] = require('cardan.' .. name) end");
}

/// With all that scripts see, before any script.
std::unique_ptr<Scenario> bare_scenario(const ScenarioOptions& options) {
  auto s = std::make_unique<Scenario>(options);
  open_matrices(s->lua);
  bind_parameters(*s);
  bind_vehicle(*s);
  bind_script_device(*s);
  bind_mission(*s);
  bind_initial(*s);
  bind_declarations(*s);
  bind_astronomy(*s);
  bind_control(*s);
  bind_sequences(*s);
  bind_handles(*s);
  bind_operators(*s);
  bind_sim(*s, nullptr);
  run_prelude(*s);
  return s;
}

}  // namespace

std::unique_ptr<Scenario> open_scenario(const ScenarioOptions& options) {
  auto s = bare_scenario(options);
  if (const auto ending = s->file.extension(); ending == ".yaml" || ending == ".yml")
    refuse(Code::command_line, {"", {s->file.string()}}, "a scenario: a Lua file, or a folder with scenario.lua", "the name of a vehicle",
           fmt::format("two lines make one: vehicle \"{}\"  mission {{ duration = 10 }}", s->file.filename().string()));
  s->lua.run_file(s->file.filename().string());
  s->expect_closed();
  expect_complete(*s);
  expect_phases(*s);
  expect_channels(*s);
  examine(*s);
  return s;
}

std::unique_ptr<Scenario> open_vehicle(const ScenarioOptions& options) {
  auto s = bare_scenario(options);
  s->lua.protect([&](lua_State* L) {
    lua_getglobal(L, "vehicle");
    lua_pushstring(L, s->file.filename().c_str());
    lua_call(L, 1, 0);
  });
  s->expect_closed();
  expect_known(*s);
  return s;
}

}  // namespace cardan
