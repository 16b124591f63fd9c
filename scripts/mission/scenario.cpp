#include "scripts/mission/scenario.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "bodies/register.hpp"
#include "core/base/activity.hpp"
#include "core/base/excerpt.hpp"
#include "core/io/sha256.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"
#include "scripts/prelude/prelude.hpp"

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
  lua.loaded = [&s](const std::string& name, std::string_view text) { s.inputs.push_back({name, sha256(text), std::string(text)}); };
  return lua;
}

}  // namespace

Scenario::Scenario(const ScenarioOptions& options)
    : file(script_of(options.file)),
      folder(file.parent_path()),
      settings(options.settings),
      seed(options.seed),
      until(options.until),
      recorded(options.recorded),
      lua(lua_options(*this, options)),
      persistent(lua) {
  register_hinges(registry);
  register_bodies(registry);
  register_devices(registry);
}
Scenario::~Scenario() = default;

void Scenario::look_at_state() {
  q = sim->state().q.data();
  v = sim->state().v.data();
  z = sim->state().z.data();
}

CompileOptions Scenario::compile_options() const {
  CompileOptions options;
  options.node_wrenches = !loads.empty();
  options.world_wrenches = std::ranges::any_of(loads, [](const Load& l) { return l.world_axes; });
  options.from_home = begins_far;
  return options;
}

void Scenario::use_model(std::shared_ptr<const Model> compiled) {
  const Activity activity(fmt::format("a simulation of {} bodies with {} velocities", compiled->user.size(), compiled->nv));
  const std::unique_ptr<Simulation> before = std::move(sim);
  model = std::move(compiled);
  sim = std::make_unique<Simulation>(model, mission.simulation);
  for (const Load& load : loads) sim->add_wrench(load.node, load.world_axes);
  if (before) sim->take_over(*before);
  sim->on_adopted([this] { model = sim->shared_model(), look_at_state(); });
  look_at_state();
}

std::shared_ptr<const SystemSpec> with_open_loops(SystemSpec spec) {
  for (LoopSpec& loop : spec.loops) loop.open = true;
  return std::make_shared<const SystemSpec>(std::move(spec));
}

std::shared_ptr<const SystemSpec> Scenario::described() const {
  return open_start.empty() ? changes.described() : with_open_loops(*changes.described());
}

void Scenario::expect_closed() const {
  if (!open_start.empty()) throw InputError(open_start);
}

std::vector<std::string> names_of(const std::vector<Phase>& phases) {
  std::vector<std::string> names;
  for (const Phase& p : phases) names.push_back(p.name);
  return names;
}

std::size_t index_of_phase(const std::vector<Phase>& phases, std::string_view name) {
  return static_cast<std::size_t>(std::ranges::find(phases, name, &Phase::name) - phases.begin());
}

std::string place_of_failure(const SourceMark& mark) {
  if (mark.file.empty()) return {};
  std::string out = fmt::format("\n  --> {}:{}\n{}", mark.file, mark.line, excerpt(mark));
  while (out.ends_with('\n')) out.pop_back();
  return out;
}

}  // namespace cardan
