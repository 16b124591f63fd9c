#include <Eigen/Dense>
#include <cmath>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/refuse.hpp"
#include "core/linalg/dense.hpp"
#include "core/linalg/linear_operator.hpp"

namespace cardan {

using Eigen::MatrixXd;

FeModes craig_bampton(const FeModel& model, const std::vector<int>& held, const std::vector<int>& interface, const MatrixXd& unit,
                      int count, const Located& at) {
  std::vector<int> fixed = held;
  fixed.insert(fixed.end(), interface.begin(), interface.end());
  const FeModes inner = normal_modes(model, fixed, count, RigidModes::refuse, at);
  const int n_constraint = static_cast<int>(unit.cols()), m = count + n_constraint;

  // Constraint mode j: column j of `unit` at the interface, zero at `held`, no force on any other dof.
  const FreePart free(model.n_dofs(), fixed);
  const MatrixXd force = model.K * unit;
  MatrixXd load(free.dofs.size(), n_constraint), constraint = unit;
  for (std::size_t i = 0; i < free.dofs.size(); ++i) load.row(i) = -force.row(free.dofs[i]);
  if (!free.dofs.empty()) constraint += free.expand(SparseFactor(free.block(model.K)).solve(load));

  // K couples the two sets nowhere; M does. Solve the small problem, scaled so that both diagonals of M are one.
  MatrixXd basis(model.n_dofs(), m);
  basis << inner.shapes, constraint;
  for (int j = 0; j < m; ++j) basis.col(j) /= std::sqrt(basis.col(j).dot(model.M * basis.col(j)));
  MatrixXd K = basis.transpose() * (model.K * basis);
  const MatrixXd M = basis.transpose() * (model.M * basis);
  K.topRightCorner(count, n_constraint).setZero();
  K.bottomLeftCorner(n_constraint, count).setZero();
  K.topLeftCorner(count, count) = inner.omega2.asDiagonal();
  const std::optional<DensePairs> pairs = modal_pairs(K, M);
  if (!pairs)
    refuse(at, {}, Code::bad_modal_data, "independent normal and constraint modes", "a singular modal mass matrix",
           "ask for fewer modes, or refine the mesh");

  FeModes out{pairs->values, basis * pairs->vectors};
  for (int j = 0; j < m; ++j) {
    Eigen::Index largest;
    out.shapes.col(j).cwiseAbs().maxCoeff(&largest);
    if (out.shapes(largest, j) < 0.0) out.shapes.col(j) *= -1.0;
  }
  return out;
}

}  // namespace cardan
