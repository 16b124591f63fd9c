#pragma once
// Operational space of nodes (Khatib 1987; Kreutz-Delgado, Jain & Rodriguez 1992; Jain 2011; mathematics 6): what force on nodes
// does to the motion of nodes, through the whole tree. Everything is about the components that are free (TreeOperators::articulate).
#include "core/dynamics/forward.hpp"
#include "core/operators/closed_system.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// Lambda^-1 = J M^-1 J* = B* Omega B of s nodes (indices into Model::nodes; any, of any bodies, repeated ones too), 6s x 6s,
/// symmetric: [rad/s^2; m/s^2] per [N m; N], node axes. Accelerations of the nodes under wrenches on them, system at rest. Without
/// M and J: Y, and psi walked from each node to the nearest common ancestors; O(n + s d + s^2), d = length of the path to the base.
/// Needs OperationalSpace.
Eigen::MatrixXd compliance(const TreeOperators& tree, std::span<const int> nodes);
/// Block (a, b) of Omega, bodies by index into tree.bodies(), (6 + m_a) x (6 + m_b), body frames.
Eigen::MatrixXd omega_block(const TreeOperators& tree, int a, int b);

/// Rates of a task, xdot = T [velocities of nodes, 6s, node axes], r numbers. T chooses rows, combines nodes (the motion of one
/// relative to another) or is empty: all 6s rows. It is constant: accelerations are T [classical accelerations, node axes].
struct Task {
  std::vector<int> nodes;  // indices into Model::nodes
  Eigen::MatrixXd T;       // r x 6s, or empty
  /// These of the 6s rows.
  static Task of_rows(std::vector<int> nodes, std::span<const int> rows);
  int rows() const { return static_cast<int>(T.size() > 0 ? T.rows() : 6 * static_cast<Eigen::Index>(nodes.size())); }
};

/// xdot = J v, r; J = T B* phi* H*, all components of v. O(n).
Eigen::VectorXd task_rates(const TreeOperators& tree, const Task& task, const Eigen::VectorXd& v);
/// J* F, hinge space, all components: the generalised force of the task force F. O(n).
Eigen::VectorXd task_forces(const TreeOperators& tree, const Task& task, const Eigen::VectorXd& F);
/// J of the free components, r x nv (other columns zero), O(n) per row.
Eigen::MatrixXd task_jacobian(const TreeOperators& tree, const Task& task);

/// Jdot v, r: accelerations of the task at v' = 0 (classical, node axes; gravity plays no part), by one sweep base to tip, O(N). v: of the
/// hinge space; `workspace`: of the model.
Eigen::VectorXd task_bias(const TreeOperators& tree, const Task& task, Workspace& workspace, const Eigen::VectorXd& v);

/// The operational space inertia of a task, and what is controlled with it.
///
/// Without `passive`, forces act on all free components. With it (the same bodies, articulated with free = the components that
/// carry no actuator: the base of a free-flying arm, its wings) they act on the others alone, and J is the generalised Jacobian
/// J_g = J_a - J_p M_pp^-1 M_pa (Umetani & Yoshida 1989): J_g M_g^-1 J_g* = J M^-1 J* - J_p M_pp^-1 J_p*, of two trees and no more.
/// Both trees need OperationalSpace and must outlive this.
///
/// Where Lambda^-1 is singular (more rows than the system can move) Lambda is its generalised inverse in rows scaled to a unit
/// diagonal: the same whatever the units; eigenvalues below `tolerance` times the largest count as none. Then Lambda^-1 Lambda is
/// the projector on what can move, and J J# J = J.
class OperationalSpace {
 public:
  OperationalSpace(const TreeOperators& tree, Task task, const TreeOperators* passive = nullptr, double tolerance = 1e-12);
  /// Of a vehicle with closed loops, all of whose components have actuators: M_c^-1 in place of M^-1, Lambda^-1 = (J Y)(J Y)*. The loops
  /// allow what consistent_inverse() gives, and what null_motion() gives where they allow v. `closed` must outlive this.
  OperationalSpace(const ClosedSystem& closed, Task task, double tolerance = 1e-12);

  const Task& task() const { return task_; }
  const Eigen::MatrixXd& compliance() const { return compliance_; }  ///< Lambda^-1, r x r
  const Eigen::MatrixXd& inertia() const { return inertia_; }        ///< Lambda, r x r
  int rows() const { return static_cast<int>(compliance_.rows()); }
  int rank() const { return rank_; }               ///< < rows: Lambda is a generalised inverse
  double condition() const { return condition_; }  ///< largest over smallest eigenvalue that counts, rows scaled
  /// Error N0401 telling the rank where it is below the rows.
  void require_full_rank() const;

  Eigen::VectorXd rates(const Eigen::VectorXd& v) const;               ///< J v, r (J_g v with passive components)
  Eigen::VectorXd forces(const Eigen::VectorXd& F) const;              ///< J* F, hinge space
  Eigen::VectorXd consistent_inverse(const Eigen::VectorXd& x) const;  ///< J# x = M^-1 J* Lambda x, hinge space
  Eigen::VectorXd task_part(const Eigen::VectorXd& tau) const;         ///< J#* tau = Lambda J M^-1 tau, r: the task forces in tau
  Eigen::VectorXd null_motion(const Eigen::VectorXd& v) const;         ///< N v, N = 1 - J# J: motion that leaves the task alone
  Eigen::VectorXd null_forces(const Eigen::VectorXd& tau) const;       ///< N* tau: forces that do not accelerate the task
  /// F = Lambda (wanted - drift), r: accelerations of the task wanted, and without F (drift = J v' + Jdot v of the v' that happens
  /// without it).
  Eigen::VectorXd force_for(const Eigen::VectorXd& wanted, const Eigen::VectorXd& drift) const;
  /// tau = J* F + N* tau_0: task force and posture (Khatib 1987), hinge space.
  Eigen::VectorXd torque(const Eigen::VectorXd& F, const Eigen::VectorXd& tau_0) const { return forces(F) + null_forces(tau_0); }

 private:
  Eigen::VectorXd actuated(Eigen::VectorXd x) const;          // zero on passive components
  Eigen::VectorXd respond(const Eigen::VectorXd& tau) const;  // M^-1 tau, M_g^-1 tau, M_c^-1 tau
  void invert(double tolerance, const Eigen::VectorXd& rounding);
  const TreeOperators* tree_;
  const TreeOperators* passive_ = nullptr;
  const ClosedSystem* closed_ = nullptr;
  Task task_;
  Eigen::MatrixXd compliance_, inertia_;
  int rank_ = 0;
  double condition_ = 1.0;
};

/// 1 / (u* Lambda^-1 u) of a node: the inertia felt by a unit wrench u [moment; force] (node axes) along u, all else free, kg or
/// kg m^2; infinite where the node cannot move that way.
double effective_inertia(const TreeOperators& tree, int node, const Eigen::Matrix<double, 6, 1>& u);

/// How well a task can be moved (Yoshikawa 1985). Jacobians mix rad/s and m/s: compare postures, not machines.
struct Manipulability {
  Eigen::VectorXd singular_values;  // of J, descending, r or fewer
  double kinematic;                 // sqrt det(J J*): volume of the task rates of |v| <= 1, without the constant of the ball
  double dynamic;                   // sqrt det(J M^-1 J*): ... of kinetic energy <= 1/2; whatever the coordinates
};
Manipulability manipulability(const TreeOperators& tree, const Task& task);

/// How each component of v, a mode for one, takes part in the motion of a node along u (6, node axes):
struct Participation {
  Eigen::VectorXd shape;     // J* u: rate of the node along u per unit rate of the component
  Eigen::VectorXd response;  // M^-1 J* u: acceleration of the component under the wrench u on the node, system at rest
  Eigen::VectorXd share;     // shape x response / (u* Lambda^-1 u): part of the node's acceleration that comes by it; sum 1, any signs
};
Participation participation(const TreeOperators& tree, int node, const Eigen::Matrix<double, 6, 1>& u);

}  // namespace cardan::operators
