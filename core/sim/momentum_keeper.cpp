#include "core/sim/momentum_keeper.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/dynamics/part.hpp"
#include "core/soa/kernels.hpp"

namespace cardan {
namespace {

const UserBody* free_root(const Model& model) {
  const UserBody* root = nullptr;
  for (const UserBody& u : model.user) {
    if (u.parent >= 0) continue;
    const bool floats = u.nv == 6 && (u.hinge->shape == CARDAN_SHAPE_FREE || u.hinge->shape == CARDAN_SHAPE_FREE_BODY);
    if (root || !floats) return nullptr;
    root = &u;
  }
  return root;
}

/// J^-1 b of a moment of inertia.
Eigen::Vector3d solve(const Eigen::Matrix3d& J, const Eigen::Vector3d& b) {
  const Eigen::Vector3d x = J.col(0), y = J.col(1), z = J.col(2), yz = y.cross(z);
  return Eigen::Vector3d(yz.dot(b), z.cross(x).dot(b), x.cross(y).dot(b)) / x.dot(yz);
}

}  // namespace

bool MomentumKeeper::honours(const Model& model) {
  const UserBody* root = free_root(model);
  if (!root || root->merged) return false;
  for (int i = root->v; i < root->v + 6; ++i)
    if (model.has_given_motion(i)) return false;
  return true;
}

MomentumKeeper::MomentumKeeper(const Model& model)
    : model_(model), root_(*free_root(model)), workspace_(model), observer_(model, workspace_) {
  kept_.reserve(static_cast<std::size_t>(model.nq + model.nv));
}

void MomentumKeeper::look(const double* q, const double* v) {
  const Inputs in{.q = q, .v = v, .gravity = false};
  outward(model_, soa::sweeps<double>(), workspace_, in, {.inertia = false});
  observer_.update(in, nullptr);
}

void MomentumKeeper::aim(const double* q, const double* v) {
  if (!kept_.empty() && std::equal(q, q + model_.nq, kept_.begin()) && std::equal(v, v + model_.nv, kept_.begin() + model_.nq)) return;
  look(q, v);
  const Momentum p = observer_.momentum();
  linear_ = p.linear, angular_ = p.angular;
}

void MomentumKeeper::keep(const double* q, double* v, bool inside) {
  look(q, v);
  const Momentum p = observer_.momentum();
  const Eigen::Vector3d push = linear_ - p.linear, twist = angular_ - p.angular - p.com.cross(push);  // about the mass centre
  const Eigen::Vector3d turn = solve(observer_.locked_inertia(p.com), twist);
  const Pose<double> P = observer_.body_pose(static_cast<int>(&root_ - model_.user.data())) * root_.pnode;
  const Eigen::Matrix3d R = to_eigen(P.R);
  const Eigen::Vector3d shift = push / p.mass + turn.cross(to_eigen(P.p) - p.com);  // of P
  const Eigen::Matrix3d axes = root_.hinge->shape == CARDAN_SHAPE_FREE_BODY ? R : to_eigen(root_.onode.R);
  Eigen::Vector3d::Map(v + root_.v) += R.transpose() * turn;
  Eigen::Vector3d::Map(v + root_.v + 3) += axes.transpose() * shift;
  for (const int k : model_.rotors) v[model_.bodies[static_cast<std::size_t>(k)].v] -= observer_.axis_in_world(k).dot(turn);
  if (!inside) kept_.assign(q, q + model_.nq), kept_.insert(kept_.end(), v, v + model_.nv);
}

}  // namespace cardan
