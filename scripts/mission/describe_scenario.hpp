#pragma once
#include "core/io/json.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

struct DescribeOptions {
  bool measured = false;  // time each op
  bool forms = false;     // compare the solutions of closed loops (core/sim/compare_forms.hpp)
  int n_modes = -1;       // of the assembled system; -1: as describe() chooses
};
/// The description of its model (core/sim/description.hpp) with mission, controllers, warnings and defaults.
Json describe_scenario(Scenario&, const DescribeOptions&);

/// "modes of a, b: from the cache", with a newline; empty where none are from there. Not part of the description, which is the
/// same either way.
std::string modes_line(const Scenario& s);

}  // namespace cardan
