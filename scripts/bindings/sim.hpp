#pragma once
#include "scripts/mission/scenario.hpp"

namespace cardan {

class Workbench;

/// Makes the global `sim`; `bench` is null in a mission, which can look but not set.
void bind_sim(Scenario& scenario, Workbench* bench);

}  // namespace cardan
