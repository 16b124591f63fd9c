#include "core/operators/diagonalised.hpp"

#include "core/base/diagnostic.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/mass_matrix.hpp"

namespace cardan::operators {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// S^-1 x, S^-* x.
template <class X>
void solve(const MatrixXd& S, X&& x) {
  S.triangularView<Eigen::Lower>().solveInPlace(x);
}
template <class X>
void solve_star(const MatrixXd& S, X&& x) {
  S.triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

/// Strict lower triangle and half the diagonal: S low(S^-1 dD S^-*) is dS of D = S S*.
MatrixXd low(const MatrixXd& a) {
  MatrixXd out = a.triangularView<Eigen::Lower>();
  out.diagonal() *= 0.5;
  return out;
}

/// (1 - H psi K) f.
VectorXd innovations(const TreeOperators& tree, const VectorXd& f) {
  return apply(letters::I - letters::H * letters::psi * letters::K, tree, f);
}

/// Base to tip: what reaches each body but for its own free components, x = Phi* V(p) + H*_p v_p. visit(i, x) sets those of v;
/// then V(i) = Phi* V(p) + H* v.
template <class Visit>
void scatter(const TreeOperators& tree, const VectorXd& v, const Visit& visit) {
  std::vector<VectorXd> V(tree.bodies().size());
  for (int i = 0; i < static_cast<int>(V.size()); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    VectorXd x = VectorXd::Zero(6 + b.m);
    if (b.parent >= 0) x.head<6>() = tree.A(i) * V[b.parent];
    for (int j = 0; j < b.nh + b.m; ++j)
      if (!tree.is_free(b.v + j)) x += v[b.v + j] * tree.Ht_all(i).col(j);
    visit(i, x);
    V[i] = x + tree.Ht(i) * v.segment(b.v, b.nh + b.m);
  }
}

}  // namespace

void riccati_rates(const TreeOperators& tree, const PositionBlocks& direction, RiccatiRates& rates) {
  tree.require(Kind::P);
  const std::size_t n = tree.bodies().size();
  for (auto* x : {&rates.P, &rates.P_plus, &rates.D, &rates.G, &rates.S}) x->resize(n);
  for (std::size_t i = 0; i < n; ++i) rates.P[i] = direction.M[tree.bodies()[i].sweep];
  for (int i = static_cast<int>(n) - 1; i >= 0; --i) {
    const OperatorBody& b = tree.bodies()[i];
    const MatrixXd &H = tree.Ht(i), &P = tree.P(i), &G = tree.G(i), &P_plus = tree.P_plus(i), &S = tree.S(i);
    MatrixXd dH = direction.Ht[b.sweep];
    for (int j = 0; j < b.nh + b.m; ++j)
      if (!tree.is_free(b.v + j)) dH.col(j).setZero();
    const MatrixXd &dP = rates.P[i], PdH = P * dH, dPH = dP * H;
    MatrixXd& dD = rates.D[i];
    dD = H.transpose() * PdH;
    dD = (dD + dD.transpose() + H.transpose() * dPH).eval();
    MatrixXd half = dD;  // S^-1 dD S^-*
    solve(S, half);
    half.transposeInPlace();
    solve(S, half);
    rates.S[i] = S * low(half);
    MatrixXd gain = (dPH + PdH - G * dD).transpose();  // times D^-1 from the right
    solve(S, gain);
    solve_star(S, gain);
    rates.G[i] = gain.transpose();
    const MatrixXd loss = G * (dH.transpose() * P_plus), tau_bar = MatrixXd::Identity(P.rows(), P.cols()) - G * H.transpose();
    MatrixXd& dP_plus = rates.P_plus[i];
    dP_plus = tau_bar * dP * tau_bar.transpose() - loss - loss.transpose();
    if (b.parent < 0) continue;
    const Matrix6X &A = tree.A(i), &dA = direction.A[b.sweep];
    const MatrixXd turned = dA.transpose() * (P_plus.topLeftCorner<6, 6>() * A);
    rates.P[b.parent] += turned + turned.transpose() + A.transpose() * (dP_plus.topLeftCorner<6, 6>() * A);
  }
}

Diagonalised::Diagonalised(const TreeOperators& tree, Form form) : tree_(tree), normalised_(form == Form::normalised), ws_(tree.model()) {}

void Diagonalised::clear_given(int i, VectorXd& x) const {
  const OperatorBody& b = tree_.bodies()[i];
  for (int j = b.v; j < b.v + b.nh + b.m; ++j)
    if (!tree_.is_free(j)) x[j] = 0.0;
}

VectorXd Diagonalised::from_velocity(const VectorXd& v) const {
  tree_.require(Kind::G);
  require_size(tree_, "velocities", Space::hinge, v.size());
  VectorXd nu(v.size());
  scatter(tree_, v, [&](int i, const VectorXd& x) {
    const OperatorBody& b = tree_.bodies()[i];
    auto part = nu.segment(b.v, b.nh + b.m);
    part = v.segment(b.v, b.nh + b.m);
    clear_given(i, nu);
    part += tree_.G(i).transpose() * x;
    if (normalised_) part = (tree_.S(i).transpose() * part).eval();
  });
  return nu;
}

void Diagonalised::to_velocity(const VectorXd& nu, VectorXd& v) const {
  tree_.require(Kind::G);
  require_size(tree_, "diagonalised velocities", Space::hinge, nu.size());
  require_size(tree_, "velocities", Space::hinge, v.size());
  scatter(tree_, v, [&](int i, const VectorXd& x) {
    const OperatorBody& b = tree_.bodies()[i];
    VectorXd rate = nu.segment(b.v, b.nh + b.m);
    if (normalised_) solve_star(tree_.S(i), rate);
    rate -= tree_.G(i).transpose() * x;
    for (int j = 0; j < b.nh + b.m; ++j)
      if (tree_.is_free(b.v + j)) v[b.v + j] = rate[j];
  });
}

VectorXd Diagonalised::eps(const VectorXd& tau) const {
  require_size(tree_, "forces", Space::hinge, tau.size());
  VectorXd out = innovations(tree_, tau);
  for (int i = 0; i < static_cast<int>(tree_.bodies().size()); ++i) {
    const OperatorBody& b = tree_.bodies()[i];
    clear_given(i, out);
    if (normalised_) solve(tree_.S(i), out.segment(b.v, b.nh + b.m));
  }
  return out;
}

// The change of nu at constant free v: L*' v (and what given accelerations add), times D in the form without square roots. With x as in
// scatter(): nu = S* (v + G* x), so it is S*' (v + G* x) + S* (G*' x + G* x').
VectorXd Diagonalised::drift(const VectorXd& v, const double* given_vdot) {
  const PositionBlocks& d = direction_;
  tree_.derivatives(tree_.to_model(v).data(), direction_);
  riccati_rates(tree_, d, rates_);
  const RiccatiRates& rates = rates_;
  const std::size_t n = tree_.bodies().size();
  std::vector<VectorXd> V(n), dV(n);  // dV: rate of its components at constant free v
  VectorXd out(v.size());
  for (int i = 0; i < static_cast<int>(n); ++i) {
    const OperatorBody& b = tree_.bodies()[i];
    const Matrix6X& dA = d.A[b.sweep];
    const MatrixXd &H = tree_.Ht_all(i), &dH = d.Ht[b.sweep], &S = tree_.S(i), &G = tree_.G(i);
    VectorXd x = VectorXd::Zero(6 + b.m), dx = x, free = v.segment(b.v, b.nh + b.m);
    if (b.parent >= 0) {
      x.head<6>() = tree_.A(i) * V[b.parent];
      dx.head<6>() = tree_.A(i) * dV[b.parent] + dA * V[b.parent];
    }
    for (int j = 0; j < b.nh + b.m; ++j)
      if (!tree_.is_free(b.v + j)) {
        x += free[j] * H.col(j);
        dx += free[j] * dH.col(j) + (given_vdot ? given_vdot[b.v + j] : 0.0) * H.col(j);
        free[j] = 0.0;
      }
    auto part = out.segment(b.v, b.nh + b.m);
    part = rates.G[i].transpose() * x + G.transpose() * dx;
    if (normalised_)
      part = (S.transpose() * part + rates.S[i].transpose() * (free + G.transpose() * x)).eval();
    else
      part = (tree_.D(i) * part).eval();
    V[i] = x + H * free;
    dV[i] = dx + dH * free;
  }
  return out;
}

VectorXd Diagonalised::coriolis(const VectorXd& v) {
  require_size(tree_, "velocities", Space::hinge, v.size());
  const VectorXd all = tree_.to_model(v);
  const VectorXd C = bias(tree_, ws_, {.v = all.data(), .gravity = false});  // with what the modes' springs and dampers do
  return eps(C + tree_.from_model(elastic_force(tree_.model(), tree_.q().data(), all.data()))) - drift(v, nullptr);
}

VectorXd Diagonalised::rate(const Inputs& in) {
  const Model& model = tree_.model();
  VectorXd given = VectorXd::Zero(model.nv);
  for (int i = 0; i < model.nv; ++i)
    if (const int place = tree_.place_of_velocity(i); in.vdot && place >= 0 && !tree_.is_free(place)) given[i] = in.vdot[i];
  Inputs use = in;
  use.vdot = given.data();
  VectorXd missing = -inverse_dynamics(tree_, ws_, use);
  if (in.tau) missing += tree_.from_model(Eigen::Map<const VectorXd>(in.tau, model.nv));
  const VectorXd v = tree_.from_model(Eigen::Map<const VectorXd>(in.v, model.nv)), accelerations = tree_.from_model(given);
  VectorXd out = eps(missing) + drift(v, accelerations.data());
  if (!normalised_)
    for (int i = 0; i < static_cast<int>(tree_.bodies().size()); ++i) {
      const OperatorBody& b = tree_.bodies()[i];
      solve(tree_.S(i), out.segment(b.v, b.nh + b.m));
      solve_star(tree_.S(i), out.segment(b.v, b.nh + b.m));
    }
  return out;
}

}  // namespace cardan::operators
