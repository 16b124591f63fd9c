#pragma once
#include "scripts/lua/matrix.hpp"
#include "scripts/mission/scenario.hpp"

namespace cardan {

class Workbench;

/// Makes the global `sim`; `bench` is null in a mission, which can look but not set.
void bind_sim(Scenario& scenario, Workbench* bench);

/// Names and units of q and v, in the user's order: "rod.angle" in "rad", "wing.eta_1" in "1".
Labels coordinate_labels(const Model&);
Labels velocity_labels(const Model&);

}  // namespace cardan
