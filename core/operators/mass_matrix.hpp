#pragma once
// The mass matrix of a tree or subgraph, flexible bodies included, and its inverse: as products, by the composite body inertia
// (Lyapunov) and by blocks. All components of v count, free or not, but in mass_matrix_inverse(). Hinge space, user's order.
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// Error C0902 naming `what` where a vector has not the size of the space.
void require_size(const TreeOperators& tree, const char* what, Space space, Eigen::Index size);

/// V = phi* H* v, body space, O(N).
Eigen::VectorXd body_velocities(const TreeOperators& tree, const Eigen::VectorXd& v);
/// tau = H phi f of forces f in body space, O(N).
Eigen::VectorXd hinge_forces(const TreeOperators& tree, Eigen::VectorXd f);
/// (H phi M phi* H*) v: generalised momenta of velocities, forces of accelerations. O(N).
Eigen::VectorXd mass_times(const TreeOperators& tree, const Eigen::VectorXd& v);
/// Its inverse, of the free components, times tau: what these forces accelerate. O(N).
Eigen::VectorXd inverse_mass_times(const TreeOperators& tree, const Eigen::VectorXd& tau);

/// Composite body inertia R = M + E_phi R E_phi* (mathematics 4.3) per body of tree.bodies(), (6 + m) square, body frame B. O(N).
std::vector<Eigen::MatrixXd> composite_inertias(const TreeOperators& tree);
/// The mass matrix by R, O(N^2) at most: blocks along the paths to the base alone.
Eigen::MatrixXd mass_matrix(const TreeOperators& tree);

/// The inverse of the mass matrix of the free components (rows and columns of the others are zero) by its blocks (4.7), O(N^2),
/// without M. Needs OperationalSpace. With W in articulate(): of M + W.
Eigen::MatrixXd mass_matrix_inverse(const TreeOperators& tree);

}  // namespace cardan::operators
