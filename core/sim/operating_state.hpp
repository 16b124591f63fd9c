#pragma once
// What analyses of dynamics read of a run beside q, kept: the state of a simulation at one instant.
#include <Eigen/Core>
#include <memory>
#include <vector>

#include "core/dynamics/inverse.hpp"
#include "core/operators/operating_point.hpp"

namespace cardan {

class Simulation;

/// Velocities and forces in the order of the model.
struct OperatingState {
  double t = 0.0;                                         // [s]
  Eigen::VectorXd v, tau;                                 // tau: of actuators and devices
  Eigen::VectorXd vdot;                                   // of given motions
  std::vector<NodeWrench> wrenches;                       // those of devices first
  std::shared_ptr<const Model> model = nullptr;           // that of the devices
  std::shared_ptr<const DeviceForces> devices = nullptr;  // null where there are none
  std::shared_ptr<const FieldMoment> moment = nullptr;    // of gravity that is a field
  std::vector<LoopDrive> drives = {};                     // of prescribed loops
  std::uint64_t seed = 0;                                 // of the run
  Inputs inputs(const double* q) const {
    return {.q = q,
            .v = v.data(),
            .tau = tau.data(),
            .vdot = vdot.data(),
            .wrenches = wrenches,
            .moment = moment.get(),
            .drives = drives.empty() ? nullptr : drives.data()};
  }
  operators::OperatingPoint point(const double* q) const {
    return {.t = t,
            .q = q,
            .v = v.data(),
            .tau = tau.data(),
            .vdot = vdot.data(),
            .wrenches = wrenches,
            .devices = devices.get(),
            .moment = moment.get(),
            .drives = drives.empty() ? nullptr : drives.data()};
  }
};

/// As the simulation stands; errors as of Simulation::vdot().
OperatingState operating_state(Simulation&);

}  // namespace cardan
