#pragma once
#include <Eigen/Core>

namespace cardan {

/// p >= 0 with w = W p - b >= 0 and p w = 0, by principal pivots [Murty 1974]; W, n x n, is symmetric and positive semidefinite: where it
/// is singular, b is such that there is one. Entries whose diagonal is 0 have no p, and nothing is asked of their w.
Eigen::VectorXd complementarity(const Eigen::MatrixXd& W, const Eigen::VectorXd& b);

}  // namespace cardan
