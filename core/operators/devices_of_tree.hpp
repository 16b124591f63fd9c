#pragma once
// Devices where the bodies of a tree, or of a part of one, move. A mount on a body that takes no part is on what stands still: it is read
// there at rest, and what is pushed with there meets ground.
#include "core/dynamics/devices.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// Which devices take part, by index into Devices::all: of a mount on a body that does, or joined to such a device by connections.
std::vector<std::uint8_t> devices_that_take_part(const TreeOperators& tree);

/// Evaluates `devices` anew, at their own states and commands, where the bodies of `tree` move with `v` (of the model, 0 for those that
/// take no part). Hinge forces are added to `tau`; `wrenches` begins with the loads of devices. NumericsError N0501 of one without a value.
void evaluate_in(const TreeOperators& tree, DeviceForces& devices, const double* v, double* tau, std::span<NodeWrench> wrenches);

/// What a device does to small motions about rest, hinge space x hinge space, symmetric. Rows of given motions are there as well.
struct DeviceStiffness {
  int device = 0;        // index into Devices::all
  Eigen::MatrixXd K, C;  // second derivatives of the energy that it stores, with what its preload adds, and of half the power that it loses
  Eigen::VectorXd push;  // hinge space: what it pushes with at rest
  Eigen::MatrixXd size;  // sum of |what K would be if one of its mounts alone moved|: what is small beside it is rounding
  bool is_stiff() const { return ((K.cwiseAbs() - kNothing * size).array() > 0.0).any(); }
  static constexpr double kNothing = 1e-10;
};
/// Of those that have any, at the q of the tree and at their marks and inputs. O(N) for each component and device.
std::vector<DeviceStiffness> stiffness_of_devices(const TreeOperators& tree, const DeviceForces& devices);
/// Whether a device can have any: it has no states of its own, declares its energy and reads the place of all that it pushes at.
bool may_be_stiff(const Device& device);

}  // namespace cardan::operators
