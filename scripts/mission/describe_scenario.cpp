#include "scripts/mission/describe_scenario.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "core/model/loops.hpp"
#include "core/sim/compare_forms.hpp"
#include "core/sim/description.hpp"
#include "core/sim/other_cuts.hpp"
#include "scripts/mission/examine.hpp"
#include "scripts/mission/mission_run.hpp"

namespace cardan {

namespace {

/// No number of JSON is infinite: what is compared with zero, or with no v' of the twin.
Json number(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

Json compared(const ComparedForms& all) {
  Json forms = Json::array();
  for (const ComparedForm& f : all.forms) {
    Json form = {{"form", loop_forms()[static_cast<std::size_t>(f.form)]}};
    if (!f.refused.empty())
      form["refused"] = f.refused;
    else
      form.update({{"vdot", number(f.vdot)}, {"multipliers", number(f.multipliers)}, {"reactions", number(f.reactions)}});
    forms.push_back(form);
  }
  return {{"no_twin", all.no_twin}, {"all", forms}};
}

}  // namespace

Json describe_scenario(Scenario& s, const DescribeOptions& options) {
  Json out = describe(*s.sim, options.measured, options.n_modes);
  out["mission"] = {{"title", s.mission.title}, {"duration_s", s.mission.duration}, {"integrator", out["integrator"]}};
  if (s.beginning) out["loops"]["moved"] = moved_at_start(s.moved_by_beginning);
  if (const auto cuts = cut_costs(s.sim->model(), s.registry)) {
    Json others = Json::array();
    for (const CutCost& c : cuts->others) others.push_back({{"loop", c.loop}, {"hinge", c.hinge}, {"flops", c.flops}});
    out["loops"]["cuts"] = {{"flops", cuts->flops}, {"others", others}, {"all", cuts->all}};
  }
  if (options.forms)
    if (const auto forms = compare_forms(*s.sim, s.registry, s.compile_options())) out["loops"]["forms"] = compared(*forms);
  if (!s.drawn.empty()) {
    out["drawn"] = Json::array();
    for (std::size_t i = 0; i < s.drawn.size(); ++i)
      out["drawn"].push_back({{"name", s.drawn[i].name}, {"value", s.drawn[i].value}, {"unit", s.drawn[i].unit}, {"spread", s.spreads[i]}});
  }
  out["controllers"] = Json::array();
  for (const Controller& c : s.controllers) out["controllers"].push_back({{"name", c.name}, {"period_s", c.period.value()}});
  if (!s.sequences.empty()) {
    try_sequences(s);  // the last that is done with it: what they command stays
    out["sequences"] = Json::array();
    for (const Sequences::Sequence& q : s.sequences.all())
      out["sequences"].push_back(
          {{"name", q.name}, {"starts", q.starts}, {"waits_first_for", q.state == Sequences::State::waiting ? q.wait.text() : ""}});
  }
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
