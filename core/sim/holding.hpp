#pragma once
// What holds hinge components that devices hold (CARDAN_USE_HOLD), at states that are tried: with a workspace of its own, so that nothing
// of the evaluation before is lost (docs/mathematics/devices.md, 6).
#include <memory>
#include <span>
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
    int leaves = 0;             // 1, -1: no force would hold it; it begins to move so
    double acceleration = 0.0;  // [rad/s^2, m/s^2] of what is not held; 0 where it is rounding
  };
  /// Of each of Devices::holds. in.tau: of actuators and hinge loads; in.wrenches: with room for those of devices. false: v' cannot be
  /// evaluated there.
  bool look(const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks);
  const std::vector<Force>& forces() const { return forces_; }
  /// Closed loops leave a component no way to move because others are held: not at a dead centre, where it has none whatever is held.
  bool is_blocked_by_others(std::size_t hold, const double* q, const LoopDrive* drives);

 private:
  /// Closed loops leave it no way to move: v' of a unit force on it, at rest, is nothing.
  bool is_blocked(std::size_t hold, const double* q, const LoopDrive* drives);
  /// Of rates or accelerations, in the turns of in_turns_.
  double largest(std::span<const double> x) const;
  /// v' with all that acts at the state. false: it cannot be evaluated.
  bool accelerate();
  /// v' at other rates, with given ones and lengths of loops that begin to move at `pace`; nothing acts, and the modes are held as they
  /// are.
  bool accelerate_alone(const double* v, double force_on, int component, double pace);
  /// Where closed loops move a component whatever holds it: Force::leaves.
  void find_dead_centres();
  int way_out(std::size_t hold);
  /// Loops leave less free than is held: what holds is not unique.
  void share();

  const Model& model_;
  Model* own_;
  Workspace workspace_;
  Observer observer_;
  DeviceForces devices_;
  std::unique_ptr<FieldMoments> fields_;  // of gravity that is a field; null: it is none
  Inputs use_;                            // of the state that is looked at
  std::vector<double> tau_, needed_, vdot_, zero_, given_, probe_;
  std::vector<std::uint8_t> held_;  // Model::prescribed while others are let go
  std::vector<double> in_turns_;    // per rate: the turn [rad/s] of the lightest that loops turn which has the energy of one of it
  std::vector<LoopDrive> lengths_;
  std::vector<NodeWrench> wrenches_;
  std::vector<Force> forces_;
};

}  // namespace cardan
