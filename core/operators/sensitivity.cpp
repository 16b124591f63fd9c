#include "core/operators/sensitivity.hpp"

#include <fmt/format.h>

#include "core/base/poll.hpp"
#include "core/dynamics/batch.hpp"
#include "core/dynamics/fields.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/mass_flow.hpp"
#include "core/model/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/soa/kernels_tangent.hpp"
#include "core/soa/program.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using soa::Tangent;

void copy_or_zero(const double* from, VectorXd& to) {
  if (from)
    std::copy(from, from + to.size(), to.data());
  else
    to.setZero();
}

/// Unit vectors as directions, of which `member` of Direction is set.
std::vector<Direction> unit_directions(const MatrixXd& identity, const double* Direction::*member) {
  std::vector<Direction> all(static_cast<std::size_t>(identity.cols()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i].*member = identity.col(static_cast<Eigen::Index>(i)).data();
  return all;
}

/// Index p of m, h, J: the inertia that is 1 there.
RigidInertia<double> unit_inertia(int p) {
  double x[10] = {};
  x[p] = 1.0;
  return {x[0], {x[1], x[2], x[3]}, {x[4], x[5], x[6], x[7], x[8], x[9]}};
}

}  // namespace

Sensitivities::Sensitivities(std::shared_ptr<const Model> model, Springs springs) : Sensitivities(std::move(model), nullptr, springs) {}
Sensitivities::Sensitivities(const TreeOperators& tree, Springs springs) : Sensitivities(tree.model_pointer(), &tree, springs) {}

Sensitivities::Sensitivities(std::shared_ptr<const Model> model, const TreeOperators* tree, Springs springs)
    : model_((require_open_tree(*model, "sensitivities"), std::move(model))), springs_(springs == Springs::included), ws_(*model_) {
  const int nv = model_->nv;
  component_.resize(tree ? tree->size(Space::hinge) : nv);
  place_.resize(nv);
  for (int v = 0; v < nv; ++v)
    if ((place_[v] = tree ? tree->place_of_velocity(v) : v) >= 0) component_[place_[v]] = v;
  for (int i = 0; i < size(); ++i)
    given_.push_back((model_->has_prescribed() && model_->prescribed[component_[i]]) || (tree && !tree->is_free(i)));
  if (tree && (!tree->whole() || tree->is_masked())) {
    bodies_ = tree->sweep_bodies();
    part_ = std::make_shared<const Part>(part_of(*model_, bodies_));
  }
  for (VectorXd* x : {&q_, &rate_}) x->setZero(model_->nq);
  for (VectorXd* x : {&v_, &vdot_, &tau_, &masked_, &work_}) x->setZero(size());
  for (VectorXd* x : {&v_all_, &vdot_all_, &tau_all_, &zeros_}) x->setZero(nv);
  q_t_.resize(model_->nq);
  for (std::vector<Tangent>* x : {&v_t_, &vdot_t_, &tau_t_}) x->assign(nv, Tangent(0.0));
  if (model_->world || model_->field.pulls()) ws_.require_world();
}

soa::Workspace<Tangent>& Sensitivities::tangent() {
  if (!tangent_) tangent_.emplace(*model_);
  if (devices_) tangent_->require_world();
  return *tangent_;
}
Workspace& Sensitivities::inertia() {
  if (!inertia_) inertia_.emplace(*model_);
  return *inertia_;
}

const double* Sensitivities::on_model(const VectorXd& x, VectorXd& all) const {
  for (int i = 0; i < size(); ++i) all[component_[i]] = x[i];
  return all.data();
}

/// The rate of q along u; null: 0.
void Sensitivities::set_rate(const double* u) {
  if (!u) {
    rate_.setZero();
    return;
  }
  model_->qdot(q_.data(), on_model(Eigen::Map<const VectorXd>(u, size()), tau_all_), rate_.data());
}

void Sensitivities::require_point() const {
  if (!has_point_) refuse(Code::operator_stage, {"sensitivities"}, "a point: q, v and v'", "none yet", "call at() or solve() first");
}

void Sensitivities::at(const Inputs& in, const DeviceForces* devices) {
  if ((!in.q && model_->nq > 0) || (!in.v && model_->nv > 0))
    refuse(Code::operator_shape, {"point of the sensitivities"}, "q and v", "a null pointer");
  has_point_ = true;
  std::copy(in.q, in.q + model_->nq, q_.data());
  for (int i = 0; i < size(); ++i) {
    v_[i] = in.v[component_[i]];
    vdot_[i] = in.vdot ? in.vdot[component_[i]] : 0.0;
  }
  gravity_ = in.gravity;
  moment_ = kept_moment(*model_, in.moment);
  wrenches_.assign(in.wrenches.begin(), in.wrenches.end());
  wrenches_t_.clear();
  for (const NodeWrench& w : wrenches_) wrenches_t_.push_back({w.node, w.world_axes, {cast<Tangent>(w.f.n), cast<Tangent>(w.f.f)}});
  articulated_ = posed_ = false;
  devices_.reset();
  if (devices && !part_) {
    devices_.emplace(*model_, *devices);
    z_t_.assign(model_->devices.n_z, Tangent(0.0));
    device_tau_.assign(model_->nv, Tangent(0.0));
  }
  evaluate();
}

/// What they push with at nodes into the wrenches, minus that at hinges into dtau: at q and v as they are, with their rates.
void Sensitivities::let_devices_act(double* dtau) {
  const Model& m = *model_;
  const soa::Sweeps<Tangent>& S = soa::sweeps<Tangent>();
  const soa::Inputs<Tangent> in{
      .q = q_t_.data(), .v = v_t_.data(), .vdot = vdot_t_.data(), .wrenches = wrenches_t_, .moment = moment_.get()};
  tangent().articulated = false;
  S.ground(m, tangent(), in);
  soa::run_kinematics<Tangent>(m, S, tangent(), in);
  std::ranges::fill(device_tau_, Tangent(0.0));
  devices_->set({0.0, z_t_.data(), nullptr, device_tau_.data(), wrenches_t_.data()});
  if (!devices_->act(tangent(), in)) throw devices_->fault();
  for (int i = 0; i < m.nv; ++i) dtau[i] -= device_tau_[i].d;
}

void Sensitivities::evaluate() {
  inverse_dynamics(*model_, ws_,
                   {.q = q_.data(),
                    .v = on_model(v_, v_all_),
                    .vdot = on_model(vdot_, vdot_all_),
                    .wrenches = wrenches_,
                    .gravity = gravity_,
                    .moment = moment_.get()},
                   tau_all_.data(), {}, part_.get());
  for (int i = 0; i < size(); ++i) tau_[i] = tau_all_[component_[i]];
  for (const HingeLoad& load : model_->loads)
    if (const int i = place_[load.v]; springs_ && i >= 0) tau_[i] -= hinge_laws::force(load, q_[load.q], v_[i]);
}

void Sensitivities::solve(const Inputs& in, const DeviceForces* devices) {
  if ((!in.q && model_->nq > 0) || (!in.v && model_->nv > 0))
    refuse(Code::operator_shape, {"point of the sensitivities"}, "q and v", "a null pointer");
  for (int i = 0; i < size(); ++i) masked_[i] = in.vdot && given_[i] ? in.vdot[component_[i]] : 0.0;
  Inputs use = in;
  VectorXd vdot = VectorXd::Zero(model_->nv);
  use.vdot = on_model(masked_, vdot);
  if (part_) {
    at(use);
    for (int i = 0; i < size(); ++i) work_[i] = (in.tau ? in.tau[component_[i]] : 0.0) - tau_[i];
    VectorXd solved(size());
    mass_inverse(work_.data(), solved.data());
    vdot_ += solved;
    evaluate();
    return;
  }
  copy_or_zero(in.tau, work_);
  if (springs_) hinge_laws::add_forces(*model_, in.q, in.v, work_.data());
  use.tau = work_.data();
  VectorXd found(model_->nv);
  if (!forward_dynamics(*model_, ws_, use, found.data())) throw NumericsError(describe_breakdown(*model_, ws_.breakdown, 0.0));
  use.vdot = found.data();
  at(use, devices);
}

void Sensitivities::inverse(const Direction& along, double* dtau) {
  require_point();
  const Model& m = *model_;
  set_rate(along.q);
  for (int i = 0; i < m.nq; ++i) q_t_[i] = {q_[i], rate_[i]};
  for (int i = 0; i < size(); ++i) {
    const std::size_t at = (component_[i]);
    v_t_[at] = {v_[i], along.v ? along.v[i] : 0.0};
    vdot_t_[at] = {vdot_[i], along.vdot ? along.vdot[i] : 0.0};
  }
  std::fill_n(dtau, size(), 0.0);
  if (devices_) let_devices_act(dtau);
  inverse_dynamics(
      m, tangent(),
      {.q = q_t_.data(), .v = v_t_.data(), .vdot = vdot_t_.data(), .wrenches = wrenches_t_, .gravity = gravity_, .moment = moment_.get()},
      tau_t_.data(), {}, part_.get());
  for (int i = 0; i < size(); ++i) dtau[i] += tau_t_[component_[i]].d;
  for (const HingeLoad& load : m.loads)
    if (const int i = place_[load.v]; springs_ && i >= 0)
      dtau[i] -= hinge_laws::force<Tangent>(load, {q_[load.q], rate_[load.q]}, {v_[i], along.v ? along.v[i] : 0.0}).d;
}

/// Working memory of eight directions at once.
struct Sensitivities::SideBySide {
  explicit SideBySide(const Model& model) : work(model), q(model.nq), v(model.nv), vdot(model.nv), tau(model.nv) {
    if (Batch::takes(model)) batch.emplace(model);
  }
  soa::Workspace<soa::Tangents> work;
  std::vector<soa::Tangents> q, v, vdot, tau;
  std::vector<soa::NodeWrench<soa::Tangents>> wrenches;
  std::optional<Batch> batch;
};

Sensitivities::SideBySide& Sensitivities::beside() {
  if (!side_) side_ = {new SideBySide(*model_), [](SideBySide* s) { delete s; }};
  return *side_;
}

void Sensitivities::inverse_side_by_side(std::span<const Direction> along, double* dtau) {
  using soa::Tangents;
  const Model& m = *model_;
  SideBySide& s = beside();
  s.wrenches.clear();
  for (const NodeWrench& w : wrenches_) s.wrenches.push_back({w.node, w.world_axes, {cast<Tangents>(w.f.n), cast<Tangents>(w.f.f)}});
  for (int i = 0; i < m.nq; ++i) s.q[i] = q_[i];
  for (int i = 0; i < size(); ++i) {
    s.v[component_[i]] = v_[i];
    s.vdot[component_[i]] = vdot_[i];
  }
  for (std::size_t d = 0; d < along.size(); ++d) {
    const int lane = 1 + static_cast<int>(d);
    if (along[d].q) {
      set_rate(along[d].q);
      for (int i = 0; i < m.nq; ++i) set_lane(s.q[i], lane, rate_[i]);
    }
    for (int i = 0; i < size(); ++i) {
      if (along[d].v) set_lane(s.v[component_[i]], lane, along[d].v[i]);
      if (along[d].vdot) set_lane(s.vdot[component_[i]], lane, along[d].vdot[i]);
    }
  }
  inverse_dynamics(
      m, s.work,
      {.q = s.q.data(), .v = s.v.data(), .vdot = s.vdot.data(), .wrenches = s.wrenches, .gravity = gravity_, .moment = moment_.get()},
      s.tau.data());
  for (std::size_t d = 0; d < along.size(); ++d, dtau += size()) {
    const int lane = 1 + static_cast<int>(d);
    for (int i = 0; i < size(); ++i) dtau[i] = soa::along(s.tau[component_[i]], lane - 1).d;
    for (const HingeLoad& load : m.loads)
      if (const int i = place_[load.v]; springs_ && i >= 0)
        dtau[i] -= hinge_laws::force<Tangent>(load, soa::along(s.q[load.q], lane - 1), soa::along(s.v[load.v], lane - 1)).d;
  }
}

void Sensitivities::inverse(std::span<const Direction> along, double* dtau) {
  require_point();
  while (!along.empty()) {
    Poll::now();
    const std::span<const Direction> now = along.first(std::min<std::size_t>(along.size(), side_by_side() ? soa::kDirections : 1));
    if (side_by_side())
      inverse_side_by_side(now, dtau);
    else
      inverse(now.front(), dtau);
    along = along.subspan(now.size());
    dtau += static_cast<std::ptrdiff_t>(now.size()) * size();
  }
}

void Sensitivities::forward(std::span<const Direction> along, double* dvdot) {
  MatrixXd given = MatrixXd::Zero(size(), static_cast<Eigen::Index>(along.size()));
  std::vector<Direction> of_tau;
  std::vector<Eigen::Index> columns;  // of those along which tau of inverse dynamics changes
  for (std::size_t d = 0; d < along.size(); ++d) {
    const auto column = static_cast<Eigen::Index>(d);
    if (!along[d].q && !along[d].v && !along[d].vdot) continue;
    for (int i = 0; i < size(); ++i)
      if (along[d].vdot && given_[i]) given(i, column) = along[d].vdot[i];
    of_tau.push_back({.q = along[d].q, .v = along[d].v, .vdot = along[d].vdot ? given.col(column).data() : nullptr});
    columns.push_back(column);
  }
  MatrixXd dtau(given.rows(), static_cast<Eigen::Index>(columns.size())), f = MatrixXd::Zero(given.rows(), given.cols());
  inverse(of_tau, dtau.data());
  for (std::size_t i = 0; i < columns.size(); ++i) f.col(columns[i]) = -dtau.col(static_cast<Eigen::Index>(i));
  for (std::size_t d = 0; d < along.size(); ++d)
    if (along[d].tau) f.col(static_cast<Eigen::Index>(d)) += Eigen::Map<const VectorXd>(along[d].tau, size());
  mass_inverse(static_cast<int>(along.size()), f.data(), dvdot);
  Eigen::Map<MatrixXd> out(dvdot, f.rows(), f.cols());
  for (int i = 0; i < size(); ++i)
    if (given_[i]) out.row(i) = given.row(i);
}

void Sensitivities::mass(const double* u, const double* w, double* dM_w) {
  require_point();
  const Model& m = *model_;
  set_rate(u);
  for (int i = 0; i < m.nq; ++i) q_t_[i] = {q_[i], rate_[i]};
  for (int i = 0; i < size(); ++i) v_t_[component_[i]] = 0.0, vdot_t_[component_[i]] = w[i];
  inverse_dynamics(m, tangent(), {.q = q_t_.data(), .v = v_t_.data(), .vdot = vdot_t_.data()}, tau_t_.data(),
                   {.velocity = false, .gravity = false, .elastic = false}, part_.get());
  for (int i = 0; i < size(); ++i) dM_w[i] = tau_t_[component_[i]].d;
}

// P, D, G at q: as in a step, without velocities and loads.
void Sensitivities::articulate() {
  if (articulated_) return;
  if (part_) {
    tree();
    std::vector<std::uint8_t> free;
    for (const std::uint8_t given : given_) free.push_back(!given);
    sub_->articulate({.free = free});
    articulated_ = true;
    return;
  }
  if (!articulate_at_rest(*model_, inertia(), q_.data())) throw NumericsError(describe_breakdown(*model_, inertia().breakdown, 0.0));
  articulated_ = true;
}

void Sensitivities::mass_inverse(const double* f, double* out) {
  require_point();
  articulate();
  if (part_) return apply(letters::mass_inverse, *sub_, f, out);
  solve_mass(*model_, inertia(), q_.data(), f, out);
}

/// M^-1 of n columns, each of the hinge space.
void Sensitivities::mass_inverse(int n, const double* f, double* out) {
  // The hinge space of a whole tree is in the order of v. A direction without inertia is named by the sweeps of one state.
  if (side_by_side() && n > 1 && beside().batch && side_->batch->mass_inverse(q_.data(), n, f, out)) return;
  for (int j = 0; j < n; ++j) {
    Poll::now();
    mass_inverse(f + static_cast<std::ptrdiff_t>(j) * size(), out + static_cast<std::ptrdiff_t>(j) * size());
  }
}

void Sensitivities::forward(const Direction& along, double* dvdot) {
  for (int i = 0; i < size(); ++i) masked_[i] = along.vdot && given_[i] ? along.vdot[i] : 0.0;
  inverse({.q = along.q, .v = along.v, .vdot = masked_.data()}, work_.data());
  for (int i = 0; i < size(); ++i) work_[i] = (along.tau ? along.tau[i] : 0.0) - work_[i];
  mass_inverse(work_.data(), dvdot);
  for (int i = 0; i < size(); ++i)
    if (given_[i]) dvdot[i] = masked_[i];
}

InverseDerivatives Sensitivities::inverse() {
  const int nv = size();
  const MatrixXd identity = MatrixXd::Identity(nv, nv);
  InverseDerivatives out{MatrixXd(nv, nv), MatrixXd(nv, nv)};
  inverse(unit_directions(identity, &Direction::q), out.q.data());
  inverse(unit_directions(identity, &Direction::v), out.v.data());
  return out;
}

ForwardDerivatives Sensitivities::forward() {
  InverseDerivatives of_tau = inverse();
  ForwardDerivatives out{minus_inverse_of(std::move(of_tau.q)), minus_inverse_of(std::move(of_tau.v)), MatrixXd(size(), size())};
  if (part_) {
    out.tau = minus_inverse_of(-MatrixXd::Identity(size(), size()));
    return out;
  }
  if (!mass_matrix_inverse(*model_, inertia(), q_.data(), out.tau.data()))
    throw NumericsError(describe_breakdown(*model_, inertia().breakdown, 0.0));
  articulated_ = false;
  return out;
}

MatrixXd Sensitivities::minus_inverse_of(MatrixXd dtau) {
  MatrixXd out(dtau.rows(), dtau.cols());
  dtau = -dtau;
  mass_inverse(static_cast<int>(dtau.cols()), dtau.data(), out.data());
  return out;
}

// --- parameters -------------------------------------------------------------------------------------------------------------------

const UserBody& Sensitivities::user(int body) const {
  if (body < 0 || body >= static_cast<int>(model_->user.size()))
    refuse(Code::unknown_body, {"sensitivity in a body's parameters"}, fmt::format("an index below {}", model_->user.size()),
           fmt::format("{}", body));
  const UserBody& u = model_->user[body];
  if (part_ && !part_->takes_part[u.sweep])
    refuse(Code::unknown_body, {"sensitivity in a body's parameters"}, "a body that takes part", "\"" + u.name + "\"");
  return u;
}

const TreeOperators& Sensitivities::tree() {
  if (!posed_) {
    sub_.reset();  // lets go of the blocks of the last q
    if (!tree_) tree_.emplace(model_);
    tree_->at(q_.data());
    if (part_) sub_.emplace(tree_->subgraph(bodies_));
  }
  posed_ = true;
  return sub_ ? *sub_ : *tree_;
}

void Sensitivities::inverse_in_inertia(int body, const RigidInertia<double>& change, double* dtau) {
  require_point();
  const Model& m = *model_;
  const UserBody& u = user(body);
  if (u.n_modes > 0) refuse(Code::unsupported, {"sensitivity in the inertia of " + u.name}, "a rigid body", "a flexible one");
  std::fill(dtau, dtau + size(), 0.0);
  const int k = u.sweep;
  if (k == 0) return;  // fixed to the ground
  const BodyMotion<double> moves =
      motion_of_body<double>(m, ws_, {.q = q_.data(), .v = v_all_.data()}, k, vdot_all_.data(), After::inverse);
  const RigidInertia<double> dM = to_inboard(u.pose, change);
  const Force<double> f = force_of_inertia(m, k, dM, {moves, m.field.pulls() ? ws_.pose_W(k) : Pose<double>{}}, gravity_, moment_.get());
  // H phi f with f on one body
  const TreeOperators& ops = tree();
  int i = ops.index_of(k);
  const Pose<double>& frame = m.user[ops.bodies()[i].user].pose;
  VectorXd up = to_eigen(to_outboard(frame, f));
  while (true) {
    const OperatorBody& at = ops.bodies()[i];
    Eigen::Map<VectorXd>(dtau + at.v, at.nh + at.m) = ops.Ht_all(i).transpose() * up;
    if (at.parent < 0) return;
    up = (ops.A(i).transpose() * up.head<6>()).eval();
    i = at.parent;
  }
}

MatrixXd Sensitivities::inverse_in_inertia(int body) {
  MatrixXd out(size(), 10);
  for (int p = 0; p < 10; ++p) inverse_in_inertia(body, unit_inertia(p), out.col(p).data());
  return out;
}
MatrixXd Sensitivities::forward_in_inertia(int body) { return minus_inverse_of(inverse_in_inertia(body)); }

MatrixXd Sensitivities::inverse_in_stiffness(int body, Stiffness which) const {
  require_point();
  const UserBody& u = user(body);
  const int m = u.n_modes, columns = which == Stiffness::diagonal ? m : m * (m + 1) / 2;
  MatrixXd out = MatrixXd::Zero(size(), columns);
  const int first = m > 0 ? place_[u.etadot] : 0;
  int column = 0;
  for (int i = 0; i < m; ++i)
    for (int j = which == Stiffness::diagonal ? i : 0; j <= i; ++j, ++column) {
      out(first + i, column) = q_[u.eta + j];
      out(first + j, column) = q_[u.eta + i];
    }
  return out;
}
MatrixXd Sensitivities::forward_in_stiffness(int body, Stiffness which) { return minus_inverse_of(inverse_in_stiffness(body, which)); }

// --- kinematics --------------------------------------------------------------------------------------------------------------------

namespace {

/// d/dt of theta = difference(q, p) along v, where p = retract(q, theta) for theta = s e_j, derived by s: a difference of differences.
MatrixXd rates_by_differences(const cardan_hinge_family& f, const void* packed, const double* q, const double* v) {
  constexpr double kStep = 0.02;  // twice: h^8 and eps / h^2 are both of order 1e-13
  const int nq = static_cast<int>(f.nq), nv = static_cast<int>(f.nv);
  const double speed = std::max(1e-3, Eigen::Map<const VectorXd>(v, nv).cwiseAbs().maxCoeff());
  VectorXd dir(nv), p(nq), p_rate(nq), q_rate(nq), q_now(nq), p_now(nq), work(nv), inner(nv), outer(nv);
  MatrixXd C(nv, nv);
  f.qdot(packed, q, v, q_rate.data());
  for (int j = 0; j < nv; ++j) {
    const auto rate = [&](double s, double* out) {  // of theta = s e_j
      dir.setZero();
      dir[j] = s;
      f.retract(packed, q, dir.data(), p.data());
      f.qdot(packed, p.data(), v, p_rate.data());
      const auto theta = [&](double t, double* to) {
        q_now = Eigen::Map<const VectorXd>(q, nq) + t * q_rate;
        p_now = p + t * p_rate;
        f.difference(packed, q_now.data(), p_now.data(), to);
      };
      soa::derivative(theta, kStep / speed, nv, out, inner.data());
    };
    soa::derivative(rate, kStep, nv, C.col(j).data(), outer.data());
  }
  return C;
}

Eigen::Matrix3d minus_tilde(const double* a) { return (Eigen::Matrix3d() << 0, a[2], -a[1], -a[2], 0, a[0], a[1], -a[0], 0).finished(); }

}  // namespace

Eigen::SparseMatrix<double> kinematic_rates(const Model& model, const double* q, const double* v) {
  std::vector<Eigen::Triplet<double>> entries;
  for (const int i : model.curved) {
    const UserBody& u = model.user[i];
    MatrixXd C = MatrixXd::Zero(u.nv, u.nv);
    switch (u.hinge->shape) {
      case CARDAN_SHAPE_FREE_BODY:
        C.bottomLeftCorner<3, 3>() = minus_tilde(v + u.v + 3);
        C.bottomRightCorner<3, 3>() = minus_tilde(v + u.v);
        [[fallthrough]];
      case CARDAN_SHAPE_FREE:
      case CARDAN_SHAPE_BALL:
        C.topLeftCorner<3, 3>() = minus_tilde(v + u.v);
        break;
      default:
        C = rates_by_differences(*u.hinge, u.hinge_packed.data(), q + u.q, v + u.v);
    }
    for (int c = 0; c < u.nv; ++c)
      for (int r = 0; r < u.nv; ++r)
        if (C(r, c) != 0.0) entries.emplace_back(u.v + r, u.v + c, C(r, c));
  }
  Eigen::SparseMatrix<double> out(model.nv, model.nv);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

}  // namespace cardan::operators
