#include "scripts/commands/simplifications.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/soa/cost.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/mission/examine.hpp"

namespace cardan {
namespace {

ScenarioOptions with(ScenarioOptions options, const Sets& sets) {
  for (const auto& [key, value] : sets) options.settings.push_back({key, value});
  return options;
}

/// Whether a body takes fewer modes than it has: those of a beam, a plate, a mesh are as many as are asked for.
const DocNode* made_modes(const BodySpec& body) {
  if (!body.modal_source) return nullptr;
  for (const char* source : {"beam", "plate", "matrices", "solid"})
    if (const DocNode* made = body.modal_source->find(source)) return made;
  return nullptr;
}

/// Modes of it that stay whatever is asked for: six constraint modes of each interface.
int constraint_modes(const BodySpec& body) {
  const DocNode *boundary = body.modal_source->find("boundary"), *nodes = body.modal_source->find("nodes");
  if (!boundary || boundary->text != "craig_bampton" || !nodes) return 0;
  return 6 * static_cast<int>(std::ranges::count_if(nodes->items, [](const DocNode& node) {
           const DocNode* interface = node.find("interface");
           return interface && interface->text == "true";
         }));
}

void of_body(const BodySpec& body, std::vector<Simplification>& out) {
  if (!body.modal) return;
  const std::string path = "vehicle.bodies." + body.name;
  if (const DocNode* source = made_modes(body)) {
    const int stay = constraint_modes(body);
    for (int n = body.modal->n_modes - stay - 1; n >= (stay > 0 ? 0 : 1); --n)
      out.push_back({"modes of " + body.name,
                     fmt::format("{}: {} of {} modes", body.name, n + stay, body.modal->n_modes),
                     {{path + ".modal.modes.count", fmt::format("{}", n)}},
                     {}});
    for (const char* kind : {"beam", "plate"})
      if (body.modal_source->find(kind)) {
        const DocNode* given = source->find("rotary_inertia");
        if (!given || given->text != "false")
          out.push_back({"rotary inertia of the elements of " + body.name,
                         fmt::format("{}: no rotary inertia of its elements", body.name),
                         {{fmt::format("{}.modal.{}.rotary_inertia", path, kind), "false"}},
                         {}});
      }
  }
  for (const double tolerance : {1e-2, 0.5})
    if (body.level > 0 && tolerance > body.rotary_tolerance && !body.modal->integrals.rotary_ww.empty())
      out.push_back({"rotary terms of " + body.name,
                     fmt::format("{}: rotary terms above {:g} of a modal mass alone", body.name, tolerance),
                     {{path + ".rotary_inertia", fmt::format("{:g}", tolerance)}},
                     {}});
  for (int level = body.level - 1; level >= 0; --level)
    out.push_back({"level of " + body.name,
                   fmt::format("{}: level {} in place of {}", body.name, level, body.level),
                   {{path + ".level", fmt::format("{}", level)}},
                   {}});
}

void of_gravity(const GravitySpec& gravity, std::vector<Simplification>& out) {
  using Kind = GravitySpec::Kind;
  if (gravity.kind == Kind::none) return;
  if (gravity.gradient && (gravity.kind == Kind::central || gravity.kind == Kind::field))
    out.push_back({"gravity",
                   "no gravity gradient",
                   {{gravity.kind == Kind::central ? "vehicle.gravity.central.gradient" : "vehicle.gravity.gradient", "false"}},
                   {}});
  out.push_back({"gravity", "no gravity", {{"vehicle.gravity", "none"}}, {}});
}

/// Why the scene cannot be opened like that; empty: it can.
std::string refusal_of(const ScenarioOptions& options) {
  try {
    const auto s = open_scenario(options);
    examine(*s);
    try_start(*s);
    return {};
  } catch (const InputError& e) {
    const Diagnostic& first = e.diagnostics().front();
    return fmt::format("{}: {}", number_of(first.code), first.got.empty() ? title_of(first.code) : first.got);
  } catch (const NumericsError& e) {
    return fmt::format("{}: {}", number_of(e.failure().code), e.failure().what);
  }
}

}  // namespace

std::vector<Simplification> simplifications_of(const Scenario& scenario, const ScenarioOptions& options) {
  const SystemSpec& spec = *scenario.model->spec;
  std::vector<Simplification> out;
  for (const BodySpec& body : spec.bodies) of_body(body, out);
  of_gravity(spec.gravity, out);
  for (Simplification& s : out) s.refusal = refusal_of(with(options, s.sets));
  return out;
}

double counted_operations(const ScenarioOptions& options, const Sets& sets) {
  const auto s = open_scenario(with(options, sets));
  double sum = 0.0;
  for (const soa::OpCost& op : soa::op_costs(*s->model, s->sim->state()))
    sum += static_cast<double>(std::max(0L, op.flops)) + static_cast<double>(op.functions);
  return sum;
}

}  // namespace cardan
