#include "core/sim/holding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

constexpr double kBlocked = 1e-14;  // of the compliance of a hinge alone: what is less is rounding
constexpr double kIdle = 1e-10;     // of forces on held components: what is less does nothing, as a pivot of loops

}  // namespace

Holding::Holding(const Model& model, Model* own)
    : model_(model), own_(own), workspace_(model), observer_(model, workspace_), devices_(model, own), forces_(model.devices.holds.size()) {
  if (field_of_gravity(model) >= 0) fields_ = std::make_unique<FieldMoments>(model);
  for (std::vector<double>* x : {&tau_, &needed_, &vdot_, &zero_}) x->resize(static_cast<std::size_t>(model.nv));
}

bool Holding::accelerate(const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks, int let_go) {
  devices_.commands = known.commands;
  tau_.assign(in.tau, in.tau + model_.nv);
  wrenches_.assign(in.wrenches.begin(), in.wrenches.end());
  devices_.set({t, z, marks, tau_.data(), wrenches_.data()});
  if (let_go >= 0) own_->prescribed[static_cast<std::size_t>(let_go)] = 0;
  use_ = in;
  use_.tau = tau_.data(), use_.wrenches = wrenches_;
  if (fields_) use_.moment = &fields_->at(field_of_gravity(model_), t);
  return forward_dynamics(model_, workspace_, use_, vdot_.data(), &devices_);
}

bool Holding::look(const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks) {
  if (!accelerate(known, in, t, z, marks, -1)) return false;
  observer_.prescribed_forces(use_, vdot_.data(), needed_.data());
  const std::span<const double> coupled = loop_forces(workspace_).tau;  // couplings push there too
  const double* pushed = coupled.empty() ? tau_.data() : coupled.data();
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    const DeviceHold& h = model_.devices.holds[i];
    const auto v = static_cast<std::size_t>(h.v);
    forces_[i] = model_.prescribed[v] != 0 ? Force{needed_[v] - pushed[v], devices_.most_held(h.device), true} : Force{};
  }
  if (!model_.loops.empty()) share();
  return true;
}

double Holding::let_go(std::size_t hold, const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks) {
  const int v = model_.devices.holds[hold].v;
  const bool good = accelerate(known, in, t, z, marks, v);
  devices_.weigh_again();
  return good ? vdot_[static_cast<std::size_t>(v)] : std::numeric_limits<double>::quiet_NaN();
}

bool Holding::is_blocked(std::size_t hold, const double* q, const LoopDrive* drives) {
  const auto v = static_cast<std::size_t>(model_.devices.holds[hold].v);
  const Eigen::VectorXd bends = elastic_force(model_, q, zero_.data());
  for (std::size_t i = 0; i < tau_.size(); ++i) tau_[i] = -bends[static_cast<Eigen::Index>(i)];
  tau_[v] += 1.0;
  std::vector<LoopDrive> lengths(static_cast<std::size_t>(model_.loops.n_drives));
  for (std::size_t i = 0; i < lengths.size(); ++i) lengths[i].more = drives[i].more;  // as they are, at rest
  const Inputs in{.q = q, .v = zero_.data(), .tau = tau_.data(), .vdot = zero_.data(), .gravity = false, .drives = lengths.data()};
  if (!forward_dynamics(model_, workspace_, in, vdot_.data())) return false;
  const double scale = model_.loops.column_scale[v];
  return std::abs(vdot_[v]) <= kBlocked * scale * scale;
}

// Of all forces f on what is held that multipliers can take one another's place with, those of least sum of squares of g = f / most; where
// these pass the most somewhere, that is pushed with there, and the rest takes what is left.
void Holding::share() {
  std::vector<int> components;
  std::vector<Force*> held;
  for (std::size_t i = 0; i < forces_.size(); ++i)
    if (forces_[i].held) components.push_back(model_.devices.holds[i].v), held.push_back(&forces_[i]);
  Eigen::MatrixXd idle = idle_forces(model_, workspace_, components);
  if (idle.size() == 0) return;
  const auto m = static_cast<Eigen::Index>(held.size());
  double strongest = 0.0;
  for (const Force* f : held) strongest = std::max(strongest, f->most);
  Eigen::VectorXd most(m), g(m);
  for (Eigen::Index i = 0; i < m; ++i) {
    most[i] = std::max(held[static_cast<std::size_t>(i)]->most, 1e-9 * strongest + std::numeric_limits<double>::min());
    g[i] = held[static_cast<std::size_t>(i)]->force / most[i];
    idle.row(i) /= most[i];
  }
  // What idle forces leave alone: R g = Q.
  const RightSingular parts = right_singular(idle.transpose());
  Eigen::Index rank = 0;
  while (rank < parts.values.size() && parts.values[rank] > kIdle * parts.values[0]) ++rank;
  if (rank == 0 || !(parts.values[0] > 0.0)) return;
  const Eigen::MatrixXd R = parts.vectors.rightCols(m - rank).transpose();
  const Eigen::VectorXd Q = R * g;
  std::vector<Eigen::Index> rest(held.size());
  std::iota(rest.begin(), rest.end(), 0);
  Eigen::VectorXd at_most = Eigen::VectorXd::Zero(m);
  while (true) {
    Eigen::VectorXd next = at_most;
    next(rest) = least_squares(Eigen::MatrixXd(R(Eigen::all, rest)), Eigen::VectorXd(Q - R * at_most));
    if (!((R * next - Q).norm() <= kIdle * Q.norm())) break;  // they cannot take what is left: it stays with those before
    g = next;
    for (const Eigen::Index i : rest)
      if (std::abs(g[i]) > 1.0) at_most[i] = std::copysign(1.0, g[i]);
    if (std::erase_if(rest, [&](Eigen::Index i) { return at_most[i] != 0.0; }) == 0 || rest.empty()) break;
  }
  for (Eigen::Index i = 0; i < m; ++i) held[static_cast<std::size_t>(i)]->force = g[i] * most[i];
}

}  // namespace cardan
