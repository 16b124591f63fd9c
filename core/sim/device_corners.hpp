#pragma once
// How often devices end steps by themselves, before a run: what `method = "auto"` counts beside ticks.
#include "core/model/model.hpp"

namespace cardan {

/// [s] Mean time between two such instants in the first `span` [s] of a run, infinite where there are fewer than two: crossings of the
/// roots of devices as time passes and their own states move at the rates of the start, with mounts that stand still there and the inputs
/// of the vehicle file. Rows of a record and steps of a drive that turns count; what hangs on the motion (touches, slack) and on commands
/// of a mission is not known yet.
double interval_of_device_corners(const Model& model, double span);

}  // namespace cardan
