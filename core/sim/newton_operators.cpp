#include "core/sim/newton_operators.hpp"

#include <Eigen/Core>

#include <algorithm>

#include "core/dynamics/forward.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/soa/kernels_tangent.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

using soa::Tangent;

/// Derivative of N(q) v of a hinge with a quaternion.
void quaternion_rates(const UserBody& u, const Tangent* q, const Tangent* v, double* out) {
  const Tangent &w = q[0], &x = q[1], &y = q[2], &z = q[3], half(0.5);
  out[0] = (-half * (x * v[0] + y * v[1] + z * v[2])).d;
  out[1] = (half * (w * v[0] + y * v[2] - z * v[1])).d;
  out[2] = (half * (w * v[1] + z * v[0] - x * v[2])).d;
  out[3] = (half * (w * v[2] + x * v[1] - y * v[0])).d;
  if (u.hinge->shape == CARDAN_SHAPE_BALL) return;
  Vec3<Tangent> shift{v[3], v[4], v[5]};
  if (u.hinge->shape == CARDAN_SHAPE_FREE_BODY) shift = rotation_of_quaternion(w, x, y, z) * shift;
  out[4] = shift.x.d, out[5] = shift.y.d, out[6] = shift.z.d;
}

/// The same of any other hinge, by coordinates and differences of eighth order. scratch: 3 nq + 2 nv numbers.
void other_rates(const UserBody& u, const Tangent* q, const Tangent* v, double* out, double* scratch) {
  constexpr double kStep = 0.01;
  double *at = scratch, *sum = at + u.nq, *work = sum + u.nq, *w = work + u.nq, *dw = w + u.nv;
  for (int i = 0; i < u.nq; ++i) at[i] = q[i].x;
  for (int i = 0; i < u.nv; ++i) w[i] = v[i].x, dw[i] = v[i].d;
  const void* packed = u.hinge_packed.data();
  u.hinge->qdot(packed, at, dw, out);
  for (int i = 0; i < u.nq; ++i) {
    if (q[i].d == 0.0) continue;
    soa::derivative([&](double s, double* to) { at[i] = q[i].x + s, u.hinge->qdot(packed, at, w, to); }, kStep, u.nq, sum, work);
    at[i] = q[i].x;
    for (int j = 0; j < u.nq; ++j) out[j] += q[i].d * sum[j];
  }
}

}  // namespace

NewtonOperators::NewtonOperators(std::shared_ptr<const Model> model, const DeviceForces* devices)
    : model_((require_open_tree(*model, "Newton's equations by linear_solver krylov"), std::move(model))),
      tangent_(*model_),
      tree_(model_),
      mass_(tree_),
      inverse_(tree_) {
  const Model& m = *model_;
  if (devices) devices_ = std::make_unique<DeviceTangents>(m, *devices), z_t_.resize(m.devices.n_z), tangent_.require_world();
  q_t_.resize(m.nq);
  for (const int i : m.curved) scratch_.resize(std::max<std::size_t>(scratch_.size(), 3 * m.user[i].nq + 2 * m.user[i].nv));
  for (auto* x : {&v_t_, &tau_t_, &vdot_given_t_, &vdot_t_}) x->resize(m.nv);
  for (Eigen::VectorXd* x : {&at_, &rhs_, &dv_}) x->setZero(m.nv);
  q_.resize(m.nq), W_.resize(m.nv);
  for (int i = 0; m.has_prescribed() && i < m.nv; ++i) free_.push_back(is_free(i));
  for (const PlainRates& r : m.plain_rates)
    for (int i = 0; i < r.n; ++i)
      if (!is_free(r.v + i) && std::ranges::find(m.devices.holds, r.v + i, &DeviceHold::v) == m.devices.holds.end())
        given_q_.push_back(r.q + i);
}

/// visit(first coordinate, first velocity, modes, body).
template <class Visit>
void NewtonOperators::each_flexible(const Visit& visit) const {
  for (const SweepBody& b : model_->bodies)
    if (b.n_modes > 0) visit(b.eta, b.etadot, b.n_modes, model_->flexible[b.flexible]);
}

bool NewtonOperators::jacobian_times(const soa::Inputs<double>& in, const double* dx, double* J_dx) {
  const Model& m = *model_;
  const double *dq = dx, *dv = dx + m.nq;
  for (int i = 0; i < m.nq; ++i) q_t_[i] = {in.q[i], dq[i]};
  for (int i = 0; i < m.nv; ++i) v_t_[i] = {in.v[i], is_free(i) ? dv[i] : 0.0}, tau_t_[i] = in.tau[i], vdot_given_t_[i] = in.vdot[i];
  for (const int i : given_q_) q_t_[i].d = 0.0;
  for (const HingeLoad& load : m.loads) tau_t_[load.v].d += hinge_laws::force<Tangent>(load, q_t_[load.q], v_t_[load.v]).d;
  wrenches_t_.clear();
  for (const NodeWrench& w : in.wrenches) wrenches_t_.push_back({w.node, w.world_axes, {cast<Tangent>(w.f.n), cast<Tangent>(w.f.f)}});
  const soa::Inputs<Tangent> along{.q = q_t_.data(),
                                   .v = v_t_.data(),
                                   .tau = tau_t_.data(),
                                   .vdot = vdot_given_t_.data(),
                                   .wrenches = wrenches_t_,
                                   .gravity = in.gravity,
                                   .moment = in.moment};
  if (devices_) {
    for (int i = 0; i < m.devices.n_z; ++i) z_t_[i] = {0.0, dv[m.nv + i]};  // their values are those of the last evaluation
    devices_->set({0.0, z_t_.data(), nullptr, tau_t_.data(), wrenches_t_.data()});
  }
  if (!forward_dynamics(m, tangent_, along, vdot_t_.data(), devices_.get())) return false;
  if (devices_) std::copy_n(devices_->zdot(), m.devices.n_z, J_dx + m.nq + m.nv);
  for (int i = 0; i < m.nv; ++i) J_dx[m.nq + i] = vdot_t_[i].d;
  for (const PlainRates& r : m.plain_rates) std::copy_n(dv + r.v, r.n, J_dx + r.q);
  for (const int i : given_q_) J_dx[i] = 0.0;
  for (const int i : m.curved) {
    const UserBody& u = m.user[i];
    const Tangent *q = q_t_.data() + u.q, *v = v_t_.data() + u.v;
    if (u.has_attitude())
      quaternion_rates(u, q, v, J_dx + u.q);
    else
      other_rates(u, q, v, J_dx + u.q, scratch_.data());
  }
  return true;
}

bool NewtonOperators::prepare(const double* x, double gamma, bool moved) {
  const double *q = x, *v = x + model_->nq;
  gamma_ = gamma;
  for (const DeviceHold& h : model_->devices.holds) free_[h.v] = is_free(h.v);
  states_.clear();
  for (std::size_t i = 0; devices_ && i < model_->devices.all.size(); ++i) {
    const auto n = model_->devices.all[i].family->n_states;
    if (n == 0) continue;
    Eigen::MatrixXd J(n, n);
    devices_->state_matrix(static_cast<int>(i), J.data());
    states_.push_back(inverse(Eigen::MatrixXd::Identity(n, n) - gamma * J));
  }
  linear_.clear();
  for (const HingeLoad& load : model_->loads) linear_.push_back(hinge_laws::linear(load, q[load.q], v[load.v]));
  std::fill(W_.begin(), W_.end(), 0.0);
  for (std::size_t i = 0; i < linear_.size(); ++i) W_[model_->loads[i].v] += gamma * (linear_[i].damping + gamma * linear_[i].stiffness);
  each_flexible([&](int, int etadot, int n, const FlexibleBody& f) {
    for (int j = 0; j < n; ++j) {
      const auto at = (f.K_diagonal ? j : j * n + j);
      W_[etadot + j] = gamma * (f.C[at] + gamma * f.K[at]);
    }
  });
  for (double& w : W_) w = std::max(w, 0.0);  // what drives away is left out: D stays definite
  try {
    if (moved) tree_.at(q), std::copy_n(q, model_->nq, q_.begin());
    tree_.articulate({.W = W_.data(), .free = free_});
  } catch (const NumericsError&) {
    return false;
  }
  return true;
}

void NewtonOperators::precondition(const double* r, double* z) {
  const Model& m = *model_;
  const double *r_q = r, *r_v = r + m.nq;
  double *dq = z, *dv = z + m.nq;
  for (int i = 0; i < m.nv; ++i) at_[i] = is_free(i) ? r_v[i] : 0.0;
  const LinearOperator &mass = mass_, &inverse = inverse_;
  mass.mult(at_, rhs_);
  for (std::size_t i = 0; i < linear_.size(); ++i) rhs_[m.loads[i].v] -= gamma_ * linear_[i].stiffness * r_q[m.loads[i].q];
  each_flexible([&](int eta, int etadot, int n, const FlexibleBody& f) {
    for (int i = 0; i < n; ++i)
      if (f.K_diagonal)
        rhs_[etadot + i] -= gamma_ * f.K[i] * r_q[eta + i];
      else
        for (int j = 0; j < n; ++j) rhs_[etadot + i] -= gamma_ * f.K[j * n + i] * r_q[eta + j];
  });
  inverse.mult(rhs_, dv_);
  for (int i = 0; i < m.nv; ++i) dv[i] = is_free(i) ? dv_[i] : 0.0;
  m.qdot(q_.data(), dv, dq);
  for (int i = 0; i < m.nv; ++i)
    if (!is_free(i)) dv[i] = r_v[i];  // a function of time: nothing depends on it
  for (int i = 0; i < m.nq; ++i) dq[i] = r_q[i] + gamma_ * dq[i];
  const double* r_z = r_v + m.nv;
  double* dz = dv + m.nv;
  for (const auto& block : states_) {
    Eigen::VectorXd::Map(dz, block.rows()) = block * Eigen::VectorXd::Map(r_z, block.rows());
    r_z += block.rows(), dz += block.rows();
  }
}

}  // namespace cardan
