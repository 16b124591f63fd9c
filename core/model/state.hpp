#pragma once
#include <Eigen/Core>
#include <cstdint>

namespace cardan {

/// A value: copy = snapshot, compare = test, write = restart file. Orders are the user's: q body by body [q_hinge; eta],
/// v body by body [v_hinge; eta'].
struct State {
  double t = 0.0;  // [s] since the epoch of the scenario
  Eigen::VectorXd q, v;
  std::uint64_t modes = 0;  // discrete state, changed by events only
};

}  // namespace cardan
