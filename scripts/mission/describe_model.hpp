#pragma once
#include <string>

#include "core/io/json.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

/// What a scenario is made of, as data: bodies, masses, modes, gravity, program of sweeps, what is not modelled,
/// defaults, warnings. `n_modes` of the assembled system; negative: ten, of a system small enough.
Json describe_model(Scenario&, bool measured = false, int n_modes = -1);
/// The same as text.
std::string description_text(const Json& description);

/// "modes of a, b: from the cache", with a newline; empty where none are from there. Not part of the description, which is the
/// same either way.
std::string modes_line(const Scenario& s);

}  // namespace cardan
