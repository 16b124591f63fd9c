// Eigen's simplicial L D L* (up-looking: Davis 2005) in the order of approximate minimum degree (Amestoy, Davis, Duff
// 1996): deterministic, one thread, no BLAS.
#include <fmt/format.h>

#include <Eigen/SparseCholesky>
#include <cmath>

#include "core/linalg/linear_operator.hpp"
#include "core/linalg/sparse_factor.hpp"

namespace cardan {

struct SparseFactor::Impl {
  Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower> factor;
  Eigen::VectorXd D, diagonal;  // of the factor, in its order; of A

  int size() const { return static_cast<int>(diagonal.size()); }
  int row(int j) const { return factor.permutationPinv().indices()(j); }
};

SparseFactor::SparseFactor(const SparseMatrix& A) : impl_(std::make_unique<Impl>()) {
  if (A.rows() != A.cols() || A.rows() == 0 || !A.isCompressed())
    throw LinalgError(fmt::format("a square compressed matrix is needed, not {} x {}", A.rows(), A.cols()));
  Impl& s = *impl_;
  s.diagonal = A.diagonal();
  // Entries that are zero are no neighbours: a flat plate falls into bending and what happens in its plane.
  s.factor.compute(A.pruned(0.0, 0.0));
  s.D = s.factor.vectorD();
  for (int j = 0; j < s.size(); ++j)  // after a zero pivot D is not filled
    if (s.D(j) == 0.0 || !std::isfinite(s.D(j))) throw LinalgError("the matrix is singular", s.row(j));
}

SparseFactor::~SparseFactor() = default;
SparseFactor::SparseFactor(SparseFactor&&) noexcept = default;

Eigen::MatrixXd SparseFactor::solve(const Eigen::MatrixXd& b) const {
  if (b.rows() != impl_->size()) throw LinalgError(fmt::format("{} rows, {} expected", b.rows(), impl_->size()));
  return impl_->factor.solve(b);
}

int SparseFactor::negative_pivots() const { return static_cast<int>((impl_->D.array() < 0.0).count()); }

SparseFactor::Pivot SparseFactor::smallest_pivot() const {
  Pivot least{INFINITY, -1};
  for (int j = 0; j < impl_->size(); ++j) {
    const int row = impl_->row(j);
    const double ratio = std::abs(impl_->D(j) / impl_->diagonal(row));
    if (!(ratio >= least.ratio)) least = {ratio, row};
  }
  return least;
}

std::string SparseFactor::origin() { return fmt::format("Eigen {}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION); }

}  // namespace cardan
