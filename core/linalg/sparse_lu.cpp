#include "core/linalg/sparse_lu.hpp"

#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace cardan {
namespace {

using Matrix = Eigen::SparseMatrix<double>;
constexpr int kPasses = 4;

}  // namespace

struct SparseLu::Impl {
  Eigen::SparseLU<Matrix> lu;
  Matrix scaled;
  Eigen::VectorXd rows, columns, row_most, column_most;
  std::vector<int> outer, inner;  // the pattern that was analysed

  bool analysed(const Matrix& A) const {
    return std::ranges::equal(outer, std::span(A.outerIndexPtr(), static_cast<std::size_t>(A.cols()) + 1)) &&
           std::ranges::equal(inner, std::span(A.innerIndexPtr(), static_cast<std::size_t>(A.nonZeros())));
  }
  void equilibrate() {
    const Eigen::Index n = scaled.cols();
    rows = columns = Eigen::VectorXd::Ones(n);
    for (int pass = 0; pass < kPasses; ++pass) {
      row_most.setZero(n), column_most.setZero(n);
      for (Eigen::Index j = 0; j < n; ++j)
        for (Matrix::InnerIterator it(scaled, j); it; ++it) {
          row_most[it.row()] = std::max(row_most[it.row()], std::abs(it.value()));
          column_most[j] = std::max(column_most[j], std::abs(it.value()));
        }
      for (Eigen::VectorXd* most : {&row_most, &column_most})
        for (double& x : *most) x = x > 0.0 ? 1.0 / std::sqrt(x) : 1.0;
      for (Eigen::Index j = 0; j < n; ++j)
        for (Matrix::InnerIterator it(scaled, j); it; ++it) it.valueRef() *= row_most[it.row()] * column_most[j];
      rows.array() *= row_most.array(), columns.array() *= column_most.array();
    }
  }
};

SparseLu::SparseLu() : impl_(std::make_unique<Impl>()) {}
SparseLu::~SparseLu() = default;
SparseLu::SparseLu(SparseLu&&) noexcept = default;

bool SparseLu::factor(const Eigen::SparseMatrix<double>& A) {
  Impl& k = *impl_;
  if (!Eigen::Map<const Eigen::VectorXd>(A.valuePtr(), A.nonZeros()).allFinite()) return false;
  if (!k.analysed(A)) {
    k.lu.analyzePattern(A);
    k.outer.assign(A.outerIndexPtr(), A.outerIndexPtr() + A.cols() + 1);
    k.inner.assign(A.innerIndexPtr(), A.innerIndexPtr() + A.nonZeros());
  }
  k.scaled = A;
  k.equilibrate();
  k.lu.factorize(k.scaled);
  return k.lu.info() == Eigen::Success;
}

void SparseLu::solve(const Eigen::VectorXd& b, Eigen::VectorXd& x) const {
  const Impl& k = *impl_;
  x = k.columns.cwiseProduct(Eigen::VectorXd(k.lu.solve(Eigen::VectorXd(k.rows.cwiseProduct(b)))));
}

}  // namespace cardan
