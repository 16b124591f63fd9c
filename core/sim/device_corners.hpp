#pragma once
// How often devices end steps by themselves, and how fast they make a vehicle swing, before a run: what `method = "auto"` counts beside
// ticks, modes and springs.
#include "core/model/model.hpp"
#include "core/sim/fastest_motion.hpp"

namespace cardan {

struct DeviceCorners {
  double interval;    // [s] mean time between two such instants, infinite where there are fewer than two
  bool as_commanded;  // a mission may make it as short as it likes, by commands that have no limit
};
/// In the first `span` [s] of a run: crossings of the roots of devices as time passes and their own states move at the rates of the start,
/// with mounts that stand still there and the inputs of the vehicle file, or commands as large as there are any (a `rate_limit`). Rows of
/// a record and steps of a drive that turns count; what hangs on the motion (touches, slack) is not known yet.
DeviceCorners device_corners(const Model& model, double span);

/// The root of the largest eigenvalue of -M^-1 d tau / d q [rad/s] by what devices push with, their states and commands held: of a
/// stepper's field, a bushing; `what` names the hinge at which it is, if it is at one. Central differences of v' at a state, at t [s]. A
/// rate of 0 where there is none, of closed loops, and where it cannot be evaluated.
FastestMotion swing_of_devices(const Model& model, double t, const State& at);

}  // namespace cardan
