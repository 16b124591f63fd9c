#pragma once
// Bodies whose mass varies: what the mass that flows does to them. docs/mathematics/devices.md, 5.
#include "core/dynamics/node_motion.hpp"
#include "core/spatial/tangent.hpp"

namespace cardan {

/// How a body with a varying mass moves, its sweep frame, and where it is.
struct VaryingMotion {
  BodyMotion<double> moves;
  Pose<double> W;  // in the world
};

/// What a device gives to its body at these z and marks of all devices.
cardan_mass mass_of(const Device&, const double* z, const double* marks);
/// Its derivative along dz.
cardan_mass mass_rate(const Devices&, const Device&, const double* z, const double* marks, const double* dz);
/// The derivative of inertia_of(m) along `rate`.
RigidInertia<double> inertia_rate(const cardan_mass& m, const cardan_mass& rate);

/// Of all devices of a model, as evaluated, or the derivatives of that along a direction.
struct EvaluatedDevices {
  const cardan_mount_motion* motions;
  const double *outputs, *z, *zdot;
};
/// Adds to `loads` (Devices::n_loads wrenches, node axes) what mass that is drawn and leaves does on its way.
void add_flow_forces(const Devices&, const EvaluatedDevices&, const double* marks, Force<double>* loads);
/// The same with its derivative along `along`.
void add_flow_forces(const Devices&, const EvaluatedDevices&, const EvaluatedDevices& along, const double* marks, Force<Tangent>* loads);

/// Rate of the momentum of the bodies by the change of their mass alone, [moment about the world's origin; force], world axes, and of
/// their energy [W]: what mass that leaves had.
struct LeavingMass {
  Force<double> momentum{};
  double power = 0.0;
};
LeavingMass leaving_mass(const Model&, const cardan_mount_motion* motions, const double* z, const double* zdot, const double* marks,
                         const FieldMoment* at);

/// Derivative along a change dM of the inertia of sweep body k of the force that its motion needs, gravity of a centre taken off: at B,
/// its axes.
Force<double> force_of_inertia(const Model&, int k, const RigidInertia<double>& dM, const VaryingMotion&, bool gravity,
                               const FieldMoment* when);

}  // namespace cardan
