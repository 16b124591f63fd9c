#include "core/linalg/complementarity.hpp"

#include <vector>

#include "core/linalg/dense.hpp"

namespace cardan {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd complementarity(const MatrixXd& W, const VectorXd& b) {
  constexpr double kRegular = 1e-12;  // of the diagonal: added, so that there is one of singular ones; a second solution takes it out again
  constexpr double kZero = 1e-10;     // of the largest: rounding
  const Index n = W.rows(), most = 100 * n;
  std::vector<bool> is_in(static_cast<std::size_t>(n));
  for (Index i = 0; i < n; ++i) is_in[static_cast<std::size_t>(i)] = W(i, i) > 0.0;
  VectorXd p = VectorXd::Zero(n);
  std::vector<Index> in;
  for (Index pivots = 0; pivots < most; ++pivots) {
    in.clear();
    for (Index i = 0; i < n; ++i)
      if (is_in[static_cast<std::size_t>(i)]) in.push_back(i);
    p.setZero();
    if (in.size() == 1) {
      p[in[0]] = b[in[0]] / W(in[0], in[0]);
    } else if (!in.empty()) {
      const MatrixXd part = W(in, in);
      MatrixXd regular = part;
      regular.diagonal() *= 1.0 + kRegular;
      for (int i = 0; i < 2; ++i) p(in) += symmetric_solve(regular, VectorXd(b(in) - part * p(in)));
    }
    const VectorXd w = W * p - b;
    const double zero_p = kZero * p.lpNorm<Eigen::Infinity>(), zero_w = kZero * b.lpNorm<Eigen::Infinity>();
    Index i = 0;  // the first that does not fit changes its side
    while (i < n && (is_in[static_cast<std::size_t>(i)] ? p[i] >= -zero_p : w[i] >= -zero_w || !(W(i, i) > 0.0))) ++i;
    if (i == n) break;
    is_in[static_cast<std::size_t>(i)] = !is_in[static_cast<std::size_t>(i)];
  }
  return p.cwiseMax(0.0);
}

}  // namespace cardan
