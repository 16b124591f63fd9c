#include "core/operators/sensitivity.hpp"

#include <fmt/format.h>

#include "core/soa/gravity_field.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using soa::Tangent;

std::size_t idx(int i) { return static_cast<std::size_t>(i); }

void copy_or_zero(const double* from, VectorXd& to) {
  if (from)
    std::copy(from, from + to.size(), to.data());
  else
    to.setZero();
}

/// Index p of m, h, J: the inertia that is 1 there.
RigidInertia<double> unit_inertia(int p) {
  double x[10] = {};
  x[p] = 1.0;
  return {x[0], {x[1], x[2], x[3]}, {x[4], x[5], x[6], x[7], x[8], x[9]}};
}

}  // namespace

Sensitivities::Sensitivities(std::shared_ptr<const Model> model, Springs springs)
    : model_(std::move(model)), springs_(springs == Springs::included), ws_(*model_), inertia_(*model_), tangent_(*model_), tree_(model_) {
  q_.setZero(model_->nq);
  for (VectorXd* x : {&v_, &vdot_, &tau_, &zeros_, &masked_, &work_}) x->setZero(model_->nv);
  rate_.setZero(model_->nq);
  q_t_.resize(idx(model_->nq));
  for (std::vector<Tangent>* x : {&v_t_, &vdot_t_, &tau_t_}) x->resize(idx(model_->nv));
  if (model_->world || model_->field.central) ws_.require_world();
}

void Sensitivities::at(const Inputs& in) {
  std::copy(in.q, in.q + model_->nq, q_.data());
  std::copy(in.v, in.v + model_->nv, v_.data());
  copy_or_zero(in.vdot, vdot_);
  gravity_ = in.gravity;
  wrenches_.assign(in.wrenches.begin(), in.wrenches.end());
  wrenches_t_.clear();
  for (const NodeWrench& w : wrenches_) wrenches_t_.push_back({w.node, w.world_axes, {cast<Tangent>(w.f.n), cast<Tangent>(w.f.f)}});
  articulated_ = posed_ = false;
  const Inputs use{.q = q_.data(), .v = v_.data(), .vdot = vdot_.data(), .wrenches = wrenches_, .gravity = gravity_};
  inverse_dynamics(*model_, ws_, use, tau_.data());
  if (!springs_) return;
  for (const Spring& s : model_->springs) tau_[s.v] += s.stiffness * (q_[s.q] - s.rest) + s.damping * v_[s.v];
}

void Sensitivities::solve(const Inputs& in) {
  copy_or_zero(in.tau, work_);
  if (springs_)
    for (const Spring& s : model_->springs) work_[s.v] -= s.stiffness * (in.q[s.q] - s.rest) + s.damping * in.v[s.v];
  copy_or_zero(in.vdot, masked_);
  for (int i = 0; i < model_->nv; ++i)
    if (!model_->has_prescribed() || !model_->prescribed[idx(i)]) masked_[i] = 0.0;
  Inputs use = in;
  use.tau = work_.data();
  use.vdot = masked_.data();
  VectorXd vdot(model_->nv);
  if (!forward_dynamics(*model_, ws_, use, vdot.data())) throw NumericsError(describe_breakdown(*model_, ws_.breakdown, 0.0));
  use.vdot = vdot.data();
  at(use);
}

void Sensitivities::inverse(const Direction& along, double* dtau) {
  const Model& m = *model_;
  if (along.q)
    m.qdot(q_.data(), along.q, rate_.data());
  else
    rate_.setZero();
  for (int i = 0; i < m.nq; ++i) q_t_[idx(i)] = {q_[i], rate_[i]};
  for (int i = 0; i < m.nv; ++i) {
    v_t_[idx(i)] = {v_[i], along.v ? along.v[i] : 0.0};
    vdot_t_[idx(i)] = {vdot_[i], along.vdot ? along.vdot[i] : 0.0};
  }
  inverse_dynamics(m, tangent_, {.q = q_t_.data(), .v = v_t_.data(), .vdot = vdot_t_.data(), .wrenches = wrenches_t_, .gravity = gravity_}, tau_t_.data());
  for (int i = 0; i < m.nv; ++i) dtau[i] = tau_t_[idx(i)].d;
  if (!springs_) return;
  for (const Spring& s : m.springs) dtau[s.v] += s.stiffness * rate_[s.q] + (along.v ? s.damping * along.v[s.v] : 0.0);
}

void Sensitivities::mass(const double* u, const double* w, double* dM_w) {
  const Model& m = *model_;
  m.qdot(q_.data(), u, rate_.data());
  for (int i = 0; i < m.nq; ++i) q_t_[idx(i)] = {q_[i], rate_[i]};
  for (int i = 0; i < m.nv; ++i) v_t_[idx(i)] = 0.0, vdot_t_[idx(i)] = w[i];
  inverse_dynamics(m, tangent_, {.q = q_t_.data(), .v = v_t_.data(), .vdot = vdot_t_.data()}, tau_t_.data(),
                   {.velocity = false, .gravity = false, .elastic = false});
  for (int i = 0; i < m.nv; ++i) dM_w[i] = tau_t_[idx(i)].d;
}

// P, D, G at q: as in a step, without velocities and loads.
void Sensitivities::articulate() {
  if (articulated_) return;
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const Inputs in{.q = q_.data(), .v = zeros_.data(), .vdot = zeros_.data(), .gravity = false};
  S.ground(*model_, inertia_, in);
  S.hinge_records(*model_, inertia_, in);
  for (const Run& run : model_->runs) S.outward(*model_, inertia_, in, run, {.velocity = false});
  for (auto run = model_->runs.rbegin(); run != model_->runs.rend(); ++run) {
    S.inward(*model_, inertia_, in, *run, {.bias = false});
    if (inertia_.breakdown.body != 0) throw NumericsError(describe_breakdown(*model_, inertia_.breakdown, 0.0));
  }
  articulated_ = true;
}

void Sensitivities::mass_inverse(const double* f, double* out) {
  articulate();
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const Inputs in{.q = q_.data(), .v = zeros_.data(), .tau = f, .vdot = zeros_.data(), .gravity = false};
  S.ground(*model_, inertia_, in);
  S.at_rest(*model_, inertia_);
  for (auto run = model_->runs.rbegin(); run != model_->runs.rend(); ++run) S.inward(*model_, inertia_, in, *run, {.inertia = false});
  for (const Run& run : model_->runs) S.acceleration(*model_, inertia_, in, run, out);
}

void Sensitivities::forward(const Direction& along, double* dvdot) {
  const Model& m = *model_;
  const auto given = [&](int i) { return m.has_prescribed() && m.prescribed[idx(i)]; };
  for (int i = 0; i < m.nv; ++i) masked_[i] = along.vdot && given(i) ? along.vdot[i] : 0.0;
  inverse({.q = along.q, .v = along.v, .vdot = masked_.data()}, work_.data());
  for (int i = 0; i < m.nv; ++i) work_[i] = (along.tau ? along.tau[i] : 0.0) - work_[i];
  mass_inverse(work_.data(), dvdot);
  for (int i = 0; i < m.nv; ++i)
    if (given(i)) dvdot[i] = masked_[i];
}

InverseDerivatives Sensitivities::inverse() {
  const int nv = model_->nv;
  InverseDerivatives out{MatrixXd(nv, nv), MatrixXd(nv, nv)};
  VectorXd unit = VectorXd::Zero(nv);
  for (int i = 0; i < nv; ++i) {
    unit[i] = 1.0;
    inverse({.q = unit.data()}, out.q.col(i).data());
    inverse({.v = unit.data()}, out.v.col(i).data());
    unit[i] = 0.0;
  }
  return out;
}

ForwardDerivatives Sensitivities::forward() {
  InverseDerivatives of_tau = inverse();
  ForwardDerivatives out{minus_inverse_of(std::move(of_tau.q)), minus_inverse_of(std::move(of_tau.v)), MatrixXd(model_->nv, model_->nv)};
  if (!mass_matrix_inverse(*model_, inertia_, q_.data(), out.tau.data())) throw NumericsError(describe_breakdown(*model_, inertia_.breakdown, 0.0));
  articulated_ = false;
  return out;
}

MatrixXd Sensitivities::minus_inverse_of(MatrixXd dtau) {
  for (Eigen::Index j = 0; j < dtau.cols(); ++j) {
    work_ = -dtau.col(j);
    mass_inverse(work_.data(), dtau.col(j).data());
  }
  return dtau;
}

// --- parameters -------------------------------------------------------------------------------------------------------------------

const UserBody& Sensitivities::user(int body) const {
  if (body < 0 || body >= static_cast<int>(model_->user.size()))
    throw InputError(Diagnostic{Code::unknown_body, {"sensitivity in a body's parameters", {}}, fmt::format("an index below {}", model_->user.size()),
                                fmt::format("{}", body), {}, {}, {}, 0});
  return model_->user[idx(body)];
}

const soa::TreeOperators& Sensitivities::tree() {
  if (!posed_) tree_.at(q_.data());
  posed_ = true;
  return tree_;
}

void Sensitivities::inverse_in_inertia(int body, const RigidInertia<double>& change, double* dtau) {
  const Model& m = *model_;
  const UserBody& u = user(body);
  if (u.n_modes > 0)
    throw InputError(Diagnostic{Code::unsupported, {"sensitivity in the inertia of " + u.name, {}}, "a rigid body", "a flexible one", {}, {}, {}, 0});
  std::fill(dtau, dtau + m.nv, 0.0);
  const int k = u.sweep;
  if (k == 0) return;  // fixed to the ground
  const SweepBody& b = m.bodies[idx(k)];
  Vec3<double> w = ws_.core(k).w;
  Motion<double> gamma = ws_.core(k).gamma;
  if (b.kind == KernelKind::rotor) {  // the sweeps know its carrier's motion only
    const soa::Core<double>& A = ws_.core(b.parent);
    const Pose<double> X = soa::pose_in_inboard(m, ws_, k, q_.data());
    const Vec3<double> w1 = transpose_times(X.R, A.w), rate = v_[b.v] * b.axis;
    w = w1 + rate;
    gamma = {transpose_times(X.R, A.gamma.w) + cross(w1, rate) + vdot_[b.v] * b.axis,
             transpose_times(X.R, A.gamma.v + cross(A.gamma.w, X.p) + cross(A.w, cross(A.w, X.p)))};
  }
  const RigidInertia<double> dM = to_inboard(u.pose, change);
  Force<double> f = dM * gamma + gyroscopic(dM, w);
  if (gravity_ && m.field.central && b.M.m > 0.0) {
    const RigidInertia<Tangent> M{{b.M.m, dM.m}, {{b.M.h.x, dM.h.x}, {b.M.h.y, dM.h.y}, {b.M.h.z, dM.h.z}},
                                  {{b.M.J.xx, dM.J.xx}, {b.M.J.yy, dM.J.yy}, {b.M.J.zz, dM.J.zz}, {b.M.J.xy, dM.J.xy}, {b.M.J.xz, dM.J.xz}, {b.M.J.yz, dM.J.yz}}};
    Vec3<Tangent> c, r;
    const Force<Tangent> pull = soa::attraction(m.field, M, cast<Tangent>(ws_.pose_W(k)), c, r);
    f -= Force<double>{{pull.n.x.d, pull.n.y.d, pull.n.z.d}, {pull.f.x.d, pull.f.y.d, pull.f.z.d}};
  }
  // H phi f with f on one body
  const soa::TreeOperators& ops = tree();
  int i = ops.index_of(k);
  const Pose<double>& frame = m.user[idx(ops.bodies()[idx(i)].user)].pose;
  VectorXd up = to_eigen(to_outboard(frame, f));
  while (true) {
    const soa::OperatorBody& at = ops.bodies()[idx(i)];
    Eigen::Map<VectorXd>(dtau + at.v, at.nh + at.m) = ops.Ht_all(i).transpose() * up;
    if (at.parent < 0) return;
    up = (ops.A(i).transpose() * up.head<6>()).eval();
    i = at.parent;
  }
}

MatrixXd Sensitivities::inverse_in_inertia(int body) {
  MatrixXd out(model_->nv, 10);
  for (int p = 0; p < 10; ++p) inverse_in_inertia(body, unit_inertia(p), out.col(p).data());
  return out;
}
MatrixXd Sensitivities::forward_in_inertia(int body) { return minus_inverse_of(inverse_in_inertia(body)); }

MatrixXd Sensitivities::inverse_in_stiffness(int body, Stiffness which) const {
  const UserBody& u = user(body);
  const int m = u.n_modes, columns = which == Stiffness::diagonal ? m : m * (m + 1) / 2;
  MatrixXd out = MatrixXd::Zero(model_->nv, columns);
  int column = 0;
  for (int i = 0; i < m; ++i)
    for (int j = which == Stiffness::diagonal ? i : 0; j <= i; ++j, ++column) {
      out(u.etadot + i, column) = q_[u.eta + j];
      out(u.etadot + j, column) = q_[u.eta + i];
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

Eigen::Matrix3d minus_tilde(const double* a) {
  return (Eigen::Matrix3d() << 0, a[2], -a[1], -a[2], 0, a[0], a[1], -a[0], 0).finished();
}

}  // namespace

Eigen::SparseMatrix<double> kinematic_rates(const Model& model, const double* q, const double* v) {
  std::vector<Eigen::Triplet<double>> entries;
  for (const int i : model.curved) {
    const UserBody& u = model.user[idx(i)];
    MatrixXd C = MatrixXd::Zero(u.nv, u.nv);
    switch (u.hinge->shape) {
      case CARDAN_SHAPE_FREE_BODY:
        C.bottomLeftCorner<3, 3>() = minus_tilde(v + u.v + 3);
        C.bottomRightCorner<3, 3>() = minus_tilde(v + u.v);
        [[fallthrough]];
      case CARDAN_SHAPE_FREE:
      case CARDAN_SHAPE_BALL: C.topLeftCorner<3, 3>() = minus_tilde(v + u.v); break;
      default: C = rates_by_differences(*u.hinge, u.hinge_packed.data(), q + u.q, v + u.v);
    }
    for (int c = 0; c < u.nv; ++c)
      for (int r = 0; r < u.nv; ++r)
        if (C(r, c) != 0.0) entries.emplace_back(u.v + r, u.v + c, C(r, c));
  }
  Eigen::SparseMatrix<double> out(model.nv, model.nv);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

}  // namespace cardan
