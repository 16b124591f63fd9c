#pragma once
// log det of the mass matrix and its gradient, the Fixman potential (mathematics/log_det.md): O(N) both.
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

/// d log det M along each component of the hinge space (q moves by N(q) e_i), of the free components' M when some are given.
/// Whole trees and subgraphs. Needs Inertia and OperationalSpace; leaves the tree as it is. log det itself: TreeOperators::log_det().
///
/// Y is the adjoint of the Riccati recursion, so each component needs the derivatives of its own body's blocks only, and of those of the
/// bodies that hang on its modes. One component of every hinge is moved at once, and one mode of every body of even depth, of odd
/// depth: log_det_passes() passes of O(N), however many bodies there are.
Eigen::VectorXd log_det_gradient(const TreeOperators& tree);
/// At most 6 + 2 (most modes of a body).
int log_det_passes(const TreeOperators& tree);

}  // namespace cardan::operators
