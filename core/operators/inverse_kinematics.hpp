#pragma once
// The configuration in which nodes stand where they should: any set of targets on any tree, damped least squares with the Jacobian
// J = B* phi* H* applied as operators (mathematics 12). q moves in the tangent space (Model::retract), so quaternions stay unit. Where
// loops are closed it moves as they allow (docs/mathematics/linear.md, 3).
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// A node and where it should be. Error rows [rotation; position] in target axes: log(R_now* R_target), R_target* (x_target - x_now).
struct IkTarget {
  int node = 0;                                                  // index into Model::nodes
  Eigen::Vector3d position = Eigen::Vector3d::Zero();            // [m] world axes
  Eigen::Matrix3d R_WN = Eigen::Matrix3d::Identity();            // node axes to world axes
  std::array<bool, 6> rows{true, true, true, true, true, true};  // which rows count; {1, 1, 0, ...}: any turn about the target's z
  double rotation_weight = 1.0, position_weight = 1.0;           // [1/rad], [1/m]

  static IkTarget at_position(int node, const Eigen::Vector3d& x);
  static IkTarget at_attitude(int node, const Eigen::Matrix3d& R_WN);
  static IkTarget at_pose(int node, const Eigen::Vector3d& x, const Eigen::Matrix3d& R_WN);
};

/// lower <= coordinate <= upper, of a hinge component whose q' is v.
struct IkLimit {
  int v = 0;  // velocity component, user's order
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
};

struct IkOptions {
  std::vector<IkLimit> limits = {};
  std::vector<int> free = {};   // velocity components that may move; empty: those of all hinges, no mode
  Eigen::VectorXd weight = {};  // nv, W of |dv|_W^2: what is heavy moves little; empty: 1
  bool dynamic = false;         // W = mass matrix instead
  Eigen::VectorXd prefer = {};  // nq: among the solutions, the one near this posture; empty: none
  double tolerance = 1e-12;     // of the weighted residual, times max(1, |x_target|)
  int iterations = 200;         // at most, per start
  int starts = 8;               // the given q, then random ones; of closed loops such as it can move to
  std::uint64_t seed = 1;
  double step = 1.0;                  // [rad] largest turn of a component in one iteration
  const LoopDrive* drives = nullptr;  // lengths of loops that are functions of time, Loops::n_drives; null: as at the start
};

struct IkResult {
  bool reached = false;
  Eigen::VectorXd q;                               // nq: the solution, or the nearest posture found
  double residual = 0.0;                           // weighted norm of all rows that count
  Eigen::Matrix<double, 6, Eigen::Dynamic> error;  // per target [rad; m], target axes; 0 where a row does not count
  std::vector<int> at_limit;                       // velocity components that stand at a limit
  bool stationary = false;                         // not reached, and no small move comes nearer
  int iterations = 0, starts = 0;                  // spent, all starts together
  std::uint64_t seed = 0;
  double null_space_step = 0.0;  // what is left to move towards `prefer` within the solutions
  std::string message;           // "reached in ...", "cannot be reached: residual ..., nearest ..."
};

/// From q (nq numbers). The residual is what decides: a target out of reach is a result, not an exception. InputError for
/// unknown nodes (C0202), limits that exclude each other or stand on a quaternion, vectors of the wrong size. Closed loops stay closed, in
/// the assembly in which q has them; a q that has not is moved to the nearest that does. InputError C1103 where there is none.
IkResult inverse_kinematics(const std::shared_ptr<const Model>& model, const double* q, std::span<const IkTarget> targets,
                            const IkOptions& options = {});
/// From the q of a tree (without loops: that of a closed vehicle is its open one). Only what takes part and is free in it moves, on what
/// stays where it is; `dynamic` is the mass matrix of the bodies that take part. Targets on, limits and free components of other bodies are
/// errors (C0202, C0401).
IkResult inverse_kinematics(const TreeOperators& tree, std::span<const IkTarget> targets, const IkOptions& options = {});

}  // namespace cardan::operators
