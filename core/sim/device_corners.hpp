#pragma once
// How often devices end steps by themselves, and how fast they make a vehicle swing, before a run: what `method = "auto"` counts beside
// ticks, modes and springs.
#include "core/model/model.hpp"

namespace cardan {

struct DeviceCorners {
  double interval;    // [s] mean time between two such instants, infinite where there are fewer than two
  bool as_commanded;  // a mission may make it as short as it likes, by commands that have no limit
};
/// In the first `span` [s] of a run: crossings of the roots of devices as time passes and their own states move at the rates of the start,
/// with mounts that stand still there and the inputs of the vehicle file, or commands as large as there are any (a `rate_limit`). Rows of
/// a record and steps of a drive that turns count; what hangs on the motion (touches, slack) is not known yet.
DeviceCorners device_corners(const Model& model, double span);

/// [rad/s] The root of the largest eigenvalue of -M^-1 d tau / d q by what devices push with at the start, states and commands held: of a
/// stepper's field, a bushing. Central differences of v'. 0 where there is none, of closed loops, and where it cannot be evaluated.
double swing_of_devices(const Model& model);

}  // namespace cardan
