#include "bodies/modal/eigen_modes.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "bodies/modal/refuse.hpp"
#include "core/linalg/dense.hpp"
#include "core/linalg/eigenpairs.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMechanism = 1e-13;   // smallest pivot over diagonal: below, K has lost all digits
constexpr double kRigidMotion = 1e-9;  // relative, of motions scaled by the size of the body
constexpr double kNoInertia = 1e-14;   // relative, of inertias scaled likewise: the rounding of sums over the nodes

/// An M-orthonormal basis (6 n x r) of the rigid motions that leave `held` at rest. A turn that moves no mass is refused.
MatrixXd rigid_motions(const FeModel& model, const std::vector<int>& held, const Located& at) {
  const RigidShapes R = model.rigid_shapes();
  // Rotations about the mass centre, scaled to a displacement of order one; positions enter R as differences then.
  const Eigen::Matrix<double, 6, 6> whole = R.transpose() * (model.M * R);
  const Eigen::Vector3d centre = first_moment(whole) / (whole.bottomRightCorner<3, 3>().trace() / 3.0);
  double size = 0.0;
  for (const auto& node : model.nodes) size = std::max(size, (node - centre).norm());
  if (size == 0.0) size = 1.0;  // one node, at the mass centre
  Eigen::Matrix<double, 6, 6> scale = Eigen::Matrix<double, 6, 6>::Identity();
  for (int a = 0; a < 3; ++a) {
    scale.block<3, 1>(3, a) = -Eigen::Vector3d::Unit(a).cross(centre);
    scale.col(a) /= size;
  }
  MatrixXd free = R * scale;
  if (!held.empty()) {
    MatrixXd at_held(held.size(), 6);
    for (std::size_t i = 0; i < held.size(); ++i) {
      at_held.row(i) = free.row(held[i]);
      if (held[i] % model.per_node >= 3) at_held.row(i) *= size;
    }
    const auto [s, V] = right_singular(at_held);
    const Eigen::Index rank = (s.array() > kRigidMotion * std::max(s(0), 1e-300)).count();
    free = (free * V.rightCols(6 - rank)).eval();
  }
  const MatrixXd inertia = free.transpose() * (model.M * free);
  if (held.empty()) {
    const auto [s, V] = right_singular(inertia);
    if (!(s(5) > kNoInertia * s(0))) {
      const Eigen::Vector3d turn = V.col(5).head<3>().normalized(),
                            axis = (turn.array().abs() < kRigidMotion).select(0.0, turn.sum() < 0.0 ? -turn : turn);
      refuse(at, {}, Code::fe_model, "a free body with inertia about every axis",
             s(4) > kNoInertia * s(0)
                 ? fmt::format(
                       "none about the line through ({:.4g}, {:.4g}, {:.4g}) m along ({:.4g}, {:.4g}, {:.4g}): all its masses are on it",
                       centre.x(), centre.y(), centre.z(), axis.x(), axis.y(), axis.z())
                 : fmt::format("all its mass is at ({:.4g}, {:.4g}, {:.4g}) m", centre.x(), centre.y(), centre.z()),
             "one of `masses` with an `inertia`, or moments of inertia of the nodes in the mass matrix");
    }
  }
  return orthonormalised(free, inertia);
}

SparseFactor stiffness_factor(const FeModel& model, const SparseMatrix& K, const std::vector<int>& dofs, const Located& at) {
  const auto mechanism = [&](int row) {
    const int nodal = model.n_dofs() - model.component_modes;
    if (dofs[row] >= nodal)
      refuse(at, {}, Code::fe_model, "a structure without mechanisms",
             fmt::format("no stiffness against component mode {}", dofs[row] - nodal + 1));
    const auto& node = model.nodes[dofs[row] / model.per_node];
    refuse(at, {}, Code::fe_model, "a structure without mechanisms",
           fmt::format("no stiffness against {} {} at ({:.4g}, {:.4g}, {:.4g}) m",
                       dofs[row] % model.per_node < 3 ? "displacement" : "rotation", "xyz"[dofs[row] % 3], node.x(), node.y(), node.z()));
  };
  try {
    SparseFactor factor(K);
    const auto pivot = factor.smallest_pivot();
    if (!(pivot.ratio > kMechanism)) mechanism(pivot.row);
    if (const int negative = factor.negative_pivots(); negative > 0)
      refuse(at, {}, Code::fe_model, "a stiffness matrix that is positive definite where the root is held",
             fmt::format("{} negative eigenvalue{}", negative, negative == 1 ? "" : "s"),
             "is a sign wrong, or an element turned inside out?");
    return factor;
  } catch (const LinalgError& e) {
    if (e.row >= 0) mechanism(e.row);
    refuse(at, {}, Code::fe_model, "a stiffness matrix that can be factored", e.what());
  }
}

/// What keeps the body from moving: a node with rotations, or three nodes without, far from each other.
std::vector<int> steady_nodes(const FeModel& model) {
  if (model.per_node == 6) return {model.root_nodes.front()};
  const auto farthest = [&](auto&& distance) {
    int best = 0;
    for (int i = 1; i < static_cast<int>(model.nodes.size()); ++i)
      if (distance(model.nodes[i]) > distance(model.nodes[best])) best = i;
    return best;
  };
  const int a = farthest([&](const Eigen::Vector3d& x) { return (x - model.nodes[0]).norm(); });
  const int b = farthest([&](const Eigen::Vector3d& x) { return (x - model.nodes[a]).norm(); });
  const Eigen::Vector3d along = model.nodes[b] - model.nodes[a];
  return {a, b, farthest([&](const Eigen::Vector3d& x) { return along.cross(x - model.nodes[a]).norm(); })};
}

/// A frequency of the free body's size: the least Rayleigh quotient of its deflections under its own weight, held at
/// the root.
double weight_estimate(const FeModel& model, const Located& at) {
  const FreePart free(model.n_dofs(), dofs_of(steady_nodes(model), model.per_node));
  const SparseMatrix K = free.block(model.K);
  const SparseFactor factor = stiffness_factor(model, K, free.dofs, at);
  const MatrixXd load = model.M * model.rigid_shapes().rightCols(3);
  double least = INFINITY;
  for (int a = 0; a < 3; ++a) {
    VectorXd f(free.dofs.size());
    for (std::size_t i = 0; i < free.dofs.size(); ++i) f(i) = load(free.dofs[i], a);
    const MatrixXd u = free.expand(factor.solve(f));
    least = std::min(least, u.col(0).dot(load.col(a)) / u.col(0).dot(model.M * u.col(0)));
  }
  return least;
}

}  // namespace

std::vector<int> dofs_of(const std::vector<int>& nodes, int per_node) {
  std::vector<int> dofs;
  for (int node : nodes)
    for (int i = 0; i < per_node; ++i) dofs.push_back(per_node * node + i);
  return dofs;
}

FreePart::FreePart(int size, const std::vector<int>& left_out) : n(size) {
  std::vector<bool> out(n, false);
  for (int i : left_out) out[i] = true;
  for (int i = 0; i < n; ++i)
    if (!out[i]) dofs.push_back(i);
}

SparseMatrix FreePart::block(const SparseMatrix& A) const {
  std::vector<int> index(n, -1);
  for (std::size_t i = 0; i < dofs.size(); ++i) index[dofs[i]] = static_cast<int>(i);
  std::vector<Eigen::Triplet<double>> entries;
  for (int j = 0; j < A.outerSize(); ++j)
    for (SparseMatrix::InnerIterator it(A, j); it; ++it)
      if (index[it.row()] >= 0 && index[j] >= 0) entries.emplace_back(index[it.row()], index[j], it.value());
  SparseMatrix B(dofs.size(), dofs.size());
  B.setFromTriplets(entries.begin(), entries.end());
  return B;
}

MatrixXd FreePart::expand(const MatrixXd& x) const {
  MatrixXd full = MatrixXd::Zero(n, x.cols());
  for (std::size_t i = 0; i < dofs.size(); ++i) full.row(dofs[i]) = x.row(i);
  return full;
}

FeModes normal_modes(const FeModel& model, const std::vector<int>& held, int count, RigidModes policy, const Located& at) {
  const FreePart free(model.n_dofs(), held);
  const FeModes none{VectorXd(0), MatrixXd(model.n_dofs(), 0)};
  if (count == 0 && free.dofs.empty()) return none;
  if (free.dofs.empty()) refuse(at, {}, Code::fe_model, "degrees of freedom that are not held", "none: every node is held");
  const MatrixXd rigid = rigid_motions(model, held, at);
  const int n_rigid = static_cast<int>(rigid.cols());
  if (n_rigid > 0 && policy == RigidModes::refuse)
    refuse(at, {}, Code::rigid_body_mode, "a body that cannot move as a rigid one",
           fmt::format("{} rigid-body motion{}", n_rigid, n_rigid == 1 ? "" : "s"), "hold the root, or choose the free boundary");
  const SparseMatrix K = free.block(model.K), M = free.block(model.M);
  double sigma = 0.0;
  std::optional<SparseFactor> at_zero;
  if (n_rigid > 0)
    sigma = -weight_estimate(model, at);
  else
    at_zero.emplace(stiffness_factor(model, K, free.dofs, at));
  if (count == 0) return none;

  Eigenpairs pairs, beyond;
  try {
    pairs = lowest_eigenpairs(K, M, n_rigid + count, sigma, &beyond, at_zero ? &*at_zero : nullptr);
  } catch (const LinalgError& e) {
    refuse(at, {}, Code::fe_model, fmt::format("{} modes of {} free dofs", count, free.dofs.size()), e.what());
  }
  if (n_rigid > 0 && !(std::abs(pairs.values(n_rigid - 1)) < 1e-4 * pairs.values(n_rigid)))
    refuse(at, {}, Code::fe_model, fmt::format("{} rigid-body modes", n_rigid),
           fmt::format("eigenvalue {} is {:.3g} rad^2/s^2, the next {:.3g}", n_rigid, pairs.values(n_rigid - 1), pairs.values(n_rigid)));

  FeModes modes{pairs.values.tail(count), free.expand(pairs.vectors.rightCols(count)), beyond.values, free.expand(beyond.vectors)};
  if (n_rigid > 0) modes.shapes -= (rigid * (rigid.transpose() * (model.M * modes.shapes))).eval();
  return modes;
}

}  // namespace cardan
