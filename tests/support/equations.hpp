#pragma once
// Linear equations of tests by decompositions that are compiled once.
#include "core/linalg/dense.hpp"

namespace cardan::test {

/// A^-1 B of a positive definite A; throws std::bad_optional_access where it is not.
inline Eigen::MatrixXd positive_solve(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) { return cholesky_solve(cholesky(A).value(), B); }

}  // namespace cardan::test
