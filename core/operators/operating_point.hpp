#pragma once
#include <span>

#include "core/dynamics/devices.hpp"

namespace cardan::operators {

/// Where derivatives of a motion are taken, in the user's order; units as in Model. Loops are closed there.
struct OperatingPoint {
  double t = 0.0;  // [s]
  const double* q = nullptr;
  const double* v = nullptr;
  const double* tau = nullptr;                // forces of actuators and devices, without springs; null = 0
  const double* vdot = nullptr;               // of given motions, the others not read; null = 0
  std::span<const NodeWrench> wrenches = {};  // those of devices first, as Simulation::wrenches() has them
  const DeviceForces* devices = nullptr;      // evaluated at the point; null: their loads are held
  const FieldMoment* moment = nullptr;        // as Inputs::moment
  const LoopDrive* drives = nullptr;          // as Inputs::drives
};

}  // namespace cardan::operators
