#include "core/operators/compound_tree.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/loop_pass.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/following_rates.hpp"
#include "core/operators/letter_products.hpp"

namespace cardan::operators {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Vector = Eigen::Map<VectorXd>;
using ConstVector = Eigen::Map<const VectorXd>;

CompoundTree::CompoundTree(std::shared_ptr<const Model> closed) : open_(open_tree(closed)), ws_(*closed) {
  model_ = std::move(closed);
  nodes_ = open_.nodes();
  n_body_ = open_.size(Space::body), n_rate_ = n_hinge_ = open_.size(Space::hinge);
  gather_compounds();
  if (model_->loops.empty()) return;
  const State start = model_->initial_state();
  open_.at(start.q.data());
  close(start.q.data(), nullptr, true);
}
CompoundTree::~CompoundTree() = default;

// The ways of a loop are those from the bodies whose rates move its ends to the body where they begin; loops with a body in common are one.
void CompoundTree::gather_compounds() {
  const std::vector<OperatorBody>& bodies = open_.bodies();
  std::vector<int> root(bodies.size()), body_of(model_->nv, -1), of_loop(model_->loops.all.size(), -1);
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int i) {
    while (root[i] != i) i = root[i];
    return i;
  };
  for (int v = 0; v < model_->nv; ++v)
    for (std::size_t i = 0; i < bodies.size(); ++i)
      if (const int place = open_.place_of_velocity(v); place >= bodies[i].v && place < bodies[i].v + bodies[i].nh + bodies[i].m)
        body_of[v] = static_cast<int>(i);
  const auto meet = [&](int a, int b) {
    while (a != b) (a > b ? a : b) = bodies[std::max(a, b)].parent;
    return a;
  };
  for (std::size_t l = 0; l < of_loop.size(); ++l) {
    const std::vector<int>& rates = model_->loops.all[l].rates;
    if (rates.empty()) continue;
    int home = bodies[body_of[rates[0]]].parent;
    for (const int v : rates) home = meet(home, bodies[body_of[v]].parent);
    of_loop[l] = body_of[rates[0]];
    for (const int v : rates)
      for (int i = body_of[v]; i != home; i = bodies[i].parent) {
        const int a = find(i), b = find(of_loop[l]);
        root[std::max(a, b)] = std::min(a, b);
      }
  }
  of_body_.assign(bodies.size(), -1);
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) {
    const int first = find(i);
    if (first == i) {
      of_body_[i] = count();
      compounds_.push_back({.home = bodies[i].parent});
    }
    Compound& c = compounds_[of_body_[i] = of_body_[first]];
    c.members.push_back(i);
    for (int j = 0; j < bodies[i].nh + bodies[i].m; ++j) c.rates.push_back(bodies[i].v + j);
  }
  for (std::size_t l = 0; l < of_loop.size(); ++l)
    if (of_loop[l] >= 0) compounds_[of_body_[find(of_loop[l])]].loops.push_back(static_cast<int>(l));
  for (Compound& c : compounds_) std::ranges::sort(c.rates);
  X_.resize(compounds_.size()), dependence_.resize(compounds_.size());
}

void CompoundTree::close(const double* q, const LoopDrive* drives, bool at_start) {
  const Model& m = *model_;
  as_at_start_ = true;
  bool left_out = false;
  if (!m.loops.empty()) {
    stand(m, ws_, q, false);
    const VectorXd still = VectorXd::Zero(m.nv);
    const Inputs in{.q = q, .v = still.data(), .gravity = false, .drives = drives};
    LoopPass pass(m, ws_, in);
    pass.place();
    std::vector<int> component(n_rate_, -1);
    for (int v = 0; v < m.nv; ++v)
      if (const int place = open_.place_of_velocity(v); place >= 0) component[place] = v;
    std::vector<std::uint8_t> moves(n_rate_, 0);
    for (std::size_t c = 0; c < compounds_.size(); ++c) {
      Compound& compound = compounds_[c];
      if (compound.loops.empty()) continue;
      const auto column = [&](int place) { return std::ranges::lower_bound(compound.rates, place) - compound.rates.begin(); };
      std::vector<int> rows;
      for (const int l : compound.loops)
        for (int i = 0; i < m.loops.all[l].rows; ++i) rows.push_back(m.loops.all[l].first + i);
      // G by letters: H phi B of the wrenches with which a multiplier pushes, on the bodies of the loop alone.
      MatrixXd G = MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(compound.rates.size()));
      VectorXd scale(G.rows());
      double open = 0.0;
      Eigen::Index row = 0;
      for (const int l : compound.loops) {
        const Loop& loop = m.loops.all[l];
        for (const int v : loop.rates) moves[open_.place_of_velocity(v)] = 1;
        for (int i = loop.first; i < loop.first + loop.rows; ++i, ++row) {
          scale[row] = pass.in_metres(loop, i) / loop.reference;
          if (loop.turns()) open = std::max(open, std::abs(ws_.loops->c[i]) * pass.in_metres(loop, i) / loop.lever);
          if (loop.closing == cardan::Closing::coupling) {
            for (std::size_t t = 0; t < loop.coupling.terms.size(); ++t)
              G(row, column(open_.place_of_velocity(loop.coupling.terms[t].v))) += ws_.loops->gradient[l][t];
            continue;
          }
          for (const NodeWrench& w : pass.wrenches_of(loop, ws_.loops->W[i])) {
            VectorXd f = open_.Bt(w.node).transpose() * to_eigen(w.f);
            for (int k = open_.index_of(m.nodes[w.node].sweep); k >= 0;) {  // from a body, too, that is held on the way and has no rates
              const OperatorBody& b = open_.bodies()[k];
              const VectorXd h = open_.Ht_all(k).transpose() * f;
              for (int j = 0; j < b.nh + b.m; ++j)
                if (moves[b.v + j]) G(row, column(b.v + j)) += h[j];
              if (b.sweep == loop.home) break;
              f = open_.A(k).transpose() * f.head<6>().eval();
              k = b.parent;
            }
          }
        }
        for (const int v : loop.rates) moves[open_.place_of_velocity(v)] = 0;
      }
      // Scaled: rates in the root of their energy, rows in metres; none of the pivots on a rate whose motion is given.
      MatrixXd B = scale.asDiagonal() * G;
      std::vector<int> may;
      for (std::size_t j = 0; j < compound.rates.size(); ++j)
        if (const int v = component[compound.rates[j]]; !m.has_prescribed() || !m.prescribed[v]) {
          B.col(static_cast<Eigen::Index>(j)) *= m.loops.column_scale[v];
          may.push_back(static_cast<int>(j));
        }
      Pivots pivots = complete_pivots(B(Eigen::all, may), at_start ? m.loops.dependent : kDependent);
      std::size_t rank = pivots.values.size();
      if (at_start) compound.rank = static_cast<int>(rank);
      for (std::size_t p = static_cast<std::size_t>(compound.rank); p < rank; ++p)
        if (!(pivots.values[p] > more_than_dependent(open))) rank = p;
      as_at_start_ = as_at_start_ && static_cast<int>(rank) == compound.rank;
      left_out = left_out || rank < rows.size();
      Dependence& d = dependence_[c];
      d.rows.clear(), d.dependent.clear();
      std::vector<int> pivot_rows, others;
      for (std::size_t p = 0; p < rank; ++p) {
        pivot_rows.push_back(pivots.rows[p]);
        d.rows.push_back(rows[pivots.rows[p]]), d.dependent.push_back(may[pivots.columns[p]]);
      }
      for (int j = 0; j < static_cast<int>(compound.rates.size()); ++j)
        if (std::ranges::find(d.dependent, j) == d.dependent.end()) others.push_back(j);
      d.G_D = G(pivot_rows, d.dependent);
      // In scaled rows and rates, so that nothing of another kind is weighed by its unit.
      VectorXd in_energy(static_cast<Eigen::Index>(rank));
      for (std::size_t p = 0; p < rank; ++p)
        in_energy[static_cast<Eigen::Index>(p)] = m.loops.column_scale[component[compound.rates[d.dependent[p]]]];
      MatrixXd& X = X_[c];
      X.setZero(G.cols(), static_cast<Eigen::Index>(others.size()));
      for (std::size_t j = 0; j < others.size(); ++j) X(others[j], static_cast<Eigen::Index>(j)) = 1.0;
      if (rank > 0) {
        const MatrixXd rest = scale.asDiagonal() * G(Eigen::all, others);
        X(d.dependent, Eigen::all) = -(in_energy.asDiagonal() * lu_solve(B(pivot_rows, d.dependent), rest(pivot_rows, Eigen::all)).x);
      }
    }
  }
  number();
  if (!left_out || at_start) return;
  for (int which = 0; which < 2; ++which) {
    const VectorXd motion = some_rates(which, n_hinge_);
    VectorXd v(n_rate_);
    follow(false, motion.data(), v.data());
    require_regular_posture(m, ws_, q, drives, open_.to_model(v));
  }
}

/// Compound after compound, in the order of the first rate of each; of one, its independent rates.
void CompoundTree::number() {
  std::vector<int> order(compounds_.size());
  std::iota(order.begin(), order.end(), 0);
  const auto first = [&](int c) { return compounds_[c].rates.empty() ? n_rate_ : compounds_[c].rates[0]; };
  std::ranges::stable_sort(order, {}, first);
  place_.assign(model_->nv, -1);
  std::vector<int> component(n_rate_, -1);
  for (int v = 0; v < model_->nv; ++v)
    if (const int place = open_.place_of_velocity(v); place >= 0) component[place] = v;
  independent_.clear();
  std::size_t widest = 6;
  for (const int c : order) {
    Compound& compound = compounds_[c];
    compound.v = static_cast<int>(independent_.size());
    for (int j = 0; j < static_cast<int>(compound.rates.size()); ++j) {
      if (std::ranges::find(dependence_[c].dependent, j) != dependence_[c].dependent.end()) continue;
      const int v = component[compound.rates[j]];
      place_[v] = static_cast<int>(independent_.size());
      independent_.push_back(v);
    }
    compound.n = static_cast<int>(independent_.size()) - compound.v;
    widest = std::max(widest, static_cast<std::size_t>(compound.n));
  }
  n_hinge_ = static_cast<int>(independent_.size());
  for (const OperatorBody& b : open_.bodies()) widest = std::max(widest, static_cast<std::size_t>(6 + b.m));
  work_.resize(3 * widest);
}

void CompoundTree::at(const double* q, const LoopDrive* drives) {
  open_.at(q);
  q_ = open_.q();
  drives_.clear();
  if (drives) drives_.assign(drives, drives + model_->loops.n_drives);
  masked_ = weighted_ = false;
  free_.clear();
  has_position_ = true;
  has_inertia_ = has_operational_space_ = has_direction_ = false;
  close(q, drives, false);
  build();
}

void CompoundTree::build() {
  const std::vector<OperatorBody>& bodies = open_.bodies();
  A_.resize(bodies.size()), Ht_.resize(bodies.size());
  for (std::size_t c = 0; c < compounds_.size(); ++c) {
    const Compound& compound = compounds_[c];
    for (const int i : compound.members) {
      const OperatorBody& b = bodies[i];
      if (compound.loops.empty()) {
        A_[i] = open_.A(i), Ht_[i] = open_.Ht_all(i);
        continue;
      }
      const auto row = std::ranges::lower_bound(compound.rates, b.v) - compound.rates.begin();
      Ht_[i].noalias() = open_.Ht_all(i) * X_[c].middleRows(row, b.nh + b.m);
      if (b.parent == compound.home) {
        A_[i] = open_.A(i);
      } else {
        Ht_[i].topRows<6>().noalias() += open_.A(i) * Ht_[b.parent];
        A_[i] = open_.A(i).leftCols<6>() * A_[b.parent];
      }
    }
  }
}

// The same along a direction, by the rule of products; X' = -G_D^-1 G' X of the dependent rates, one rate of every compound at a time.
void CompoundTree::along(const double* u) {
  require(Kind::H);
  const std::vector<OperatorBody>& bodies = open_.bodies();
  VectorXd direction(n_hinge_), rates(n_rate_);
  for (int j = 0; j < n_hinge_; ++j) direction[j] = u[independent_[j]];
  follow(false, direction.data(), rates.data());
  const VectorXd way = open_.to_model(rates);
  open_.along(way.data());
  dX_.resize(compounds_.size());
  int most = 0;
  for (std::size_t c = 0; c < compounds_.size(); ++c) {
    dX_[c].setZero(X_[c].rows(), X_[c].cols());
    if (!dependence_[c].rows.empty()) most = std::max(most, compounds_[c].n);
  }
  for (int j = 0; j < most; ++j) {
    VectorXd one = VectorXd::Zero(n_hinge_);
    for (std::size_t c = 0; c < compounds_.size(); ++c)
      if (!dependence_[c].rows.empty() && j < compounds_[c].n) one[compounds_[c].v + j] = 1.0;
    follow(false, one.data(), rates.data());
    const VectorXd change = FollowingRates(*model_, open_.model(), q_.data(), open_.to_model(rates), drives_).rows_along(way);
    for (std::size_t c = 0; c < compounds_.size(); ++c)
      if (const Dependence& d = dependence_[c]; !d.rows.empty() && j < compounds_[c].n) {
        const MatrixXd dependent = lu_solve(d.G_D, change(d.rows)).x;
        for (std::size_t i = 0; i < d.dependent.size(); ++i) dX_[c](d.dependent[i], j) = -dependent(static_cast<Eigen::Index>(i), 0);
      }
  }
  dA_.resize(bodies.size()), dHt_.resize(bodies.size());
  for (std::size_t c = 0; c < compounds_.size(); ++c) {
    const Compound& compound = compounds_[c];
    for (const int i : compound.members) {
      const OperatorBody& b = bodies[i];
      if (compound.loops.empty()) {
        dA_[i] = open_.dA(i), dHt_[i] = open_.dHt(i);
        continue;
      }
      const auto row = std::ranges::lower_bound(compound.rates, b.v) - compound.rates.begin();
      dHt_[i].noalias() = open_.dHt(i) * X_[c].middleRows(row, b.nh + b.m) + open_.Ht_all(i) * dX_[c].middleRows(row, b.nh + b.m);
      if (b.parent == compound.home) {
        dA_[i] = open_.dA(i);
      } else {
        dHt_[i].topRows<6>().noalias() += open_.dA(i) * Ht_[b.parent] + open_.A(i) * dHt_[b.parent];
        dA_[i] = open_.dA(i).leftCols<6>() * A_[b.parent] + open_.A(i).leftCols<6>() * dA_[b.parent];
      }
    }
  }
  has_direction_ = true;
  mask();
}

void CompoundTree::mask() {
  Ht_free_.clear(), dHt_free_.clear();
  if (!masked_) return;
  Ht_free_ = Ht_;
  if (has_direction_) dHt_free_ = dHt_;
  for (const Compound& c : compounds_)
    for (int j = 0; j < c.n; ++j) {
      if (is_free(c.v + j)) continue;
      for (const int i : c.members) {
        Ht_free_[i].col(j).setZero();
        if (has_direction_) dHt_free_[i].col(j).setZero();
      }
    }
}

// Of a compound P is that of each of its bodies: what is outboard hangs on one of them. Home gets E_phi (P - G D G*) E_phi*.
void CompoundTree::articulate(const Articulate& options) {
  take(options);
  mask();
  const std::vector<OperatorBody>& bodies = open_.bodies();
  P_.resize(bodies.size()), G_.resize(bodies.size()), D_.resize(compounds_.size()), S_.resize(compounds_.size());
  for (int i = 0; i < static_cast<int>(bodies.size()); ++i) P_[i] = M(i);
  for (int c = count() - 1; c >= 0; --c) {
    const Compound& compound = compounds_[c];
    const int n = compound.n;
    MatrixXd& D = D_[c];
    D.setZero(n, n);
    VectorXd made_of = VectorXd::Zero(n);  // what round-off of D is measured by
    for (const int i : compound.members) {
      const MatrixXd &H_star = Ht(i), &P = P_[i];
      G_[i].noalias() = P * H_star;
      D.noalias() += H_star.transpose() * G_[i];
      made_of += (H_star.cwiseAbs().transpose() * P.cwiseAbs() * H_star.cwiseAbs()).diagonal();
    }
    if (options.W) {
      const ConstVector W(options.W + compound.v, n);
      D.diagonal() += W;
      made_of += W.cwiseAbs();
    }
    factor(D, std::move(made_of), compound.v, S_[c], [&](int j) {
      const int v = independent_[compound.v + j];
      for (const int i : compound.members) {
        const OperatorBody& b = bodies[i];
        const int at_body = open_.place_of_velocity(v) - b.v;
        if (at_body >= 0 && at_body < b.nh + b.m) return soa::Breakdown{.body = b.sweep, .component = at_body < b.nh ? at_body : -1};
      }
      return soa::Breakdown{.body = bodies[compound.members[0]].sweep};
    });
    const MatrixXd& S = S_[c];
    MatrixXd through;  // S^-1 H P Phi*
    const int home = compound.home;
    if (home >= 0) through.setZero(n, 6 + bodies[home].m);
    for (const int i : compound.members) {
      const MatrixXd U = S.triangularView<Eigen::Lower>().solve(G_[i].transpose());  // S^-1 H P
      G_[i] = S.triangularView<Eigen::Lower>().transpose().solve(U).transpose();
      if (home < 0) continue;
      through.noalias() += U.leftCols<6>() * A(i);
      const MatrixXd shifted = P_[i].topLeftCorner<6, 6>() * A(i);
      P_[home].noalias() += A(i).transpose() * shifted;
    }
    if (home < 0) continue;
    P_[home].noalias() -= through.transpose() * through;
    P_[home] = (0.5 * (P_[home] + P_[home].transpose())).eval();
  }
  has_inertia_ = true;
}

void CompoundTree::operational_space() {
  require(Kind::D);
  const std::vector<OperatorBody>& bodies = open_.bodies();
  Y_.resize(bodies.size());
  for (int c = 0; c < count(); ++c) {
    const Compound& compound = compounds_[c];
    const int home = compound.home;
    MatrixXd felt;  // K* of what home does
    if (home >= 0) {
      felt.setZero(compound.n, 6 + bodies[home].m);
      for (const int i : compound.members) felt.noalias() += G_[i].topRows<6>().transpose() * A(i);
    }
    for (const int i : compound.members) {
      MatrixXd root = Ht(i).transpose();  // S^-1 H
      S_[c].triangularView<Eigen::Lower>().solveInPlace(root);
      MatrixXd& Y = Y_[i];
      Y.noalias() = root.transpose() * root;
      if (home >= 0) {
        MatrixXd way = -Ht(i) * felt;  // tau_bar* E_phi*
        way.topRows<6>() += A(i);
        Y.noalias() += way * Y_[home] * way.transpose();
      }
      Y = (0.5 * (Y + Y.transpose())).eval();
    }
  }
  has_operational_space_ = true;
}

SpaceLabels CompoundTree::labels(Space space, Sort sort) const {
  if (space == Space::node) return node_labels(nodes_, sort);
  if (space != Space::hinge) return open_.labels(space, sort);
  const SpaceLabels all = open_.labels(Space::rate, sort);
  SpaceLabels out;
  for (const int v : independent_) {
    out.names.push_back(all.names[open_.place_of_velocity(v)]);
    out.units.push_back(all.units[open_.place_of_velocity(v)]);
  }
  return out;
}

void CompoundTree::follow_by(const std::vector<MatrixXd>& X, bool star, const double* x, double* y) const {
  for (std::size_t c = 0; c < compounds_.size(); ++c) {
    const Compound& compound = compounds_[c];
    const std::vector<int>& places = compound.rates;
    const auto n = static_cast<Eigen::Index>(places.size());
    if (compound.loops.empty()) {
      const bool same = &X == &X_;
      for (Eigen::Index j = 0; j < n; ++j)
        if (star)
          y[compound.v + j] = same ? x[places[j]] : 0.0;
        else
          y[places[j]] = same ? x[compound.v + j] : 0.0;
      continue;
    }
    rates_.resize(n);
    if (star) {
      for (Eigen::Index j = 0; j < n; ++j) rates_[j] = x[places[j]];
      Vector(y + compound.v, compound.n).noalias() = X[c].transpose() * rates_;
      continue;
    }
    rates_.noalias() = X[c] * ConstVector(x + compound.v, compound.n);
    for (Eigen::Index j = 0; j < n; ++j) y[places[j]] = rates_[j];
  }
}

void CompoundTree::solve(int c, double* h) const {
  const Compound& compound = compounds_[c];
  Vector x(h, compound.n);
  for (int j = 0; j < compound.n; ++j)
    if (!is_free(compound.v + j)) x[j] = 0.0;
  S_[c].triangularView<Eigen::Lower>().solveInPlace(x);
  S_[c].triangularView<Eigen::Lower>().transpose().solveInPlace(x);
}

void CompoundTree::apply(Kind kind, bool star, const double* x, double* y) const {
  require(kind);
  LetterProduct<CompoundTree>(*this, star, x, y, work_.data(), work_.size() / 3).of(kind);
}

void CompoundTree::apply_nodes(std::span<const int> nodes, bool star, const double* x, double* y) const {
  require(Kind::B);
  open_.apply_nodes(nodes, star, x, y);
}

void CompoundTree::apply_inverse(Kind kind, const double* x, double* y) const {
  require(kind);
  if (kind == Kind::M) return open_.apply_inverse(kind, x, y);
  std::copy(x, x + n_hinge_, y);
  for (int c = 0; c < count(); ++c) solve(c, y + compounds_[c].v);
}

bool CompoundTree::fused(Fused kernel, const double* x, double* y) const {
  if (kernel == Fused::none || masked_ || !has_position_) return false;
  if (kernel == Fused::mass) {
    if (!open_.has_fused(kernel)) return false;
    numbers_.resize(n_rate_), forces_.resize(n_rate_);
    follow(false, x, numbers_.data());
    open_.fused(kernel, numbers_.data(), forces_.data());
    follow(true, forces_.data(), y);
    return true;
  }
  if (weighted_ || model_->has_prescribed() || !as_at_start_ || !has_inertia_) return false;
  numbers_.setZero(model_->nv), response_.resize(model_->nv);
  for (int j = 0; j < n_hinge_; ++j) numbers_[independent_[j]] = x[j];
  if (!closed_response(*model_, ws_, q_.data(), drives_.empty() ? nullptr : drives_.data(), numbers_.data(), response_.data()))
    return false;
  for (int j = 0; j < n_hinge_; ++j) y[j] = response_[independent_[j]];
  return true;
}

double CompoundTree::log_det() const {
  require(Kind::D);
  double sum = 0.0;
  for (const MatrixXd& S : S_)
    for (Eigen::Index j = 0; j < S.rows(); ++j) sum += 2.0 * std::log(S(j, j));
  return sum;
}

}  // namespace cardan::operators
