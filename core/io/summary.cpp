#include "core/io/summary.hpp"

#include <algorithm>

#include "core/io/json.hpp"

namespace cardan {
namespace {
constexpr std::size_t kMostWorst = 20;

Json json_of(const Ledger& l) {
  return {{"linear_momentum", l.linear_momentum},
          {"angular_momentum", l.angular_momentum},
          {"energy", l.energy},
          {"limits", {{"linear_momentum", l.linear_limit}, {"angular_momentum", l.angular_limit}, {"energy", l.energy_limit}}},
          {"verdict", l.pass ? "pass" : "fail"},
          {"undecided", l.undecided}};
}
}  // namespace

std::string_view name_of(Verdict v) {
  constexpr std::string_view kNames[] = {"passed", "failed", "interrupted", "aborted"};
  return kNames[static_cast<int>(v)];
}

std::string to_json(const Summary& s) {
  Json checks = Json::array(), figures = Json::array(), drawn = Json::array(), warnings = Json::array();
  for (const auto& c : s.checks) {
    checks.push_back({{"name", c.name},
                      {"value", c.value},
                      {"limit", c.limit},
                      {"verdict", c.pass ? "pass" : "fail"},
                      {"unit", c.unit},
                      {"detail", c.detail}});
    if (!std::isinf(c.least)) checks.back()["least"] = c.least;
    if (!std::isinf(c.most)) checks.back()["most"] = c.most;
  }
  for (const auto& f : s.figures) figures.push_back({{"name", f.name}, {"value", f.value}, {"unit", f.unit}});
  for (const auto& d : s.drawn) drawn.push_back({{"name", d.name}, {"value", d.value}, {"unit", d.unit}});
  for (const auto& w : s.warnings.all()) warnings.push_back(to_json(w));
  Json hashes = Json::object();
  for (const auto& [channel, hash] : s.hashes) hashes[channel] = hash;
  Json integration = Json::object(), worst = Json::array();
  for (const StepInterval::Column& c : s.integration.columns()) integration[c.name] = c.value;
  for (const char* told : {"begin", "end", "steps", "evaluations", "of_worst"}) integration.erase(told);  // elsewhere in it
  for (std::size_t i = 0; i < std::min(s.worst.size(), kMostWorst); ++i)
    worst.push_back({{"component", s.worst[i].first}, {"steps", s.worst[i].second}});
  integration["worst"] = worst;
  const Json all = {
      {"scenario", s.scenario},
      {"verdict", name_of(s.verdict)},
      {"ended_by", s.ended_by},
      {"failure", s.failure ? to_json(*s.failure) : Json()},
      {"checks", checks},
      {"ledger", s.ledger ? json_of(*s.ledger) : Json()},
      {"simulated_s", s.simulated_s},
      {"planned_s", s.planned_s},
      {"wall_s", s.wall_s},
      {"cpu_s", s.cpu_s},
      {"steps", s.steps},
      {"rhs_calls", s.rhs_calls},
      {"rejected", s.rejected},
      {"restarts", s.restarts},
      {"jacobian_products", s.jacobian_products},
      {"preconditioner_setups", s.preconditioner_setups},
      {"linear_iterations", s.linear_iterations},
      {"inner_steps", s.inner_steps},
      {"integration", integration},
      {"figures", figures},
      {"drawn", drawn},
      {"warnings", warnings},
      {"warnings_left_out", s.warnings.left_out()},
      {"kept_outside_persist", s.kept_elsewhere},
      {"model",
       {{"bodies", s.model.bodies}, {"hinges", s.model.hinges}, {"n_q", s.model.n_q}, {"n_v", s.model.n_v}, {"n_modes", s.model.n_modes}}},
      {"versions", s.versions},
      {"hashes", {{"final_state", s.final_state}, {"channels", hashes}}}};
  return s.verdict == Verdict::aborted ? json_text_with_nulls(all) : json_text(all);
}

}  // namespace cardan
