#pragma once
#include "core/io/json.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// The description of its model (core/sim/description.hpp) with mission, controllers, warnings and defaults.
Json describe_scenario(Scenario&, bool measured = false, int n_modes = -1);

/// "modes of a, b: from the cache", with a newline; empty where none are from there. Not part of the description, which is the
/// same either way.
std::string modes_line(const Scenario& s);

}  // namespace cardan
