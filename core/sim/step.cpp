// THE page: how a run advances. Time moves from one instant of the schedule to the next; between two instants the integrator
// steps, inside a step the right-hand side runs the program of sweeps. Nothing else happens inside a step.
#include "core/sim/simulation.hpp"

#include <algorithm>

#include "core/base/finite.hpp"

namespace cardan {

void Simulation::run(double t_end, const std::function<void(double)>& progress) {
  make_integrator_once();
  if (!begun_) {
    begun_ = true;
    schedule_.start(state_.t);
    for (const auto& p : prescribed_) state_.v[p.index] = p.profile.rate(state_.t);
    observed_ = false;
    begin_ledger();
  }
  while (!stopped_) {
    if (schedule_.time() <= state_.t) tick();  // controllers, then outputs, in the order they were registered
    if (stopped_ || state_.t >= t_end) break;
    step(std::min({t_end, schedule_.time(), next_corner()}));
    if (progress) progress(state_.t);
  }
  write_outputs();
}

// One step of the integrator towards t_stop: commands are constant, the right-hand side is smooth.
void Simulation::step(double t_stop) {
  if (restart_) {
    std::copy_n(state_.q.data(), model_->nq, x_.begin());
    std::copy_n(state_.v.data(), model_->nv, x_.begin() + model_->nq);
    integrator_->restart(state_.t, x_.data(), y_.data());
    restart_ = false;
  }
  breakdown_ = {};
  bad_rate_ = -1;
  const double corner = next_corner();
  StepReport report;
  try {
    report = integrator_->step(t_stop, x_.data(), y_.data());
  } catch (const NumericsError& e) {
    fail(explain(e.failure()));
  }
  expect_finite(x_);
  state_.t = report.t;
  std::copy_n(x_.begin(), model_->nq, state_.q.data());
  std::copy_n(x_.begin() + model_->nq, model_->nv, state_.v.data());
  observed_ = false;
  if (report.event) handle_events(report.crossed);
  if (report.t == corner) restart_ = true;  // v' of a prescribed motion jumps here
}

// x' = [ N(q) v + k (q/|q| - q) ; v' ],  v' = M^-1 (tau + springs - C + gravity + wrenches) by the articulated sweeps;
// y' = external force, moment about the world origin, power.
bool Simulation::rhs(double t, const double* x, double* xdot, double* ydot) {
  const Model& m = *model_;
  const double *q = x, *v = x + m.nq;
  if (!evaluate(t, q, v, xdot + m.nq)) return false;
  m.qdot(q, v, xdot);
  if (!normalised_.empty()) {
    std::copy_n(q, m.nq, scratch_q_.begin());
    for (const int i : normalised_) {
      const UserBody& u = m.user[static_cast<std::size_t>(i)];
      u.hinge->normalise(u.hinge_packed.data(), scratch_q_.data() + u.q);
      for (int j = u.q; j < u.q + u.nq; ++j) xdot[j] += options_.quaternion_stabilisation * (scratch_q_[static_cast<std::size_t>(j)] - q[j]);
    }
  }
  if (ydot && options_.ledger) external_rates(inputs(q, v), xdot + m.nq, ydot);
  return true;
}

// Of actuators, springs and dampers; v' of prescribed motions.
void Simulation::apply_forces(double t, const double* q, const double* v) {
  for (const Spring& s : model_->springs) tau_total_[static_cast<std::size_t>(s.v)] = tau_[static_cast<std::size_t>(s.v)];
  for (const Spring& s : model_->springs) tau_total_[static_cast<std::size_t>(s.v)] -= s.stiffness * (q[s.q] - s.rest) + s.damping * v[s.v];
  for (const auto& p : prescribed_) vdot_given_[static_cast<std::size_t>(p.index)] = p.profile.acceleration(t);
}

// v' at (t, q, v) with the commands as they are.
bool Simulation::evaluate(double t, const double* q, const double* v, double* vdot) {
  apply_forces(t, q, v);
  if (!forward_dynamics(*model_, workspace_, inputs(q, v), vdot)) {
    breakdown_ = workspace_.breakdown;
    return false;
  }
  if (all_finite(vdot, model_->nv)) return true;
  bad_rate_ = first_not_finite(vdot, model_->nv);
  vdot_bad_ = vdot[bad_rate_];
  return false;
}

// Everything that ticks now.
void Simulation::tick() {
  for (const Schedule::Tick& tick : schedule_.next()) tasks_[static_cast<std::size_t>(tick.entry)]();
}

void Simulation::handle_events(std::span<const int> crossed) {
  for (std::size_t i = 0; i < events_.size() && !stopped_; ++i)
    if (crossed[i] != 0 && (events_[i].direction == 0 || events_[i].direction == crossed[i])) events_[i].action();
}

}  // namespace cardan
