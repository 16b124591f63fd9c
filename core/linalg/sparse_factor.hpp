#pragma once
// L D L* of a sparse symmetric matrix, for many right-hand sides.
#include <Eigen/SparseCore>
#include <memory>
#include <string>

namespace cardan {

using SparseMatrix = Eigen::SparseMatrix<double>;  // compressed columns, 32-bit indices

/// Factor of A = A* with a fill-reducing permutation and no pivoting for size: exact for definite A, and good enough
/// for an indefinite shift that is not an eigenvalue (bisection counts, shift-invert inside the spectrum). The same bits
/// every time. What others cost: docs/adr/0015-a-factor-free-of-the-gpl.md.
class SparseFactor {
 public:
  /// Reads the lower triangle of A. Throws LinalgError when a pivot is zero or not finite.
  explicit SparseFactor(const SparseMatrix& A);
  ~SparseFactor();
  SparseFactor(SparseFactor&&) noexcept;

  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;  ///< A^-1 b
  /// Number of negative entries of D: by Sylvester's law of inertia, the number of negative eigenvalues of A.
  int negative_pivots() const;
  /// The smallest |D_j| / A_jj and its row j in A: near the rounding unit, A is singular for practical purposes.
  struct Pivot {
    double ratio;
    int row;
  };
  Pivot smallest_pivot() const;
  /// Whose factor is built in: "Eigen 3.4.0", or "CHOLMOD 3.0.14 (parts are GPL)" with the CMake option CARDAN_CHOLMOD.
  static std::string origin();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cardan
