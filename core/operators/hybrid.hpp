#pragma once
// Hybrid dynamics (Jain & Rodriguez 1993; mathematics 5): of some velocity components the force is known, of the others the
// acceleration; and the motion of what carries no actuator, a free-floating base for one. Which is which: the mask of
// TreeOperators::articulate({.free = mask}), any mix, inside one hinge and among modes. Hinge space, user's order of v.
#include "core/dynamics/forward.hpp"
#include "core/operators/operational_space.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// What is known of a velocity component.
enum class Drive : std::uint8_t {
  forced,      ///< its force tau
  passive,     ///< its force, 0: no actuator; a hinge with a spring or damper is `forced`, by these
  prescribed,  ///< its acceleration v'
  locked       ///< its acceleration, 0; it must stand still
};
/// 1 for forced and passive: the mask for articulate().
std::vector<std::uint8_t> free_mask(std::span<const Drive> drives);

/// tau = M v' + bias, all components.
struct Hybrid {
  Eigen::VectorXd vdot;  // solved for where free, as given elsewhere
  Eigen::VectorXd tau;   // as given where free, what the motion needs elsewhere
};

/// Of the free components tau is read, of the others v'. bias: the forces at v' = 0 (bias() or any other). O(N): the sweeps of
/// forward dynamics by blocks. Needs Inertia. W of articulate() counts for the free ones.
Hybrid hybrid_dynamics(const TreeOperators& tree, const Eigen::VectorXd& bias, const Eigen::VectorXd& tau, const Eigen::VectorXd& vdot);

/// The same by the kind of drive, with bias(): tau of passive and v' of locked components count as 0 whatever is given. Error C0301 where a
/// locked component moves (in.v), C0902 where the drives do not match the mask of the tree.
Hybrid hybrid_dynamics(const TreeOperators& tree, std::span<const Drive> drives, Workspace& workspace, const Inputs& in,
                       const Eigen::VectorXd& tau, const Eigen::VectorXd& vdot);

// By the sweeps of inverse dynamics over the bodies that take part, O(N). in: v, vdot (nv numbers of the model, null: 0), wrenches,
// gravity; those of bodies that take no part are not read, and what is inboard of a subgraph stands still. q is that of the tree; the
// workspace: of the model. Hinge springs are no part of it.

/// M v' + C - gravity - elastic - external.
Eigen::VectorXd inverse_dynamics(const TreeOperators& tree, Workspace& workspace, const Inputs& in);
/// The same at v' = 0.
Eigen::VectorXd bias(const TreeOperators& tree, Workspace& workspace, const Inputs& in);
/// f = phi (M alpha + b - f_ext), body space: the wrench [moment; force] that the hinge transmits to each body, at the origin and in the
/// axes of its frame, and the modal rows, which hold the elastic forces K eta + C eta'. tau = H f. alpha: accelerations less gravity.
Eigen::VectorXd interbody_forces(const TreeOperators& tree, Workspace& workspace, const Inputs& in);

/// A system of which some components p carry no actuator, or are determined by momentum; the others are a. The tree must be
/// articulated with free = p. All by operators, O(N) per product.
///
/// The generalised momenta of p are p_p = M_pp v_p + M_pa v_a, so v_p = M_pp^-1 (p_p - M_pa v_a). A free-floating base
/// (Umetani & Yoshida 1989; mathematics 5.3): p = the hinge components of the roots, one or several, rigid or flexible; the modes
/// of a flexible base are among a. p_p of a single root of six degrees is the system's momentum seen from the base.
class Unactuated {
 public:
  /// Needs Inertia.
  explicit Unactuated(const TreeOperators& tree);

  /// All velocities for those of a (entries of v at a) and momenta p_p (entries of `momenta` at p; empty: zero).
  Eigen::VectorXd velocities(const Eigen::VectorXd& v, const Eigen::VectorXd& momenta = {}) const;
  /// Their adjoint: forces on a that do the work of tau at zero momenta, tau_a - M_ap M_pp^-1 tau_p; zero on p.
  Eigen::VectorXd reduced_forces(const Eigen::VectorXd& tau) const;
  /// Velocities of the task, J v = J_g v_a + J_p M_pp^-1 p_p.
  Eigen::VectorXd task_rates(const Task& task, const Eigen::VectorXd& v, const Eigen::VectorXd& momenta = {}) const;
  /// J_g = J_a - J_p M_pp^-1 M_pa, r x nv, columns of p zero. O(N) per row.
  Eigen::MatrixXd generalised_jacobian(const Task& task) const;
  /// (M_aa - M_ap M_pp^-1 M_pa) v_a: the mass matrix that the actuators feel; zero on p. det = det M / det M_pp.
  Eigen::VectorXd reduced_mass_times(const Eigen::VectorXd& v) const;
  /// -M_pp^-1 M_pa, nv x nv, rows of p and columns of a alone: accelerations of p per acceleration of a (system at rest).
  Eigen::MatrixXd coupling() const;
  /// log det M_pp.
  double log_det() const { return tree_->log_det(); }

 private:
  Eigen::VectorXd of_actuated(const Eigen::VectorXd& x) const;
  const TreeOperators* tree_;
};

/// 1 for the hinge components, not the modes, of the roots of the tree: the mask of a free-floating base.
std::vector<std::uint8_t> base_mask(const TreeOperators& tree);
/// p_p of a system with one root of six degrees for its momentum [angular about the world's origin; linear], world axes; hinge
/// space, zero but for the root. Error C0401 for another base.
Eigen::VectorXd base_momenta(const TreeOperators& tree, const Eigen::Matrix<double, 6, 1>& momentum);

}  // namespace cardan::operators
