#include "core/sim/holding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loop_pass.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

constexpr double kBlocked = 1e-14;  // of the compliance of a hinge alone: what is less is rounding
constexpr double kStill = 1e-12;    // [rad/s]: slower rates are rounding
constexpr double kStands = 1e-6;    // of the largest rate: where what is held moves faster, rates are what rounding left of them at rest
constexpr double kIdle = 1e-10;     // of forces on held components, and of accelerations: what is less is nothing, as a pivot of loops

}  // namespace

Holding::Holding(const Model& model, Model* own)
    : model_(model), own_(own), workspace_(model), observer_(model, workspace_), devices_(model, own), forces_(model.devices.holds.size()) {
  if (field_of_gravity(model) >= 0) fields_ = std::make_unique<FieldMoments>(model);
  for (std::vector<double>* x : {&tau_, &needed_, &vdot_, &zero_, &given_, &probe_}) x->resize(static_cast<std::size_t>(model.nv));
  lengths_.resize(static_cast<std::size_t>(model.loops.n_drives)), in_turns_.assign(static_cast<std::size_t>(model.nv), 1.0);
  const std::vector<std::uint8_t> turns = turning(model);
  double turn = 0.0;  // of the lightest
  for (const Loop& loop : model.loops.all)
    for (const int v : loop.rates)
      if (const auto at = static_cast<std::size_t>(v); turns[at]) turn = std::max(turn, model.loops.column_scale[at]);
  for (std::size_t i = 0; turn > 0.0 && i < in_turns_.size(); ++i) in_turns_[i] = turn / model.loops.column_scale[i];
}

double Holding::largest(std::span<const double> x) const {
  double most = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) most = std::max(most, std::abs(x[i]) * in_turns_[i]);
  return most;
}

bool Holding::accelerate() {
  tau_.assign(use_.tau, use_.tau + model_.nv);
  devices_.put_into(tau_.data(), wrenches_.data());
  Inputs in = use_;
  in.tau = tau_.data(), in.wrenches = wrenches_;
  return forward_dynamics(model_, workspace_, in, vdot_.data(), &devices_);
}

bool Holding::look(const DeviceForces& known, const Inputs& in, double t, const double* z, const double* marks) {
  devices_.take_commands(known);
  wrenches_.assign(in.wrenches.begin(), in.wrenches.end());
  use_ = in;
  if (fields_) use_.moment = &fields_->at(field_of_gravity(model_), t);
  devices_.set({t, z, marks, tau_.data(), wrenches_.data()});
  const bool good = accelerate();
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    const DeviceHold& h = model_.devices.holds[i];
    forces_[i] = model_.prescribed[static_cast<std::size_t>(h.v)] != 0 ? Force{0.0, devices_.most_held(h.device), true} : Force{};
  }
  if (good) {
    Inputs acting = use_;
    acting.tau = tau_.data(), acting.wrenches = wrenches_;
    observer_.prescribed_forces(acting, vdot_.data(), needed_.data());
    const double nothing = kIdle * largest(vdot_);
    for (std::size_t i = 0; i < forces_.size(); ++i)
      if (const auto v = static_cast<std::size_t>(model_.devices.holds[i].v); forces_[i].held)
        forces_[i].force = needed_[v] - tau_[v];
      else if (std::abs(vdot_[v]) * in_turns_[v] > nothing)
        forces_[i].acceleration = vdot_[v];
  }
  if (model_.loops.empty()) return good;
  if (good) share();
  if (!good || rows_that_counted(model_, workspace_) < model_.loops.rank) find_dead_centres();
  return good || std::ranges::any_of(forces_, [](const Force& f) { return f.leaves != 0; });
}

bool Holding::accelerate_alone(const double* v, double force_on, int component, double pace) {
  const Eigen::VectorXd bends = elastic_force(model_, use_.q, zero_.data());
  for (int i = 0; i < model_.nv; ++i) {
    const auto at = static_cast<std::size_t>(i);
    tau_[at] = (i == component ? force_on : 0.0) - bends[i];
    given_[at] = model_.has_given_motion(i) ? pace / in_turns_[at] : 0.0;
  }
  for (const Loop& loop : model_.loops.all)
    if (loop.drive >= 0) lengths_[static_cast<std::size_t>(loop.drive)] = {use_.drives[loop.drive].more, 0.0, pace * loop.lever};
  const Inputs in{.q = use_.q, .v = v, .tau = tau_.data(), .vdot = given_.data(), .gravity = false, .drives = lengths_.data()};
  return forward_dynamics(model_, workspace_, in, vdot_.data());
}

bool Holding::is_blocked(std::size_t hold, const double* q, const LoopDrive* drives) {
  use_.q = q, use_.drives = drives;
  const auto v = static_cast<std::size_t>(model_.devices.holds[hold].v);
  if (!accelerate_alone(zero_.data(), 1.0, static_cast<int>(v), 0.0)) return false;
  const double scale = model_.loops.column_scale[v];
  return std::abs(vdot_[v]) <= kBlocked * scale * scale;
}

bool Holding::is_blocked_by_others(std::size_t hold, const double* q, const LoopDrive* drives) {
  if (!is_blocked(hold, q, drives)) return false;
  held_ = own_->prescribed;
  for (const DeviceHold& h : model_.devices.holds) own_->prescribed[static_cast<std::size_t>(h.v)] = 0;
  const bool at_dead_centre = is_blocked(hold, q, drives);
  own_->prescribed = held_;
  return !at_dead_centre;
}

void Holding::find_dead_centres() {
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    if (!forces_[i].held) continue;
    own_->prescribed[static_cast<std::size_t>(model_.devices.holds[i].v)] = 0;
    forces_[i].leaves = way_out(i);
    devices_.weigh_again();
  }
}

// Let go it is not moved by forces on it (else something holds it), but by what else moves: at once, as what is given begins to move, or as
// the square of rates, present ones or those to come.
int Holding::way_out(std::size_t hold) {
  const auto v = static_cast<std::size_t>(model_.devices.holds[hold].v);
  const auto let_go = [&](bool all) {
    devices_.weigh_again();
    for (const DeviceHold& h : model_.devices.holds)
      if (const auto i = static_cast<std::size_t>(h.v); all || i == v) own_->prescribed[i] = 0;
  };
  const auto way = [&](const std::vector<double>& vdot, double size) {
    return std::abs(vdot[v]) * in_turns_[v] > kIdle * size ? vdot[v] > 0.0 ? 1 : -1 : 0;
  };
  let_go(false);
  if (!is_blocked(hold, use_.q, use_.drives)) return 0;
  const bool good = accelerate();
  std::vector<double> coming = vdot_;
  let_go(true);
  if (!accelerate()) return 0;
  const std::vector<double> at_most = vdot_;
  const bool blocked = is_blocked(hold, use_.q, use_.drives);  // not by others that are held
  if (!good && !blocked) return 0;
  if (!good) coming = at_most;
  const double size = largest(at_most);
  if (const int to = way(coming, size)) return to;
  if (blocked && accelerate_alone(zero_.data(), 0.0, -1, 1.0))
    if (const int to = way(vdot_, 1.0)) return to;
  if (good) let_go(false);
  const auto probe = [&](std::span<const double> rates, double least) {
    const double most = largest(rates);
    if (!(most > least)) return 0;
    for (std::size_t i = 0; i < probe_.size(); ++i) probe_[i] = rates[i] / most;
    return accelerate_alone(probe_.data(), 0.0, -1, 0.0) ? way(vdot_, 1.0) : 0;
  };
  const std::span<const double> rates(use_.v, zero_.size());
  const double still = kStands * largest(rates);
  bool goes_on = true;
  for (std::size_t i = 0; i < forces_.size(); ++i) {
    const auto held = static_cast<std::size_t>(model_.devices.holds[i].v);
    goes_on = goes_on && (!forces_[i].held || std::abs(rates[held]) * in_turns_[held] <= still);
  }
  const int to = goes_on ? probe(rates, kStill) : 0;
  return to != 0 ? to : probe(coming, kIdle * size);
}

// Of all forces f on what is held that multipliers can take one another's place with, those of least sum of squares of g = f / most; where
// these pass the most somewhere, that is pushed with there, and the rest takes what is left.
void Holding::share() {
  std::vector<int> components;
  std::vector<Force*> held;
  for (std::size_t i = 0; i < forces_.size(); ++i)
    if (forces_[i].held) components.push_back(model_.devices.holds[i].v), held.push_back(&forces_[i]);
  if (held.empty()) return;
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
