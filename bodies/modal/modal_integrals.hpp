#pragma once
// Inertia invariants of a body from masses that move with its modes (docs/mathematics/modes.md, section 3).
#include <Eigen/Core>
#include <vector>

#include "core/linalg/sparse_factor.hpp"
#include "core/spatial/modal_data.hpp"

namespace cardan {

/// n mass points and their m mode shapes, body axes; row = point, column = mode. A consistent-mass finite-element model
/// is such a set as well: its points are the integration points of its mass matrix, its shapes the interpolated modes
/// there.
struct MassField {
  Eigen::VectorXd mass;                  // n [kg]
  Eigen::Matrix3Xd position;             // 3 x n [m]
  std::vector<Eigen::Matrix3d> inertia;  // n [kg m^2] about the point; empty: none
  Eigen::MatrixXd Phi[3], Psi[3];        // n x m each: x, y, z of translation and rotation; Psi unused without inertia
  SparseMatrix between = {};             // n x n [kg] of m_ij x_i' x_j' for m_i x_i'^2, with row sums `mass`; empty: each point has its own
};

/// I1 ... I9 and the first-order rotary terms, as exact sums over the points.
ModalIntegrals modal_integrals(const MassField& field);

/// Where masses are known by their sums alone, as those of component modes are: I5 and I8 become zero, the rest of what is not of the body
/// at rest goes, and ModalIntegrals::of_change says so.
void forget_changes(ModalIntegrals& integrals);

/// Of modes that an eigenvalue solver gave: what their rounding leaves between modes that do not couple becomes zero: a body
/// of few couplings is computed with these alone.
void forget_rounding(ModalIntegrals& integrals);

}  // namespace cardan
