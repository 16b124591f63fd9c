#include "core/sim/vehicle_implicit_form.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/base/diagnostic.hpp"
#include "core/base/finite.hpp"

namespace cardan {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

std::size_t at(int i) { return static_cast<std::size_t>(i); }

double largest(const double* x, int n) {
  double out = 0.0;
  for (int i = 0; i < n; ++i) out = std::max(out, std::abs(x[i]));
  return out;
}

std::shared_ptr<const Model> honoured_form(std::shared_ptr<const Model> model) {
  if (const std::string not_taken = VehicleImplicitForm::refusal(*model); !not_taken.empty())
    refuse(Code::unsupported, {"integrator.method"}, "a method that takes " + not_taken, "ida, which does not",
           VehicleImplicitForm::way_out(*model));
  return model;
}

}  // namespace

std::string VehicleImplicitForm::refusal(const Model& model) {
  if (!model.loops.absolute) return "vehicles of another loop_form than dae";
  if (model.devices.n_z > 0) return "devices with states";
  return {};
}

const char* VehicleImplicitForm::way_out(const Model& model) {
  return model.loops.absolute ? "dopri5, dop853; auto finds one" : "loop_form: dae in the vehicle, or another method; auto finds one";
}

VehicleImplicitForm::VehicleImplicitForm(std::shared_ptr<const Model> model, std::vector<double> tolerances, Loads loads, Drives drives,
                                         Guard guard)
    : model_(honoured_form(std::move(model))),
      loads_(std::move(loads)),
      drives_(std::move(drives)),
      guard_(std::move(guard)),
      system_(*model_),
      bodies_(*system_.bodies().bodies),
      tree_(*model_),
      nq_(bodies_.nq),
      nv_(bodies_.nv),
      rows_(system_.rows()),
      asked_(std::move(tolerances)),
      absolute_(asked_) {
  for (const AbsoluteModel::Joint& joint : system_.bodies().joints) quaternions_.push_back(bodies_.user[at(joint.user)].q);
  absolute_.resize(absolute_.size() + 2 * at(rows_) + quaternions_.size(), 1.0);
  q_.resize(at(model_->nq)), v_.resize(at(model_->nv)), moved_.resize(at(nv_)), mobility_.resize(at(nv_));
  given_q_ = q_, given_v_ = v_;
  eta_of_.assign(at(nv_), -1);
  for (const SweepBody& b : bodies_.bodies)
    for (int j = 0; j < b.n_modes; ++j) eta_of_[at(b.etadot + j)] = b.eta + j;
  find_pattern();
}

/// Rows on a body hang on what is next to it, across hinges and loops; loads that hang on what is further off make Newton's method slower,
/// and nothing wrong.
void VehicleImplicitForm::find_pattern() {
  const int n_bodies = static_cast<int>(bodies_.bodies.size());
  body_of_.resize(at(nv_));
  for (int k = 1; k < n_bodies; ++k) {
    const SweepBody& b = bodies_.bodies[at(k)];
    for (int j = 0; j < b.nv + b.n_modes; ++j) body_of_[at(b.v + j)] = k;
  }
  const auto bodies_at = [&](const SparseRows& rows, int row) {
    std::set<int> out;
    for (int e = rows.start[at(row)]; e < rows.start[at(row) + 1]; ++e) out.insert(body_of_[at(rows.column[at(e)])]);
    return out;
  };
  std::vector<std::set<int>> near(at(n_bodies));
  for (int k = 1; k < n_bodies; ++k) near[at(k)].insert(k);
  for (const SparseRows* rows : {&system_.G(), &system_.hinge_rates()})
    for (int i = 0; i < rows->size(); ++i) {
      const std::set<int> joined = bodies_at(*rows, i);
      for (const int k : joined) near[at(k)].insert(joined.begin(), joined.end());
    }
  std::vector<std::set<int>> of(absolute_.size());
  const int U = nq_, lambda = U + nv_, mu = lambda + rows_, nu = mu + rows_;
  const auto range = [](int first, int n, const auto& visit) {
    for (int i = first; i < first + n; ++i) visit(i);
  };
  const auto coordinates = [&](int k, const auto& visit) {  // places in Q, and so in F
    const SweepBody& b = bodies_.bodies[at(k)];
    range(b.q, 7 + b.n_modes, visit);
  };
  const auto velocities = [&](int k, const auto& visit) {
    const SweepBody& b = bodies_.bodies[at(k)];
    range(U + b.v, b.nv + b.n_modes, visit);
  };
  for (int k = 1; k < n_bodies; ++k) {
    const auto moves = [&](int column) { coordinates(k, [&](int row) { of[at(column)].insert(row); }); };
    coordinates(k, moves), velocities(k, moves);
    for (const int other : near[at(k)]) {
      const auto pushes = [&](int column) { velocities(other, [&](int row) { of[at(column)].insert(row); }); };
      coordinates(k, pushes), velocities(k, pushes);
    }
  }
  for (int i = 0; i < rows_; ++i) {
    of[at(lambda + i)].insert(lambda + i), of[at(mu + i)].insert(mu + i);
    for (const int k : bodies_at(system_.G(), i)) {
      velocities(k, [&](int row) { of[at(lambda + i)].insert(row), of[at(row)].insert(lambda + i); });
      coordinates(k, [&](int row) { of[at(mu + i)].insert(row), of[at(row)].insert(lambda + i), of[at(row)].insert(mu + i); });
    }
  }
  for (std::size_t b = 0; b < quaternions_.size(); ++b)
    range(quaternions_[b], 4, [&](int i) { of[at(nu) + b].insert(i), of[at(i)].insert(nu + static_cast<int>(b)); });
  for (const std::set<int>& rows : of) pattern_.emplace_back(rows.begin(), rows.end());
}

bool VehicleImplicitForm::enter(double t, const double* x, double* y, double* ydot) {
  bool good = false;
  const auto work = [&] {
    const double *q = x, *v = x + model_->nq;
    double *Q = y, *U = y + nq_;
    std::fill(U + nv_, y + size(), 0.0);
    std::fill(ydot, ydot + size(), 0.0);
    const LoopDrive* drives = drives_(t, given_q_.data(), given_v_.data());
    kept_ = independent_rows(*model_, tree_, {.q = q, .v = v, .gravity = false, .drives = drives}, system_);
    const Inputs* in = loads_(t, q, v);
    if (!in) return;
    system_.enter(q, v, Q, U);
    system_.place(Q, U, drives, {q, v});
    system_.keep_rows();
    good = system_.accelerate(*in, kept_, ydot + nq_, ydot + nq_ + nv_);
    bodies_.qdot(Q, U, ydot);
    measure(y);
  };
  return guard_(std::ref(work)) && good;
}

void VehicleImplicitForm::place(double t, const double* Q, const double* U) {
  const LoopDrive* drives = drives_(t, given_q_.data(), given_v_.data());
  system_.place(Q, U, drives, {given_q_.data(), given_v_.data()});
}

/// Modes may be off by what the rounding of places and velocities makes of them across the rows, a hundred times: those of fast ones are
/// asked for more finely than the places that hold them are known, and IDA takes a first correction below a sixtieth of a tolerance alone.
void VehicleImplicitForm::measure(const double* y) {
  const SparseRows& G = system_.G();
  const double of_Q = 100.0 * kEpsilon * largest(y, nq_), of_U = 100.0 * kEpsilon * largest(y + nq_, nv_);
  std::ranges::copy(asked_, absolute_.begin());
  for (int i = 0; i < rows_; ++i) {
    double squares = 0.0;
    for (int e = G.start[at(i)]; e < G.start[at(i + 1)]; ++e) squares += G.value[at(e)] * G.value[at(e)];
    for (int e = G.start[at(i)]; e < G.start[at(i + 1)] && squares > 0.0; ++e) {
      const int j = G.column[at(e)], eta = eta_of_[at(j)];
      if (eta < 0) continue;
      const double share = std::abs(G.value[at(e)]) / squares;
      absolute_[at(eta)] = std::max(absolute_[at(eta)], share * of_Q);
      absolute_[at(nq_ + j)] = std::max(absolute_[at(nq_ + j)], share * of_U);
    }
  }
  double logarithms[2] = {}, number[2] = {};  // of turns, of shifts
  for (int j = 0; j < nv_; ++j)
    if (const int axis = axis_of(j); axis < 6 && system_.inertia(j) > 0.0)
      logarithms[axis / 3] += std::log(system_.inertia(j)), number[axis / 3] += 1.0;
  for (int j = 0; j < nv_; ++j) {
    const int axis = axis_of(j);
    mobility_[at(j)] = axis >= 6 ? 1.0 / system_.inertia(j) : std::exp(-logarithms[axis / 3] / std::max(1.0, number[axis / 3]));
  }
  for (std::size_t b = 0; b < quaternions_.size(); ++b) absolute_[at(nq_ + nv_ + 2 * rows_) + b] = absolute_[at(quaternions_[b])];
}

/// An integral of a multiplier may be off by as much as moves a body of mean inertia by no more than the tolerances of its velocities, of
/// its places, absolute and relative: what a light body feels of it goes on to what holds that. Modes have forces of their own.
void VehicleImplicitForm::tolerances(double relative, const double* y, double* out) const {
  for (int i = 0; i < size(); ++i) out[i] = absolute_[at(i)] + (i < nq_ + nv_ ? relative * std::abs(y[i]) : 0.0);
  const SparseRows& G = system_.G();
  constexpr double kNone = std::numeric_limits<double>::infinity();
  for (int i = 0; i < rows_; ++i) {
    double rate = kNone, place = kNone;
    for (int e = G.start[at(i)]; e < G.start[at(i + 1)]; ++e) {
      const int j = G.column[at(e)], axis = axis_of(j), q = bodies_.bodies[at(body_of_[at(j)])].q;
      const double moves = std::abs(G.value[at(e)]) * mobility_[at(j)];
      if (axis >= 6 || moves == 0.0) continue;
      rate = std::min(rate, out[nq_ + j] / moves);
      place = std::min(place, (axis < 3 ? absolute_[at(q)] + relative : out[q + 1 + axis]) / moves);
    }
    out[nq_ + nv_ + i] = rate < kNone ? rate : 1.0;
    out[nq_ + nv_ + rows_ + i] = place < kNone ? place : 1.0;
  }
}

bool VehicleImplicitForm::leave(double t, const double* y, double* x, bool end) {
  const auto work = [&] {
    place(t, y, y + nq_);
    system_.leave(x, x + model_->nq, end);
  };
  return guard_(std::ref(work)) && all_finite(x, model_->nq + model_->nv);
}

bool VehicleImplicitForm::residual(double t, const double* y, const double* ydot, double* F) {
  bool good = false;
  const auto work = [&] { good = evaluate(t, y, ydot, F); };
  return guard_(std::ref(work)) && good;
}

bool VehicleImplicitForm::evaluate(double t, const double* y, const double* ydot, double* F) {
  const double *Q = y, *U = y + nq_, *lambda = ydot + nq_ + nv_, *mu = lambda + rows_, *nu = mu + rows_;
  double *F_U = F + nq_, *F_lambda = F_U + nv_, *F_mu = F_lambda + rows_, *F_nu = F_mu + rows_;
  place(t, Q, U);
  system_.leave(q_.data(), v_.data(), false);
  const std::span<const double> c = system_.residual(), rate = system_.rate();
  std::ranges::fill(moved_, 0.0);
  for (int i = 0; i < rows_; ++i) {
    if (mu[i] != 0.0) system_.G().add_transposed(i, mu[i], moved_.data());
    F_lambda[i] = kept_[at(i)] ? rate[at(i)] : lambda[i];
    F_mu[i] = kept_[at(i)] && system_.holds_a_place(i) ? c[at(i)] : mu[i];
  }
  for (int j = 0; j < nv_; ++j) moved_[at(j)] = U[j] + mobility_[at(j)] * moved_[at(j)];
  bodies_.qdot(Q, moved_.data(), F);
  for (int i = 0; i < nq_; ++i) F[i] = ydot[i] - F[i];
  for (std::size_t b = 0; b < quaternions_.size(); ++b) {
    double norm = -1.0;
    for (int i = quaternions_[b]; i < quaternions_[b] + 4; ++i) norm += Q[i] * Q[i], F[i] -= nu[b] * Q[i];
    F_nu[b] = 0.5 * norm;
  }
  const Inputs* in = loads_(t, q_.data(), v_.data());
  if (!in) return false;
  system_.forces(*in, ydot + nq_, lambda, F_U);
  return true;
}

int VehicleImplicitForm::state_of(int unknown) const {
  const bool is_rate = unknown >= nq_;
  for (const AbsoluteModel::Joint& joint : system_.bodies().joints) {
    const UserBody &u = model_->user[at(joint.user)], &of = bodies_.user[at(joint.user)];
    const int i = is_rate ? unknown - nq_ - of.v : unknown - of.q, n = is_rate ? of.nv : of.nq;
    if (i < 0 || i >= n + of.n_modes) continue;
    if (i >= n) return is_rate ? model_->nq + u.etadot + i - n : u.eta + i - n;
    return u.nv == 0 ? -1 : is_rate ? model_->nq + u.v : u.q;
  }
  return -1;
}

}  // namespace cardan
