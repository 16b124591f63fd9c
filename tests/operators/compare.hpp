#pragma once
// What the tests of operators compare by: sizes, differences, condition numbers; the trees on which identities must hold.

#include "core/linalg/dense.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {

constexpr int kTrees = 200;

/// Rigid, mixed, flexible; up to two roots, every hinge; no prescribed motion.
inline std::vector<TreeOptions> kinds_of_trees() {
  return {{.bodies = 7, .flexible = 0.0}, {.bodies = 6, .flexible = 0.5}, {.bodies = 4, .flexible = 1.0}};
}

/// |a - b| over the largest entry of either; sizes must agree.
inline double differ(const MatrixXd& a, const MatrixXd& b, double at_least = 0.0) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return HUGE_VAL;
  return relative(largest(a - b), worse({largest(a), largest(b), at_least}));
}
/// Of a symmetric positive definite matrix in units in which its diagonal is 1.
inline double scaled_condition(const MatrixXd& M) {
  if (M.size() == 0) return 1.0;
  if (!M.allFinite()) return std::nan("");  // whose singular values would be anything
  const VectorXd d = M.diagonal().cwiseSqrt().cwiseInverse();
  const VectorXd s = singular_values(d.asDiagonal() * M * d.asDiagonal());
  return s[0] / s[s.size() - 1];
}

}  // namespace cardan::test
