#pragma once
#include "core/model/model.hpp"
#include "scripts/lua/matrix.hpp"

namespace cardan {

/// Names and units of q and v, in the user's order: "rod.angle" in "rad", "wing.eta_1" in "1".
Labels coordinate_labels(const Model&);
Labels velocity_labels(const Model&);

}  // namespace cardan
