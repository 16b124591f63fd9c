#pragma once
// What may be left out of the model of a scene, for an error budget: as values of its vehicle.
#include <vector>

#include "scripts/mission/scenario.hpp"
#include "scripts/precision/simplify.hpp"

namespace cardan {

/// Levels and modes of bodies, terms of rotary inertia, of gravity. Each is tried on the scenario that `options` opens: what it does not
/// take has a refusal.
std::vector<Simplification> simplifications_of(const Scenario& scenario, const ScenarioOptions& options);
/// Operations and functions of one evaluation of v' that are counted, with these values beside those of the options.
double counted_operations(const ScenarioOptions& options, const Sets& sets);

}  // namespace cardan
