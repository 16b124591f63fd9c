#pragma once
// L U of a sparse matrix that need be neither symmetric nor definite, as systems with multipliers are.
#include <Eigen/SparseCore>
#include <memory>

namespace cardan {

/// Rows and columns are scaled until the largest entry of each is near one (Ruiz 2001) and rows exchanged for size; columns are ordered
/// anew where the pattern is another one. Allocates. The same bits every time.
class SparseLu {
 public:
  SparseLu();
  ~SparseLu();
  SparseLu(SparseLu&&) noexcept;

  /// A: square, compressed. False: it is singular, or not finite.
  bool factor(const Eigen::SparseMatrix<double>& A);
  /// x = A^-1 b.
  void solve(const Eigen::VectorXd& b, Eigen::VectorXd& x) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cardan
