#include "scripts/mission/describe_scenario.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/sim/description.hpp"
#include "core/sim/other_cuts.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {

Json describe_scenario(Scenario& s, bool measured, int n_modes) {
  Json out = describe(*s.sim, measured, n_modes);
  out["mission"] = {{"title", s.mission.title}, {"duration_s", s.mission.duration}, {"integrator", out["integrator"]}};
  if (const auto cuts = cut_costs(s.sim->model(), s.registry)) {
    Json others = Json::array();
    for (const CutCost& c : cuts->others) others.push_back({{"loop", c.loop}, {"hinge", c.hinge}, {"flops", c.flops}});
    out["loops"]["cuts"] = {{"flops", cuts->flops}, {"others", others}, {"all", cuts->all}};
  }
  out["controllers"] = Json::array();
  for (const Controller& c : s.controllers)
    out["controllers"].push_back(
        {{"name", c.name}, {"period_s", static_cast<double>(c.period.numerator) / static_cast<double>(c.period.denominator)}});
  out["script_devices"] = Json::array();
  for (const auto& d : s.script_devices) {
    s.sim->observe();
    out["script_devices"].push_back({{"type", d->description().type},
                                     {"in_step", d->description().in_step},
                                     {"calls", d->calls()},
                                     {"us", d->calls() > 0 ? 1e6 * d->seconds() / static_cast<double>(d->calls()) : 0.0}});
  }
  out["warnings"] = Json::array();
  for (const Warning& w : s.warnings.all()) out["warnings"].push_back(to_json(w));
  out["defaults"] = Json::object();
  for (const auto& [key, value] : run_header(s).defaults_used) out["defaults"][key] = value;
  return out;
}

std::string modes_line(const Scenario& s) {
  return s.modes_from_cache.empty() ? "" : fmt::format("modes of {}: from the cache\n", fmt::join(s.modes_from_cache, ", "));
}

}  // namespace cardan
