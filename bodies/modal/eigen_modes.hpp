#pragma once
// Modes of a finite-element model (docs/mathematics/modes.md, section 2).
#include <Eigen/Core>
#include <vector>

#include "bodies/modal/fe_model.hpp"
#include "core/base/diagnostic.hpp"

namespace cardan {

/// Mass-normalised modes over all dofs, zero at the held ones: shapes* M shapes = 1, shapes* K shapes = diag(omega2).
struct FeModes {
  Eigen::VectorXd omega2;  // m [rad^2/s^2] ascending
  Eigen::MatrixXd shapes;  // 6 n x m
  // Of normal_modes(): the next ones, found on the way and not checked (0 to 4).
  Eigen::VectorXd next_omega2 = {};
  Eigen::MatrixXd next_shapes = {};
};

enum class RigidModes { refuse, remove };

/// The `count` lowest modes with the dofs in `held` at rest. Rigid motions that `held` leaves free are an error
/// (C0322), or are removed: the modes are then M-orthogonal to them, to rounding. C0323 when the model is a mechanism,
/// carries too little mass for `count` modes or cannot be solved.
FeModes normal_modes(const FeModel&, const std::vector<int>& held, int count, RigidModes, const Located& at);

/// Craig and Bampton (1968): `count` lowest modes with `held` and `interface` at rest, and one static mode for each column
/// of `unit` (zero but at `interface`), the two sets then orthogonalised into count + unit.cols() modes. Of count 0 the static
/// condensation of Guyan (1965) is left.
FeModes craig_bampton(const FeModel&, const std::vector<int>& held, const std::vector<int>& interface, const Eigen::MatrixXd& unit,
                      int count, const Located& at);

/// The dofs of each node.
std::vector<int> dofs_of(const std::vector<int>& nodes, int per_node = 6);

/// Rows and columns of A that are not in `left_out`, with the list of them.
struct FreePart {
  FreePart(int n, const std::vector<int>& left_out);
  std::vector<int> dofs;                                   // ascending
  SparseMatrix block(const SparseMatrix& A) const;         // free x free
  Eigen::MatrixXd expand(const Eigen::MatrixXd& x) const;  // zero rows at what was left out
  int n;
};

}  // namespace cardan
