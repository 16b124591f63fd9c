#pragma once
// The linear model x' = A x + B u, y = C x + D u about any state of a system, exact to round-off: its columns are directional
// derivatives of forward dynamics by sweeps on Tangent numbers, O(N) each (mathematics 8.4).
//
// x = [dtheta; dv; dz]: dtheta the deviation of the configuration in the tangent space (q = retract(q_0, dtheta), nv numbers), dv that of
// the velocities, dz that of the states of devices. u and y are deviations too. Beside a moving state the model holds along the motion, at
// this instant. Springs, dampers, gravity, devices, loads held in node or world axes, and given motions are inside. Of a vehicle with
// closed loops dtheta and dv are those of its independent components (LoopFreedom); the others follow, and may be outputs.
#include <string>
#include <vector>

#include "core/operators/operating_point.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// Inputs and outputs by name. A name may stand for several; .x, .y, .z behind a node's quantity is one of three. Components of
/// inputs are named as in components.hpp.
///
///   input     "wing.angle", "wing.rate"   force on that component of a hinge [N m | N]; of a given motion its acceleration
///             "wing"                      all components of the hinge
///             "wing.eta_2"                force on a mode [J]
///             "bus.tip:force", ":torque"  on a node, node axes [N], [N m]
///             "wheel:torque"              an input of a device that is not connected
///   output    "wing.angle", "wing.rate", "wing.eta_2", "wing.etadot_2"    a state
///             "wing"                      all states of the hinge and its body's modes
///             "bus.tip:position", ":velocity", ":acceleration"            world axes [m], ...; a body's own name is its origin
///             "bus.tip:attitude"          small rotation of the node, node axes [rad]
///             "bus.tip:rate", ":specific_force"                           node axes; what a gyro and an accelerometer read
///             "wheel:rate"                an output of a device, "wheel.momentum" one of its states
///             "momentum:linear", "momentum:angular"                       of the system, about the world's origin, world axes
struct LinearPorts {
  std::vector<std::string> inputs, outputs;  // inputs empty: all hinge components; outputs empty: all states
};

struct LinearModel {
  std::string system;
  double t = 0.0;              // [s]
  Eigen::MatrixXd A, B, C, D;  // n x n, n x nu, ny x n, ny x nu; n = 2 nv (closed loops: 2 mobility) + device states
  Eigen::VectorXd drift;       // n: [v; v'; z'] at the point; zero in equilibrium
  Eigen::VectorXd u0, y0;      // inputs and outputs there (0 for components with no coordinate of their own)
  SpaceLabels states, inputs, outputs;
};

class Sensitivities;

/// InputError C0208 for an unknown name, C0401 where the model was compiled without loads on nodes; NumericsError at a direction
/// without inertia. O(N) for each of 2 nv + nu directions; with loops twice that, for each of 2 mobility + nu.
LinearModel linearize(const Model& model, const OperatingPoint& at, const LinearPorts& ports = {});
/// The same of the model of `about`, with the memory that it has: for one point after the other. It has another point afterwards.
LinearModel linearize(Sensitivities& about, const OperatingPoint& at, const LinearPorts& ports = {});
/// The same of the bodies that take part in `tree`, at its q (at.q is not read; the rest of `at` is the model's): states, inputs and
/// outputs are theirs, momentum is that of them together, a name of another is C0208. What is not free in the tree is a given motion too (a
/// diagonal W of it plays no part). Needs Position; loads on nodes whatever the model was compiled for.
LinearModel linearize(const TreeOperators& tree, const OperatingPoint& at, const LinearPorts& ports = {});

/// Derivatives of v' of a vehicle with closed loops, of all its components: nv numbers in the order of v. Each column of q and v moves an
/// independent component by 1 and those that depend on it as the loops want (X of LoopFreedom); with q the rates of dependent ones
/// follow too, the others stand. Forces, loads and commands of devices are held.
struct ClosedDerivatives {
  std::vector<int> independent;  // of the columns of q and v
  Eigen::VectorXd vdot;
  Eigen::MatrixXd q, v;  // nv x independent components
  Eigen::MatrixXd tau;   // nv x nv: M_c^-1, zero where motion is given
};
/// As linearize(). In parameters of bodies: -ClosedSystem::respond() of what Sensitivities of the open tree has, at this v'.
ClosedDerivatives closed_derivatives(const Model& model, const OperatingPoint& at);

}  // namespace cardan::operators
