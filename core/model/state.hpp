#pragma once
#include <Eigen/Core>

namespace cardan {

/// A value: copy = snapshot, compare = test, write = restart file. Orders are the user's: q body by body [q_hinge; eta],
/// v body by body [v_hinge; eta'], z and marks device by device.
struct State {
  double t = 0.0;  // [s] since the epoch of the scenario
  Eigen::VectorXd q, v;
  Eigen::VectorXd z;      // continuous states of devices
  Eigen::VectorXd marks;  // what devices change at accepted instants only
};

}  // namespace cardan
