#pragma once
// What becomes of the mass matrix where loops are closed (docs/mathematics/linear.md, 2). A closed vehicle moves as its open tree does
// along v = X v_I; with Y = X S^-*, S S* = X* M X,
//
//   Y* M Y = 1,   Y Y* = M^-1 - M^-1 G* (G M^-1 G*)^+ G M^-1 = M_c^-1:
//
// the accelerations of the closed system under hinge forces. No multiplier is in it, redundant rows do not matter, and what is light
// behind gears keeps its digits.
#include "core/dynamics/loops.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// Y of an open tree and the X of its loops (LoopFreedom::X): hinge space x what neither loops nor given motions hold.
Eigen::MatrixXd free_motions(const TreeOperators& tree, const Eigen::MatrixXd& X);

/// A vehicle at one q, which closes its loops (without loops: X = 1). Vectors are of the hinge space of its open tree. O(N) for each column
/// of Y. `drives`: lengths of loops that are functions of time. NumericsError where a motion that is free has no inertia.
class ClosedSystem {
 public:
  ClosedSystem(std::shared_ptr<const Model> closed, const double* q, const LoopDrive* drives = nullptr);

  const TreeOperators& tree() const { return tree_; }
  const LoopFreedom& freedom() const { return freedom_; }
  const Eigen::MatrixXd& motions() const { return Y_; }  ///< Y
  int mobility() const { return static_cast<int>(Y_.cols()); }
  /// M_c^-1 tau: accelerations of the system at rest under hinge forces alone; zero where motion is given.
  Eigen::VectorXd respond(const Eigen::VectorXd& tau) const;

  /// log det X* M X of the independent components that are free; SI units of theirs.
  double log_det() const;
  /// Its derivative along each of them [1/rad, 1/m], `mobility` numbers, those that depend on it following. O(N) for each pair.
  Eigen::VectorXd log_det_gradient() const;

  // Diagonalised velocities [J^1/2], `mobility` numbers, of motions v = Y nu (Jain and Rodriguez 1995, of open trees; here dense, S of
  // X* M X): T = 1/2 nu* nu where no motion is given. InputError C0902 for another number of components.
  Eigen::VectorXd nu(const Eigen::VectorXd& v) const;         ///< S* v_I = Y* M v
  Eigen::VectorXd velocity(const Eigen::VectorXd& nu) const;  ///< v = Y nu
  Eigen::VectorXd eps(const Eigen::VectorXd& tau) const;      ///< Y* tau [J^1/2/s]
  /// C of nu' + C = eps with v = Y nu: velocity terms alone, lengths of loops standing; nu* C = 0.
  Eigen::VectorXd coriolis(const Eigen::VectorXd& nu) const;

 private:
  /// S^-1 (X* M X)' S^-* along each of these motions, hinge space.
  std::vector<Eigen::MatrixXd> inertia_rates(const Eigen::MatrixXd& along) const;

  std::shared_ptr<const Model> model_;
  std::vector<LoopDrive> drives_;
  LoopFreedom freedom_;
  TreeOperators tree_;
  Eigen::MatrixXd X_, Y_;  // of what is free, a motion a column
};

struct ClosedForces {
  Eigen::VectorXd tau;      // nv; zero on components without actuator
  Eigen::VectorXd missing;  // nv; on independent components [N m; N] what actuators cannot give: zero where they suffice
};
/// Forces of actuators with which a vehicle moves with vdot (nv; of independent components, LoopFreedom, the others follow) under all else
/// in `in`: loads and devices in in.tau and in.wrenches, springs of hinges beside them, given accelerations. `actuated`: per component. Of
/// all that do it those of smallest tau* diag(M)^-1 tau. InputError C0902 for another number of components; NumericsError as forward
/// dynamics.
ClosedForces closed_inverse_dynamics(const std::shared_ptr<const Model>& closed, const Inputs& in, const Eigen::VectorXd& vdot,
                                     std::span<const std::uint8_t> actuated);

}  // namespace cardan::operators
