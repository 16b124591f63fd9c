// Where the results of a scenario come from.
#include <fmt/format.h>

#include <filesystem>

#include "core/sim/run_header.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

std::string seconds_text(const Rational& period) {
  return period.denominator == 1 ? fmt::format("{} s", period.numerator) : fmt::format("{}/{} s", period.numerator, period.denominator);
}

std::vector<std::pair<std::string, std::string>> mission_values(const Scenario& s) {
  const MissionSpec& m = s.mission;
  const IntegratorOptions& i = m.simulation.integrator;
  std::vector<std::pair<std::string, std::string>> all;
  const auto add = [&](const char* key, std::string value) { all.emplace_back(fmt::format("mission.{}", key), std::move(value)); };
  const auto names = [](const std::vector<int>& which, const auto& of) {
    std::string text;
    for (const int k : which) text += (text.empty() ? "" : ", ") + of[static_cast<std::size_t>(k)].name;
    return text;
  };
  add("duration", quantity_text(m.duration, "s"));
  if (m.simulation.dynamics != Dynamics::standard) add("dynamics", name_of(m.simulation.dynamics));
  add("integrator.method", i.method);
  if (i.fixed_step == 0.0) add("integrator.relative", fmt::format("{}", i.relative_tolerance));
  if (m.simulation.absolute_tolerance > 0) add("integrator.absolute", fmt::format("{}", m.simulation.absolute_tolerance));
  const TolerancesByKind& by = m.simulation.tolerances;
  const auto kind = [&](const char* key, double x, const char* unit) {
    if (x > 0) add((std::string("integrator.tolerances.") + key).c_str(), quantity_text(x, unit));
  };
  kind("angle", by.angle, "rad"), kind("position", by.position, "m"), kind("rate", by.rate, "rad/s");
  kind("velocity", by.velocity, "m/s"), kind("modes", by.modes, "1");
  if (!i.linear_solver.empty()) add("integrator.linear_solver", i.linear_solver);
  if (i.initial_step > 0) add("integrator.initial_step", quantity_text(i.initial_step, "s"));
  if (i.max_step > 0) add("integrator.max_step", quantity_text(i.max_step, "s"));
  if (i.fixed_step > 0) add("integrator.step", quantity_text(i.fixed_step, "s"));
  add("output.period", seconds_text(m.output_period));
  if (m.simulation.between_steps) add("output.between_steps", "true");
  add("checkpoint.period", m.checkpoint_period ? seconds_text(*m.checkpoint_period) : "never");
  if (!m.reactions.empty()) add("output.reactions", names(m.reactions, s.model->user));
  if (!m.nodes.empty()) add("output.nodes", names(m.nodes, s.model->nodes));
  add("ledger", m.simulation.ledger ? "true" : "false");
  for (const Controller& c : s.controllers) add(("controller." + c.name + ".period").c_str(), seconds_text(c.period));
  return all;
}

}  // namespace

RunHeader run_header(const Scenario& s) {
  RunHeader h = run_header(*s.sim);
  h.scenario = s.file.filename().string();
  h.folder = std::filesystem::absolute(s.file).lexically_normal().parent_path().string();
  h.title = s.mission.title;
  h.seed = s.seed;
  for (const Setting& set : s.settings) h.settings.emplace_back(set.key, set.value);
  h.inputs = s.inputs, h.plugins = s.plugins, h.modal_files = s.modal_files;
  for (const auto& more : {mission_values(s), s.parameters})
    h.effective_parameters.insert(h.effective_parameters.end(), more.begin(), more.end());
  h.defaults_used.insert(h.defaults_used.end(), s.mission.defaults_used.begin(), s.mission.defaults_used.end());
  return h;
}

}  // namespace cardan
