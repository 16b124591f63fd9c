#pragma once
// What is looked at between steps: nodes, energy, momentum, reactions; and the rates of the ledger, which is all of it that
// runs inside a right-hand side.
#include <Eigen/Core>

#include "core/dynamics/forward.hpp"

namespace cardan {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A node in the world.
struct NodeState {
  Eigen::Matrix3d R_WN;            // node axes to world axes
  Eigen::Vector3d position;        // [m] world axes
  Vector6d velocity;               // [angular; linear] node axes
  Vector6d acceleration;           // true inertial acceleration of the point, [angular; classical linear], node axes
  Eigen::Vector3d specific_force;  // [m/s^2] what an ideal accelerometer at the node reads, node axes
};

struct Energy {
  double kinetic = 0.0, gravity = 0.0, modal = 0.0, springs = 0.0;  // [J]
  double devices = 0.0;                                             // [J] which Simulation::energy() knows
  double total() const { return kinetic + gravity + modal + springs + devices; }
  double magnitude = 0.0;  // [J] sum of the magnitudes over bodies
};

struct Momentum {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();        // [N s] world axes
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();       // [N m s] about the world origin, world axes
  Eigen::Vector3d com = Eigen::Vector3d::Zero();           // [m] mass centre, world axes
  double mass = 0.0;                                       // [kg]
  double linear_magnitude = 0.0, angular_magnitude = 0.0;  // sums of the magnitudes over bodies
  double angular_parts = 0.0;  // [N m s] the same, place times momentum and what is about the body's own origin each by itself
};

/// Forces on the system from outside and the power they bring in, for the ledgers of momentum and energy.
struct ExternalLoads {
  Eigen::Vector3d force = Eigen::Vector3d::Zero();   // [N] world axes
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();  // [N m] about the world origin
  double power = 0.0;                                // [W] of actuators, wrenches, prescribed motion, dampers
};

/// Reads a workspace in which forward_dynamics(in) has just run. Keeps scratch, so make one and use it again.
class Observer {
 public:
  Observer(const Model& model, Workspace& workspace);

  /// Where hinge loads were found to be, in the order of Model::loads, if that is not q (null): read anew at each state.
  void loads_at(const double* coordinates) { loads_at_ = coordinates; }

  /// To be called first for each state: poses, velocities, inertias. vdot may be null (no accelerations then).
  void update(const Inputs& in, const double* vdot);

  NodeState node(int index) const;
  Pose<double> body_pose(int user_body) const;  ///< user's body frame in the world
  Energy energy() const;
  Momentum momentum() const;
  /// [kg m^2] Of all bodies about a point, world axes, as if their hinges and modes were locked; rotors as if they did not resist their own
  /// turn.
  Eigen::Matrix3d locked_inertia(const Eigen::Vector3d& about) const;
  /// Of a rotor, by its sweep body: world axes, unit length.
  Eigen::Vector3d axis_in_world(int rotor) const;
  /// Wrench [moment; force] that the inboard hinge transmits to the body at P, P axes; also inside merged bodies.
  Force<double> hinge_wrench(int user_body) const;
  /// Force of each prescribed velocity component (tau that its motion needs beside couplings), zero for the others; nv numbers.
  void prescribed_forces(double* tau) const;
  // The rates of the ledger, in a right-hand side: need no update().
  ExternalLoads external(const Inputs& in, const double* vdot);
  /// As prescribed_forces(), likewise.
  void prescribed_forces(const Inputs& in, const double* vdot, double* tau);
  /// Power of actuators, prescribed motion and dampers alone.
  double internal_power(const Inputs& in, const double* vdot);

 private:
  void look(const Inputs& in, const double* vdot);
  double actuator_power() const;
  Force<double> wrench_on_sweep_body(int k) const;  // of the inboard hinge, at B
  Force<double> wrench_in_host(int user_body) const;
  RigidInertia<double> inertia_for_gravity(int k) const;
  void complete_rotor(int k);
  void weigh();
  Vec3<double> first_moment();
  const Model& model_;
  Workspace& ws_;
  Inputs in_;
  const double *vdot_ = nullptr, *loads_at_ = nullptr;
  std::vector<NodeWrench> loads_;                 // wrenches of the inputs and of closed loops
  std::vector<RigidInertia<double>> inertia_;     // rigid part of M_fl per sweep body
  std::vector<std::vector<double>> M_re_, M_ee_;  // flexible bodies
  std::unique_ptr<Workspace> inverse_;            // for prescribed_forces, only where modes are prescribed
  mutable std::vector<double> all_tau_, prescribed_tau_;
  std::vector<double> mass_;          // [kg] of a sweep body and all outboard of it
  bool poses_given_ = false;          // forward dynamics leaves poses in the world
  std::vector<double> gravity_work_;  // of a flexible body, for the work of gravity on its modes
  std::vector<Vec3<double>> moment_;  // scratch of first_moment()
};

}  // namespace cardan
