// CHOLMOD (Chen, Davis, Hager, Rajamanickam 2008), its simplicial L D L* with the AMD ordering: deterministic, one
// thread. Built instead of sparse_eigen.cpp with the CMake option CARDAN_CHOLMOD.
#include <cholmod.h>
#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "core/linalg/linear_operator.hpp"
#include "core/linalg/sparse_factor.hpp"

namespace cardan {

struct SparseFactor::Impl {
  mutable cholmod_common common;
  cholmod_factor* L = nullptr;
  Eigen::VectorXd diagonal;  // of A

  Impl() {
    cholmod_start(&common);
    common.supernodal = CHOLMOD_SIMPLICIAL;
    common.final_ll = 0;
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_AMD;
    common.print = 0;
  }
  ~Impl() {
    cholmod_free_factor(&L, &common);
    cholmod_finish(&common);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  int size() const { return static_cast<int>(L->n); }
  double pivot(int j) const { return static_cast<const double*>(L->x)[static_cast<const int*>(L->p)[j]]; }
  int row(int j) const { return static_cast<const int*>(L->Perm)[j]; }
};

SparseFactor::SparseFactor(const SparseMatrix& A) : impl_(std::make_unique<Impl>()) {
  if (A.rows() != A.cols() || A.rows() == 0 || !A.isCompressed())
    throw LinalgError(fmt::format("a square compressed matrix is needed, not {} x {}", A.rows(), A.cols()));
  SparseMatrix kept = A;  // the order depends on what is stored
  kept.prune([](int, int, double x) { return x != 0.0; });
  cholmod_sparse view{};
  view.nrow = view.ncol = static_cast<std::size_t>(kept.cols());
  view.nzmax = static_cast<std::size_t>(kept.nonZeros());
  view.p = kept.outerIndexPtr();
  view.i = kept.innerIndexPtr();
  view.x = kept.valuePtr();
  view.stype = -1;  // symmetric, lower triangle
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = view.packed = 1;

  Impl& s = *impl_;
  s.diagonal = A.diagonal();
  s.L = cholmod_analyze(&view, &s.common);
  if (s.L == nullptr) throw LinalgError("out of memory while a sparse matrix was analysed");
  cholmod_factorize(&view, s.L, &s.common);
  if (s.common.status == CHOLMOD_NOT_POSDEF || s.L->minor < s.L->n)
    throw LinalgError("the matrix is singular", s.row(static_cast<int>(s.L->minor)));
  if (s.common.status < CHOLMOD_OK) throw LinalgError(fmt::format("CHOLMOD status {}", s.common.status));
  for (int j = 0; j < s.size(); ++j)
    if (!std::isfinite(s.pivot(j))) throw LinalgError("the matrix is singular", s.row(j));
}

SparseFactor::~SparseFactor() = default;
SparseFactor::SparseFactor(SparseFactor&&) noexcept = default;

Eigen::MatrixXd SparseFactor::solve(const Eigen::MatrixXd& b) const {
  if (b.rows() != impl_->size()) throw LinalgError(fmt::format("{} rows, {} expected", b.rows(), impl_->size()));
  cholmod_dense view{};
  view.nrow = view.d = static_cast<std::size_t>(b.rows());
  view.ncol = static_cast<std::size_t>(b.cols());
  view.nzmax = view.nrow * view.ncol;
  view.x = const_cast<double*>(b.data());
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, impl_->L, &view, &impl_->common);
  if (x == nullptr) throw LinalgError("out of memory while a sparse system was solved");
  Eigen::MatrixXd result = Eigen::Map<const Eigen::MatrixXd>(static_cast<const double*>(x->x), b.rows(), b.cols());
  cholmod_free_dense(&x, &impl_->common);
  return result;
}

std::string SparseFactor::origin() {
  return fmt::format("CHOLMOD {}.{}.{} (parts are GPL)", CHOLMOD_MAIN_VERSION, CHOLMOD_SUB_VERSION, CHOLMOD_SUBSUB_VERSION);
}

int SparseFactor::negative_pivots() const {
  int count = 0;
  for (int j = 0; j < impl_->size(); ++j) count += impl_->pivot(j) < 0.0;
  return count;
}

SparseFactor::Pivot SparseFactor::smallest_pivot() const {
  Pivot least{INFINITY, -1};
  for (int j = 0; j < impl_->size(); ++j) {
    const int row = impl_->row(j);
    const double ratio = std::abs(impl_->pivot(j) / impl_->diagonal(row));
    if (!(ratio >= least.ratio)) least = {ratio, row};
  }
  return least;
}

}  // namespace cardan
