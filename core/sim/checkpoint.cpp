// What a simulation goes on from.
#include <algorithm>
#include <utility>

#include "core/sim/simulation.hpp"

namespace cardan {

void Simulation::remember(Archive& a) {
  int adopted = adopted_;
  a.block("models")(adopted);
  if (adopted != adopted_) a.wrong("the run had another vehicle before it (Simulation::adopt)");
  if (adopted > 0) a(of_former_models_);
  const auto numbers = [](Eigen::VectorXd& x) { return std::span(x.data(), static_cast<std::size_t>(x.size())); };
  a.block("state").finite(state_.t, numbers(state_.q), numbers(state_.v), numbers(state_.z), numbers(state_.marks));
  a.block("commands")(std::span(tau_));
  if (devices_) a(std::span(devices_->commands), delays_.numbers(), ages_.times(), faults_);
  if (a.reading() && !std::ranges::all_of(faults_, [this](const RunningFault& f) { return is_of_a_port(f); }))
    a.wrong("a fault of no port");
  for (NodeWrench& w : wrenches_) a(w.f.n.x, w.f.n.y, w.f.n.z, w.f.f.x, w.f.f.y, w.f.f.z);
  a.block("given motion");
  for (Prescribed& p : prescribed_) a(p.profile, p.given, p.t_0, p.q_0);
  for (PrescribedLoop& p : prescribed_loops_) a(p.profile, p.given, p.t_0, p.more_0);
  for (Limit& limit : limits_) a(limit.passed);
  a.block("schedule")(schedule_);
  if (a.reading() && !schedule_.stands_at(state_.t)) a.wrong("ticks of another time than that of the state");
  a.block("headway")(headway_);
  a.block("run")(last_output_, warned_stiff_, nearest_.pivot, nearest_.t);
  a.block("history")(history_);
  a.block("ledger")(balances_);
  a.block("warnings")(warnings_);
  std::vector<double> row = row_;
  a.block("outputs")(row);
  if (row.size() == row_.size()) row_ = std::move(row);
}

/// A new integrator at the present state, with what the archive has of the one before.
void Simulation::start_anew(Archive& archive) {
  make_integrator_once();
  pack(x_.data());
  integrator_->restart(state_.t, x_.data());
  integrator_->remember(archive.block("integrator"));
  restart_.reset();
}

Checkpoint Simulation::checkpoint() {
  if (within_.looks) refuse_inside();
  if (in_event_)  // what else crosses zero there is still to happen
    refuse(Code::unsupported, {"a checkpoint in the action of an event"}, "one between steps, or in a task", "one among what happens there",
           "a task of every() that makes it at its next tick");
  sample_devices(true);
  let_inside();
  make_integrator_once();
  if (!begun_) history_.begin(state_.t, static_cast<int>(x_.size()));
  begin();
  settle();
  history_.restarted(restart_.value_or(RestartCause::checkpoint));
  Archive all;
  remember(all);
  start_anew(all);  // the integrator ends what it had begun
  all.finish();
  resume(all.checkpoint());
  return all.checkpoint();
}

void Simulation::resume(const Checkpoint& checkpoint) {
  sample_devices(true);
  let_inside();
  Archive all(checkpoint);
  history_.resize(model_->nq + model_->nv + model_->devices.n_z);
  remember(all);
  alter_ports();
  tau_total_ = tau_;
  changed();
  holds_.begin_anew = false;
  trail_.n = 0;
  if (devices_)  // masses and what is held: the integrator may look at the model before anything is evaluated
    devices_->set({state_.t, state_.z.data(), state_.marks.data(), tau_total_.data(), wrenches_.data()});
  integrator_.reset();
  start_anew(all);
  all.finish();
  begun_ = true;
}

}  // namespace cardan
