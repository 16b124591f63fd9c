#include "core/operators/closed_system.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/mass_matrix.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LoopFreedom freedom_at(const Model& closed, const double* q, const LoopDrive* drives = nullptr) {
  if (!closed.loops.empty()) {
    Workspace ws(closed);
    return loop_freedom(closed, ws, q, drives);
  }
  LoopFreedom all;
  all.independent.resize(static_cast<std::size_t>(closed.nv));
  std::iota(all.independent.begin(), all.independent.end(), 0);
  all.X.setIdentity(closed.nv, closed.nv);
  return all;
}

bool is_given(const Model& m, int v) { return m.has_prescribed() && m.prescribed[static_cast<std::size_t>(v)] != 0; }

void require_numbers(const char* what, Eigen::Index size, Eigen::Index got) {
  if (size != got) refuse(Code::operator_shape, {what}, fmt::format("{} numbers", size), fmt::format("{}", got));
}

}  // namespace

MatrixXd free_motions(const TreeOperators& tree, const MatrixXd& X_all) {
  const int n = tree.size(Space::hinge);
  MatrixXd X(n, X_all.cols());
  Eigen::Index free = 0;
  for (Eigen::Index j = 0; j < X_all.cols(); ++j) {
    bool given = false;
    for (int v = 0; v < tree.model().nv; ++v) {
      given = given || (is_given(tree.model(), v) && X_all(v, j) != 0.0);
      if (const int i = tree.place_of_velocity(v); i >= 0) X(i, free) = X_all(v, j);
    }
    if (!given) ++free;
  }
  X.conservativeResize(n, free);
  MatrixXd MX(n, free);
  for (Eigen::Index j = 0; j < free; ++j) MX.col(j) = mass_times(tree, X.col(j));
  const MatrixXd gram = X.transpose() * MX;
  if (!cholesky(gram)) throw NumericsError({.code = Code::singular_hinge, .what = "a motion that is free has no inertia"});
  return orthonormalised(X, gram);
}

ClosedSystem::ClosedSystem(std::shared_ptr<const Model> closed, const double* q)
    : freedom_(freedom_at(*closed, q)), tree_(open_tree(std::move(closed))) {
  tree_.at(q);
  Y_ = free_motions(tree_, freedom_.X);
}

VectorXd ClosedSystem::respond(const VectorXd& tau) const {
  require_numbers("forces on a closed system", Y_.rows(), tau.size());
  return Y_ * (Y_.transpose() * tau);
}

// Forward dynamics without actuators gives a v' that the loops allow; others differ from it by X times something.
ClosedForces closed_inverse_dynamics(const std::shared_ptr<const Model>& closed, const Inputs& in, const VectorXd& wanted,
                                     std::span<const std::uint8_t> actuated) {
  const Model& m = *closed;
  require_numbers("accelerations of inverse dynamics", m.nv, wanted.size());
  require_numbers("marks of actuators", m.nv, static_cast<Eigen::Index>(actuated.size()));
  Workspace ws(m);
  VectorXd idle(m.nv), tau = in.tau ? VectorXd(Eigen::Map<const VectorXd>(in.tau, m.nv)) : VectorXd(VectorXd::Zero(m.nv));
  hinge_laws::add_forces(m, in.q, in.v, tau.data());
  Inputs loaded = in;
  loaded.tau = tau.data();
  if (!forward_dynamics(m, ws, loaded, idle.data())) throw NumericsError(describe_breakdown(m, ws.breakdown, 0.0));
  const LoopFreedom freedom = freedom_at(m, in.q, in.drives);
  TreeOperators tree(open_tree(closed));
  tree.at(in.q);
  std::vector<int> free, drives;
  std::vector<Eigen::Index> columns;
  for (std::size_t j = 0; j < freedom.independent.size(); ++j)
    if (const int v = freedom.independent[j]; !is_given(m, v)) free.push_back(v), columns.push_back(static_cast<Eigen::Index>(j));
  for (int v = 0; v < m.nv; ++v)
    if (actuated[static_cast<std::size_t>(v)] != 0 && !is_given(m, v)) drives.push_back(v);
  const MatrixXd X = freedom.X(Eigen::all, columns);
  const VectorXd forces = X.transpose() * tree.to_model(mass_times(tree, tree.from_model(X * (wanted - idle)(free))));
  ClosedForces out{VectorXd::Zero(m.nv), VectorXd::Zero(m.nv)};
  if (!drives.empty() && !free.empty()) {  // rates in the root of energy
    VectorXd scale(m.nv);
    for (int v = 0; v < m.nv; ++v) scale[v] = 1.0 / std::sqrt(tree.to_model(mass_times(tree, tree.from_model(VectorXd::Unit(m.nv, v))))[v]);
    const MatrixXd A = scale(free).asDiagonal() * X(drives, Eigen::all).transpose() * scale(drives).cwiseInverse().asDiagonal();
    out.tau(drives) = least_squares(A, VectorXd(scale(free).cwiseProduct(forces))).cwiseQuotient(scale(drives));
  }
  out.missing(free) = forces - X.transpose() * out.tau;
  return out;
}

}  // namespace cardan::operators
