#pragma once
// What holds hinge components that devices hold (CARDAN_USE_HOLD), at states that are tried: with a workspace of its own, so that nothing
// of the evaluation before is lost.
#include <vector>

#include "core/dynamics/devices.hpp"
#include "core/dynamics/observe.hpp"

namespace cardan {

class Holding {
 public:
  /// `own`: the same model, which has the masses of the state that was looked at last.
  Holding(const Model& model, Model* own);

  struct Force {
    double force = 0.0, most = 0.0;  // [N m, N] that holds, and the most that can; of what is not held both 0
    bool held = false;
  };
  /// Of each of Devices::holds. in.tau: of actuators and hinge loads; in.wrenches: with room for those of devices. false: v' cannot be
  /// evaluated there.
  bool look(const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks);
  const std::vector<Force>& forces() const { return forces_; }

 private:
  const Model& model_;
  Workspace workspace_;
  Observer observer_;
  DeviceForces devices_;
  std::vector<double> tau_, needed_, vdot_;
  std::vector<NodeWrench> wrenches_;
  std::vector<Force> forces_;
};

}  // namespace cardan
