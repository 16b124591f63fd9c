#pragma once
// From a file to a scenario with all that scripts see.
#include <memory>

#include "scripts/mission/scenario.hpp"

namespace cardan {

/// Reads and runs the script: everything up to the run. Throws InputError.
std::unique_ptr<Scenario> open_scenario(const ScenarioOptions& options);
/// A vehicle alone, without a mission: `options.file` is the YAML file.
std::unique_ptr<Scenario> open_vehicle(const ScenarioOptions& options);

}  // namespace cardan
