#include "scripts/host/scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "bodies/register.hpp"
#include "core/base/activity.hpp"
#include "core/base/excerpt.hpp"
#include "core/base/units.hpp"
#include "core/io/sha256.hpp"
#include "core/model/schema.hpp"
#include "hinges/register.hpp"
#include "scripts/host/bind_operators.hpp"
#include "scripts/host/bind_sim.hpp"
#include "scripts/host/examine.hpp"
#include "scripts/host/lua_matrix.hpp"
#include "scripts/host/prelude.hpp"
#include "scripts/host/run_mission.hpp"

namespace cardan {
namespace {

std::filesystem::path script_of(const std::filesystem::path& file) {
  std::error_code ignored;
  return std::filesystem::is_directory(file, ignored) ? file / "scenario.lua" : file;
}

LuaOptions lua_options(Scenario& s, const ScenarioOptions& options) {
  LuaOptions lua;
  lua.folder = script_of(options.file).parent_path();
  lua.built_in = prelude_modules();
  lua.seed = options.seed;
  lua.print = options.print;
  lua.output = options.output;
  lua.width = options.width;
  lua.interrupt = options.interrupt;
  if (options.recorded)
    lua.stored = [texts = &options.recorded->texts](const std::string& name) {
      const auto found = texts->find(name);
      return found == texts->end() ? nullptr : &found->second;
    };
  lua.loaded = [&s](const std::string& name, std::string_view text) {
    s.inputs.push_back({name, sha256(text), std::string(text)});
  };
  return lua;
}

[[noreturn]] void fail(const Scenario& s, Code code, std::string key_path, std::string expected, std::string got,
                       std::string hint) {
  throw InputError(Diagnostic{code,
                              {std::move(key_path), {s.file.string(), 0, 0}},
                              std::move(expected),
                              std::move(got),
                              std::move(hint),
                              {},
                              {},
                              0});
}

void expect_known(const Scenario& s) {
  for (const Setting& set : s.settings) {
    if (set.used) continue;
    std::string known;
    for (const std::string& name : s.parameter_names) known += name + ", ";
    throw InputError(Diagnostic{
        Code::unknown_name,
        {set.key, {fmt::format("--set {}={}", set.key, set.value), 0, 0}},
        (known.empty() ? "" : "a parameter (" + known.substr(0, known.size() - 2) + "), ") +
            "bodies..., gravity... or another key path of the vehicle (vehicle....), or mission....",
        in_quotes(set.key),
        did_you_mean(set.key, s.parameter_names),
        {},
        {},
        0});
  }
}

/// What only the whole script can tell.
void expect_complete(const Scenario& s) {
  if (!s.model)
    fail(s, Code::empty_system, "vehicle", "a vehicle", "none", "begin with: local sat = vehicle \"vehicle.yaml\"");
  if (!s.mission.declared)
    fail(s, Code::missing_key, "mission", "a mission with its duration", "none",
         "mission { title = ..., duration = \"400 s\" }");
  expect_known(s);
}

/// Signals share the tree of the results with what is recorded anyway: a name that is taken, or is the folder of another one.
void expect_channels(Scenario& s) {
  if (s.signals.empty()) return;
  std::map<std::string, int> paths;  // how often
  ++paths["reference/difference"];   // of --check-against-reference
  for (const Output& o : mission_outputs(s)) ++paths[o.channel.path];
  for (const auto& signal : s.signals) {
    const std::string& path = signal->channel.path;
    std::string other = paths[path] > 1 ? path : "";
    for (std::size_t slash = path.find('/'); slash != std::string::npos && other.empty(); slash = path.find('/', slash + 1))
      if (paths.contains(path.substr(0, slash))) other = path.substr(0, slash);
    const auto below = paths.lower_bound(path + "/");
    if (other.empty() && below != paths.end() && below->first.starts_with(path + "/")) other = below->first;
    if (!other.empty())
      throw InputError(Diagnostic{Code::duplicate_name, {"signals." + path, signal->declared}, "a name of its own in the tree of the results",
                                  fmt::format("{} beside the channel {}", in_quotes(path), in_quotes(other)), {}, {}, {}, 0});
  }
}

/// With all that scripts see, before any script.
std::unique_ptr<Scenario> open_scenario(const ScenarioOptions& options) {
  auto s = std::make_unique<Scenario>(options);
  open_matrices(s->lua);
  bind_setup(*s);
  bind_handles(*s);
  bind_operators(*s);
  bind_sim(*s, nullptr);
  bind_mission(*s);
  run_prelude(*s);
  return s;
}

}  // namespace

Scenario::Scenario(const ScenarioOptions& options)
    : file(script_of(options.file)),
      folder(file.parent_path()),
      settings(options.settings),
      seed(options.seed),
      recorded(options.recorded),
      lua(lua_options(*this, options)) {
  register_hinges(registry);
  register_bodies(registry);
}

void Scenario::look_at_state() {
  q = sim->state().q.data();
  v = sim->state().v.data();
}

void Scenario::use_model(std::shared_ptr<const Model> compiled) {
  const Activity activity(fmt::format("a simulation of {} bodies with {} velocities", compiled->user.size(), compiled->nv));
  const std::unique_ptr<Simulation> before = std::move(sim);
  model = std::move(compiled);
  sim = std::make_unique<Simulation>(model, mission.simulation);
  for (const Load& load : loads) sim->add_wrench(load.node, load.world_axes);
  if (before) sim->take_over(*before);
  scratch.assign(static_cast<std::size_t>(model->nv), 0.0);
  look_at_state();
}

std::unique_ptr<Scenario> load_scenario(const ScenarioOptions& options) {
  auto s = open_scenario(options);
  s->lua.run_file(s->file.filename().string());
  expect_complete(*s);
  expect_channels(*s);
  examine(*s);
  return s;
}

std::unique_ptr<Scenario> load_vehicle(const ScenarioOptions& options) {
  auto s = open_scenario(options);
  s->lua.protect([&](lua_State* L) {
    lua_getglobal(L, "vehicle");
    lua_pushstring(L, s->file.filename().c_str());
    lua_call(L, 1, 0);
  });
  expect_known(*s);
  return s;
}

void run_prelude(Scenario& s) {
  s.lua.run_text("[cardan]",
                 "for _, name in ipairs { 'quat', 'vec', 'allocation' } do _G[name] = require('cardan.' .. name) end");
}

void refuse(lua_State* L, Code code, std::string key_path, std::string expected, std::string got, std::string hint) {
  throw InputError(Diagnostic{code,
                              {std::move(key_path), LuaHost::caller(L)},
                              std::move(expected),
                              std::move(got),
                              std::move(hint),
                              LuaHost::traceback(L),
                              {},
                              0});
}

std::string place_of_failure(const SourceMark& mark) {
  if (mark.file.empty()) return {};
  std::string out = fmt::format("\n  --> {}:{}\n{}", mark.file, mark.line, excerpt(mark));
  while (out.ends_with('\n')) out.pop_back();
  return out;
}

void expect_setup(lua_State* L, const Scenario& s, const char* what, bool needs_vehicle) {
  if (s.stage != Scenario::Stage::setup)
    refuse(L, Code::lua_argument, what, "a declaration before the run", "one during the run",
           "move it to the top level of the script");
  if (needs_vehicle && !s.model)
    refuse(L, Code::lua_argument, what, "a vehicle before it", "no vehicle yet",
           "begin with: local sat = vehicle \"vehicle.yaml\"");
}

}  // namespace cardan
