// What a run comes to, as data and as text.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <lua.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/version.hpp"
#include "core/sim/run_header.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {
namespace {

bool begins(const std::string& text, std::string_view with) { return text.starts_with(with); }

std::string with_unit(double value, const std::string& unit) { return fmt::format("{:.6g}{}", value, unit == "1" ? "" : " " + unit); }

std::string checks_text(const std::vector<Check>& checks) {
  std::string text;
  for (const Check& c : checks) {
    // A value and its bound may look the same in six digits.
    const double beyond = std::max(c.value - c.most, c.least - c.value);
    const std::string by = !c.pass && std::isfinite(beyond) ? fmt::format(", beyond by {:.3g}", beyond) : "";
    text += fmt::format("  {:<6}{:<44}{:>20}   {}{}\n", c.pass ? "pass" : "FAIL", c.name, with_unit(c.value, c.unit), c.detail, by);
  }
  return text.empty() ? text : "\nchecks\n" + text;
}

std::string figures_text(const char* title, const std::vector<Figure>& figures) {
  std::string text;
  for (const Figure& f : figures) text += fmt::format("  {:<50}{:>20}\n", f.name, with_unit(f.value, f.unit));
  return text.empty() ? text : fmt::format("\n{}\n{}", title, text);
}

std::string hinges_text(const std::vector<Range>& ranges) {
  std::string text;
  for (const Range& r : ranges)
    if (begins(r.path, "hinges/") && !(r.least > r.largest)) {
      const bool force = r.path.ends_with("/force");
      if (force && r.least == 0.0 && r.largest == 0.0) continue;
      const std::string name = r.path.substr(7) + (force ? "/" + r.component : "");
      text += fmt::format("  {:<44}{:>14.6g}{:>14.6g} {}\n", name, r.least, r.largest, r.unit);
    }
  return text.empty() ? text : fmt::format("\n{:<46}{:>14}{:>14}\n", "hinges", "least", "largest") + text;
}

std::string modes_text(const std::vector<Range>& ranges) {
  std::string text, body;
  for (const Range& r : ranges) {
    if (!begins(r.path, "modes/") || !r.path.ends_with("/eta")) continue;
    const std::string name = r.path.substr(6, r.path.rfind('/') - 6);
    if (name != body) text += fmt::format("{}  {:<20}", text.empty() ? "" : "\n", name);
    body = name;
    text += fmt::format(" {:.2e}", std::max(std::abs(r.least), std::abs(r.largest)));
  }
  return text.empty() ? text : "\nmodes: largest |eta| of each\n" + text + "\n";
}

}  // namespace

Warnings run_warnings(const Scenario& s) {
  Warnings all = s.warnings;
  all.add(s.sim->warnings());
  return all;
}

Summary run_summary(const Scenario& s, double wall_s) {
  const Model& m = *s.model;
  Summary out;
  out.scenario = s.file.filename().string();
  if (s.mission.simulation.ledger) {
    const LedgerState& worst = s.sim->worst_ledger();
    out.ledger = Ledger{worst.linear_relative,
                        worst.angular_relative,
                        worst.energy_relative,
                        worst.linear_limit,
                        worst.angular_limit,
                        worst.energy_limit,
                        worst.pass,
                        worst.undecided()};
  }
  out.warnings = run_warnings(s);
  out.drawn = s.drawn;
  out.simulated_s = s.sim->time();
  out.wall_s = wall_s;
  const IntegratorStatistics i = s.sim->statistics();
  out.steps = i.steps, out.rhs_calls = i.rhs_calls, out.rejected = i.rejected.all();
  out.integration = s.sim->step_history().whole(), out.worst = s.sim->step_history().worst();
  // Those that a step followed: a checkpoint at the end is begun from by a run that is resumed, and counted there.
  out.restarts = std::accumulate(out.integration.restarts.begin(), out.integration.restarts.end(), 0L);
  out.jacobian_products = i.jacobian_products, out.preconditioner_setups = i.preconditioner_setups;
  out.linear_iterations = i.linear_iterations, out.inner_steps = i.inner_steps;
  out.model.bodies = static_cast<int>(m.user.size());
  out.model.hinges = static_cast<int>(std::count_if(m.user.begin(), m.user.end(), [](const UserBody& u) { return u.nv > 0; }));
  out.model.n_q = m.nq, out.model.n_v = m.nv, out.model.n_modes = m.n_modes;
  out.versions = {{"cardan", version::kNumber},
                  {"commit", version::kCommit},
                  {"compiler", version::kCompiler},
                  {"flags", version::kFlags},
                  {"sweeps", sweeps_name()},
                  {"sweep_flags", version::kSweepFlags},
                  {"Eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
                  {"Lua", LUA_VERSION_MAJOR "." LUA_VERSION_MINOR "." LUA_VERSION_RELEASE}};
  return out;
}

/// A line for each part of a run, the longest first.
std::string times_text(const RunProfile& times, const IntegratorStatistics& counts, std::string_view method) {
  struct Line {
    std::string name;
    double time;
    long calls;
    const char* of_calls;
  };
  std::vector<Line> lines = {{"right-hand side", times.rhs.time, times.rhs.calls, "evaluations"},
                             {fmt::format("method ({})", method), times.method(), counts.steps, "steps"},
                             {"controllers, sampled devices", times.controllers(), times.tasks.calls - times.outputs.calls, "ticks"},
                             {"outputs", times.outputs.time, times.outputs.calls, "rows"},
                             {"ledger", times.ledger.time, times.ledger.calls, "evaluations"},
                             {"projection", times.projection.time, times.projection.calls, "states"},
                             {"events", times.events.time, times.events.calls, "evaluations"}};
  double rest = times.run.time;
  for (const Line& line : lines) rest -= line.time;
  std::ranges::stable_sort(lines, std::ranges::greater{}, &Line::time);
  lines.push_back({"the rest", rest, 0, ""});
  std::string text = fmt::format("\nwhere {:.3g} s went\n", times.run.time);
  for (const Line& line : lines) {
    if (line.time <= 0.0) continue;
    text += fmt::format("  {:<30}{:>9.3g} s {:>5.1f} %", line.name, line.time, 100.0 * line.time / times.run.time);
    if (line.calls > 0)
      text += fmt::format("   {} {}, {:.3g} us each", line.calls, line.of_calls, 1e6 * line.time / static_cast<double>(line.calls));
    text += '\n';
  }
  return text;
}

/// What set the lengths of the steps, what was tried in vain, and why the method started anew.
std::string steps_text(const StepInterval& all, const std::vector<std::pair<std::string, long>>& worst) {
  if (all.steps == 0) return {};
  const auto counted = [](const std::vector<std::pair<std::string, long>>& parts) {
    std::string text;
    for (const auto& [name, n] : parts)
      if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, name);
    return text;
  };
  std::string text = fmt::format("steps of {:.3g} to {:.3g} s, of order {:.2g}: {}\n", all.shortest, all.longest,
                                 static_cast<double>(all.orders) / static_cast<double>(all.steps),
                                 counted({{"cut at instants and events", all.by_stop},
                                          {"as long as the error allowed", all.by_error},
                                          {"of a given length", all.steps - all.by_stop - all.by_error}}));
  std::vector<std::pair<std::string, long>> first(worst.begin(), worst.begin() + std::min<std::ptrdiff_t>(std::ssize(worst), 3));
  for (auto& [name, n] : first) name = "by " + name;
  if (!first.empty()) text += fmt::format("the error was mostly that of: {}\n", counted(first));
  const Rejections& r = all.rejected;
  if (r.all() > 0)
    text += fmt::format("{} trial steps rejected: {}\n", r.all(),
                        counted({{"mechanical", r.by_error[0]},
                                 {"modal", r.by_error[1]},
                                 {"of devices", r.by_error[2]},
                                 {"not evaluated", r.not_evaluated},
                                 {"not converged", r.not_converged}}));
  const auto& by = all.restarts;
  return text + fmt::format("started anew: {}\n", counted({{"at the start", by[0]},
                                                           {"at ticks", by[1]},
                                                           {"at events", by[2]},
                                                           {"at corners", by[3]},
                                                           {"off closed loops", by[4]},
                                                           {"at checkpoints", by[5]},
                                                           {"with another vehicle", by[6]}}));
}

std::string summary_text(const Scenario& s, const Summary& sum, const std::vector<Range>& ranges) {
  std::string text = s.mission.title.empty() ? "" : s.mission.title + "\n";
  text +=
      checks_text(sum.checks) + figures_text("figures", sum.figures) +
      figures_text(s.seed == 0 ? "parameters that chance sets, here as they are given (seed 0)" : "parameters that chance set", sum.drawn) +
      hinges_text(ranges) + modes_text(ranges);
  if (const auto& ledger = sum.ledger) {
    text += fmt::format(
        "\nledgers: largest residual over the sum of magnitudes\n  linear momentum {:.1e}   angular momentum {:.1e}   "
        "energy {:.1e}\n",
        ledger->linear_momentum, ledger->angular_momentum, ledger->energy);
    if (!ledger->undecided.empty())
      text += fmt::format(
          "  no verdict on {}: what the steps and their integrals may leave at this tolerance is more than a tenth of the sum\n",
          fmt::join(ledger->undecided, ", "));
  }
  if (sum.ended_by.starts_with("stop()"))
    text += fmt::format("\nended at t = {:.6g} of {:.6g} s by {}\n", sum.simulated_s, sum.planned_s, sum.ended_by);
  text += fmt::format("\n{:.6g} s simulated in {:.3g} s ({:.4g} times real time), {}\n{} steps, {} function calls, {} restarts\n",
                      sum.simulated_s, sum.wall_s, sum.wall_s > 0 ? sum.simulated_s / sum.wall_s : 0.0, s.sim->integrator_name(), sum.steps,
                      sum.rhs_calls, sum.restarts);
  text += steps_text(sum.integration, sum.worst);
  // Of few steps, or where the method takes as many, there is nothing to gain.
  constexpr long kMany = 10'000;
  if (const long looked = s.sim->ended_by_looking(); looked >= kMany && 2 * looked > sum.steps)
    text += fmt::format(
        "{} steps ended at rows of the output or readings of sensors alone: output = {{ between_steps = true }} lets these lie inside of "
        "steps\n",
        looked);
  if (!s.mission.why_method.empty()) {
    const std::string &chosen = s.mission.simulation.integrator.method, last = s.sim->integrator_name();
    text += fmt::format("{} was chosen by auto: {}{}\n", chosen, s.mission.why_method,
                        last == chosen ? "" : fmt::format("; {} went on at the end", last));
  }
  if (sum.preconditioner_setups > 0)
    text += fmt::format("{} products J v, {} preconditioners, {} linear iterations\n", sum.jacobian_products, sum.preconditioner_setups,
                        sum.linear_iterations);
  if (sum.inner_steps > 0) text += fmt::format("{} steps of the linear part\n", sum.inner_steps);
  if (const RunProfile* times = s.sim->times()) text += times_text(*times, s.sim->statistics(), s.sim->integrator_name());
  if (!sum.kept_elsewhere.empty() && s.mission.checkpoint_period) text += kept_elsewhere_text(sum.kept_elsewhere);
  return text;
}

std::string kept_elsewhere_text(const std::vector<std::string>& names) {
  return fmt::format("cannot be resumed: kept outside of persist{{}}: {}\n", fmt::join(names, ", "));
}

}  // namespace cardan
