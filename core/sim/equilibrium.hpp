#pragma once
// Where what hinges and modes carry stays at rest: a boom that sags, a panel that a spin pulls out, a mechanism on its springs. Newton's
// method on forward dynamics with its exact derivatives, and where it finds none a descent (docs/mathematics/linear.md, 4).
#include <Eigen/Core>
#include <string>
#include <vector>

namespace cardan {

class Simulation;

struct EquilibriumOptions {
  std::vector<int> move = {};  // velocity components that may move, of free hinges and modes; one at least
  int iterations = 50;         // at most, of Newton's method, and then of the descent
  double tolerance = 1e-12;    // of the last step, relative to 1 rad, 1 m, 1 of a mode, or to how far it went in all if that is more
  double step = 1.0;           // [rad] largest turn of a component in one iteration
};

struct Equilibrium {
  bool reached = false;
  bool statically_stable = false;  // reached, and no small move drives itself on: else only what spins may hold it
  Eigen::VectorXd q, v;            // nq, nv: the posture, at rest in all that may move; or the nearest that was found
  double residual = 0.0;           // the largest acceleration that is left of what may move [rad/s^2, m/s^2]
  int iterations = 0;
  std::string message;  // "in equilibrium after 4 iterations: ...", "not in equilibrium: ..."
};

/// From the state of `sim`, which stays as it is: the posture near it, or down from it, in which what may move has no acceleration while it
/// is at rest. All else keeps coordinates and rates of now, and may accelerate: a vehicle that spins or is pushed bends as it does in a
/// steady spin or push. Forces, loads and commands are those of now; springs, gravity, fields and devices follow the posture. Closed loops
/// stay closed. Whether damping and what spins leave it stable the poles of linearize() tell there. That nothing is found is a result, not
/// an exception. InputError C0301 for an index that there is not; C0401 for a component whose motion is given, where loops leave nothing
/// free to move, and where they turn with what keeps its rate; NumericsError where the accelerations at the start cannot be found, and at a
/// singular posture.
Equilibrium find_equilibrium(Simulation& sim, const EquilibriumOptions& options);

}  // namespace cardan
