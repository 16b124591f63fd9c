#pragma once
// Linear equations of the twin, compiled once for both scalars.
#include <Eigen/Cholesky>

#include "core/reference/leaves.hpp"

namespace cardan::reference {

/// A = L L* of a symmetric A, of which the lower triangle is read.
template <class T>
class Factor {
 public:
  explicit Factor(const MatX<T>& A);
  bool is_positive() const;  ///< whether A is positive definite; else there is no solution
  double rcond() const;      ///< estimate of the reciprocal condition number
  VecX<T> solve(const VecX<T>& b) const;
  MatX<T> solve(const MatX<T>& B) const;

 private:
  Eigen::LLT<MatX<T>> factor_;
};

/// A^-1 b of any regular A.
template <class T>
VecX<T> general_solve(const MatX<T>& A, const VecX<T>& b);

}  // namespace cardan::reference
