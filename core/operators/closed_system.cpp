#include "core/operators/closed_system.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/following_rates.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/sensitivity.hpp"

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

/// Of the columns of X, those that no given motion takes part in; hinge space.
MatrixXd free_columns(const TreeOperators& tree, const MatrixXd& X_all) {
  MatrixXd X(tree.size(Space::hinge), X_all.cols());
  Eigen::Index free = 0;
  for (Eigen::Index j = 0; j < X_all.cols(); ++j) {
    bool given = false;
    for (int v = 0; v < tree.model().nv; ++v) {
      given = given || (is_given(tree.model(), v) && X_all(v, j) != 0.0);
      if (const int i = tree.place_of_velocity(v); i >= 0) X(i, free) = X_all(v, j);
    }
    if (!given) ++free;
  }
  X.conservativeResize(Eigen::NoChange, free);
  return X;
}

/// X* M X.
MatrixXd inertia_of(const TreeOperators& tree, const MatrixXd& X) {
  MatrixXd MX(X.rows(), X.cols());
  for (Eigen::Index j = 0; j < X.cols(); ++j) MX.col(j) = mass_times(tree, X.col(j));
  return X.transpose() * MX;
}
MatrixXd orthonormal_motions(const TreeOperators& tree, const MatrixXd& X) {
  const MatrixXd inertia = inertia_of(tree, X);
  if (!cholesky(inertia)) throw NumericsError({.code = Code::singular_hinge, .what = "a motion that is free has no inertia"});
  return orthonormalised(X, inertia);
}

}  // namespace

MatrixXd free_motions(const TreeOperators& tree, const MatrixXd& X) { return orthonormal_motions(tree, free_columns(tree, X)); }

ClosedSystem::ClosedSystem(std::shared_ptr<const Model> closed, const double* q, const LoopDrive* drives)
    : model_(std::move(closed)), freedom_(freedom_at(*model_, q, drives)), tree_(open_tree(model_)) {
  if (drives) drives_.assign(drives, drives + model_->loops.n_drives);
  tree_.at(q);
  X_ = free_columns(tree_, freedom_.X);
  Y_ = orthonormal_motions(tree_, X_);
}

VectorXd ClosedSystem::respond(const VectorXd& tau) const {
  require_numbers("forces on a closed system", Y_.rows(), tau.size());
  return Y_ * (Y_.transpose() * tau);
}

// Y* M' Y, and where loops turn with q  S^-1 (X'* M X + X* M X') S^-*: Y* M X' S^-* and its transpose.
std::vector<MatrixXd> ClosedSystem::inertia_rates(const MatrixXd& along) const {
  const Model& open = tree_.model();
  const Eigen::Index m = Y_.cols();
  const auto in_order_of_v = [&](const MatrixXd& x) {
    MatrixXd out(open.nv, x.cols());
    for (Eigen::Index j = 0; j < x.cols(); ++j) out.col(j) = tree_.to_model(VectorXd(x.col(j)));
    return out;
  };
  const MatrixXd Y = in_order_of_v(Y_), ways = in_order_of_v(along);
  const VectorXd still = VectorXd::Zero(open.nv);
  Sensitivities about(tree_.model_pointer(), Sensitivities::Springs::left_out);
  about.at({.q = tree_.q().data(), .v = still.data(), .gravity = false});
  std::vector<MatrixXd> out(static_cast<std::size_t>(along.cols()));
  MatrixXd dM_Y(open.nv, m);
  for (std::size_t j = 0; j < out.size(); ++j) {
    for (Eigen::Index k = 0; k < m; ++k) about.mass(ways.col(static_cast<Eigen::Index>(j)).data(), Y.col(k).data(), dM_Y.col(k).data());
    out[j] = Y.transpose() * dM_Y;
  }
  for (Eigen::Index k = 0; k < m && !model_->loops.empty(); ++k) {
    FollowingRates rates(*model_, open, tree_.q().data(), Y.col(k), drives_);
    for (std::size_t j = 0; j < out.size(); ++j) {
      const VectorXd a = rates.along(ways.col(static_cast<Eigen::Index>(j)));
      const VectorXd pushed = Y_.transpose() * mass_times(tree_, tree_.from_model(a));
      out[j].col(k) += pushed, out[j].row(k) += pushed.transpose();
    }
  }
  return out;
}

double ClosedSystem::log_det() const { return 2.0 * cholesky(inertia_of(tree_, X_))->diagonal().array().log().sum(); }
VectorXd ClosedSystem::log_det_gradient() const {
  const std::vector<MatrixXd> rates = inertia_rates(X_);
  VectorXd out(X_.cols());
  for (std::size_t j = 0; j < rates.size(); ++j) out[static_cast<Eigen::Index>(j)] = rates[j].trace();
  return out;
}

VectorXd ClosedSystem::nu(const VectorXd& v) const {
  require_numbers("velocities of a closed system", Y_.rows(), v.size());
  return Y_.transpose() * mass_times(tree_, v);
}
VectorXd ClosedSystem::velocity(const VectorXd& nu) const {
  require_numbers("diagonalised velocities of a closed system", Y_.cols(), nu.size());
  return Y_ * nu;
}
VectorXd ClosedSystem::eps(const VectorXd& tau) const {
  require_numbers("forces on a closed system", Y_.rows(), tau.size());
  return Y_.transpose() * tau;
}
// nu = S* v_I: nu' = S* v_I' + S'* v_I, and X* M X v_I' = X* (tau - C(q, v) - M X' v_I).
VectorXd ClosedSystem::coriolis(const VectorXd& nu) const {
  const Model& open = tree_.model();
  const VectorXd v = tree_.to_model(velocity(nu)), still = VectorXd::Zero(open.nv);
  Workspace ws(open);
  VectorXd push(open.nv);
  inverse_dynamics(open, ws, {.q = tree_.q().data(), .v = v.data(), .vdot = still.data(), .gravity = false}, push.data(),
                   {.gravity = false, .elastic = false});
  VectorXd force = tree_.from_model(push);
  if (!model_->loops.empty())
    force += mass_times(tree_, tree_.from_model(FollowingRates(*model_, open, tree_.q().data(), v, drives_).along(v)));
  MatrixXd R = inertia_rates(Y_ * nu).front();
  R.diagonal() *= 0.5;
  return Y_.transpose() * force - R.triangularView<Eigen::Upper>() * nu;
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
  VectorXd given = VectorXd::Zero(m.nv);
  for (int v = 0; v < m.nv; ++v)
    if (in.vdot && is_given(m, v)) given[v] = in.vdot[v];
  Inputs loaded = in;
  loaded.tau = tau.data(), loaded.vdot = given.data();
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
