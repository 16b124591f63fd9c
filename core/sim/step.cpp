// THE page: how a run advances. Time moves from one instant of the schedule to the next; between two instants the integrator
// steps, inside a step the right-hand side runs the program of sweeps. Nothing else happens inside a step; what only looks may look back
// into the one that was just made.
#include "core/sim/simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/base/finite.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/sim/plugin_faults.hpp"

namespace cardan {
namespace {

constexpr double kLeaves = 1e-12;  // of the largest rate: what is slower is rounding

}  // namespace

void Simulation::run(double t_end, const std::function<void(double)>& progress) {
  if (std::isnan(t_end)) refuse(Code::out_of_range, {"end of the run"}, "a time [s]", "nan");
  const Stopwatch watch(timed(&RunProfile::run));
  sample_devices(true);
  let_inside();
  make_integrator_once();
  history_.begin(state_.t, static_cast<int>(x_.size()));
  const struct Outside {
    ~Outside() { doing = RestartCause::start; }
    RestartCause& doing;
  } after{doing_};
  forget_failure();
  begin();
  foresee_stiffness(t_end);
  t_end_ = t_end;
  headway_.begin(state_.t);
  while (!stopped_) {
    doing_ = RestartCause::tick;
    change_faults();
    pass_instant();
    tick();  // controllers, then outputs, in the order they were registered
    pass_instant();
    expire_commands();
    if (next_model_) take_in();
    if (stopped_ || state_.t >= t_end) break;
    step(std::min({t_end, schedule_.stop(), next_corner(), next_instant()}));
    if (std::exchange(within_.keep_steps, false)) keep_steps();
    if (next_model_) take_in();
    if (auto failure = headway_.stalls(state_.t, t_end_)) fail(std::move(*failure));
    if (progress) progress(state_.t);
  }
  keep_steps();
  write_outputs();
}

/// What a run begins with, once. What is refused here is refused again.
void Simulation::begin() {
  if (std::exchange(begun_, true)) return;
  try {
    schedule_.start(state_.t);
    ages_.all_set(state_.t);
    begin_faults_anew();
    start_devices();
    start_lengths();
    start_closed();
    begin_ledger();
    say_doubts();
    holds_.begin_anew = true;  // what gave way before the first tick is asked once more with its commands
  } catch (...) {
    begun_ = false;
    throw;
  }
}

/// The state as the integrator may begin with it.
void Simulation::settle() {
  bounce({});
  settle_holds();
  start_given_motion();
  if (restart_) start_closed();
}

// The integrator, at the present state.
void Simulation::restart() {
  settle();
  pack(x_.data());
  integrator_->restart(state_.t, x_.data());
  if (*restart_ != RestartCause::loops) trail_.n = 0;  // x' may be another from here on
  if (loops_ && trail_.n == 0) trail_.add(state_.t, loops_->pivot(), x_);
  history_.restarted(*restart_);
  restart_.reset();
}

// One step of the integrator towards t_stop: commands are constant, the right-hand side is smooth.
void Simulation::step(double t_stop) {
  if (restart_) restart();
  obstacle_.forget();
  drifted_ = false;
  if (momentum_ && !acted_on()) momentum_->aim(state_.q.data(), state_.v.data());
  t_evaluated_ = std::numeric_limits<double>::quiet_NaN();  // commands may be others
  const double corner = next_corner();
  StepReport report;
  stretch_ = state_.t;
  // What was passed in this instant is not located again at once: if it does not leave it is there.
  const auto stays = [&](const Limit& limit) { return is_at(limit) && !(limit.side * state_.v[limit.v] < -kLeaves * scale_of_rates()); };
  for (Limit& limit : limits_)
    limit.ahead = std::isfinite(limit.bounce.speed) && limit.side * (state_.q[limit.q] - limit.value) < 0.0 && !stays(limit);
  try {
    const Stopwatch watch(timed(&RunProfile::step));
    report = integrator_->step(t_stop, x_.data());
  } catch (const NumericsError& e) {
    history_.failed(integrator_->worst());
    fail(explain(e.failure()));
  }
  history_.stepped(report, report.t - state_.t, integrator_->worst());
  headway_.step();
  if (!thrown_.empty()) fail(explain({}));
  expect_finite(x_);
  if (loops_ && options_.integrator.method == "extended") {  // projects nothing: for the pivot alone
    std::vector<double> x = x_;
    project(report.t, x.data());
  }
  const double pivot = loops_ ? loops_->pivot() : 1.0;
  if (schedule_.time() < report.t) look_inside(report.t);
  stretch_ = std::numeric_limits<double>::infinity();
  for (Limit& limit : limits_) limit.ahead = false;
  state_.t = report.t;
  unpack(x_.data());
  if (!model_->fields.empty()) expect_within_fields();
  observed_ = ledger_known_ = false;
  if (std::exchange(within_.ledger, false)) ledger();
  if (report.stiff) say_stiff();
  if (report.rounding > 0.0) say_rounding(report);
  say_whirling();
  if (recorder_ && !report.goes_on.empty())
    recorder_->note(Note::event, state_.t, {"integrator", fmt::format("{} goes on: it costs least here", report.goes_on)});
  doing_ = RestartCause::event;
  if (report.event) pass_crossings(report.crossed);
  // v' of a prescribed motion jumps at a corner; the history of a multi-step method is not on closed loops.
  if (report.t == corner) start_anew_for(RestartCause::corner);
  if (drifted_ && integrator_->keeps_unprojected()) start_anew_for(RestartCause::loops);
  if (!loops_ || report.event || stopped_) return;
  trail_.add(state_.t, pivot, x_);
  pass_singular_posture(std::min(t_stop, schedule_.time()));
}

// x' = [ N(q) v ; v' ; z' ],  v' = M^-1 (tau + springs + devices - C + gravity + wrenches) by the articulated sweeps.
bool Simulation::rhs(double t, const double* x, double* xdot) {
  if (!plugins_) return rates(t, x, xdot);
  bool good = false;
  return unless_thrown([&] { good = rates(t, x, xdot); }, x) && good;
}

bool Simulation::rates(double t, const double* x, double* xdot) {
  if (loops_ && std::isnan(x[0])) return false;  // by project(), which knows why
  const Model& m = *model_;
  const double *q = with_given_motion(t, x), *v = q + m.nq;
  if (!evaluate(t, std::min(t, stretch_), q, xdot + m.nq)) return false;
  if (devices_) std::copy_n(devices_->zdot(), m.devices.n_z, xdot + m.nq + m.nv);
  if (!prescribed_.empty()) std::copy_n(xdot + m.nq, m.nv, vdot_.data());  // for the powers of these motions
  if (twin_)
    std::copy(qdot_twin_.begin(), qdot_twin_.end(), xdot);
  else
    m.qdot(q, v, xdot);
  return true;
}

// Of actuators and hinge loads; v' of prescribed motions.
void Simulation::apply_forces(double t, double since, const double* q, const double* v) {
  t_evaluated_ = std::numeric_limits<double>::quiet_NaN();
  if (fields_) moment_ = &fields_->at(gravity_field_, t);
  for (const HingeLoad& load : model_->loads) tau_total_[static_cast<std::size_t>(load.v)] = tau_[static_cast<std::size_t>(load.v)];
  if (devices_) tau_total_ = tau_;  // they add theirs during the sweeps
  auto limit = limits_.begin();
  for (std::size_t i = 0; i < model_->loads.size(); ++i) {
    const HingeLoad& load = model_->loads[i];
    double& at = loads_at_[i] = q[load.q];
    for (; limit != limits_.end() && limit->load == i; ++limit)
      if (limit->ahead && limit->side * (at - limit->value) > 0.0) at = limit->value;
    tau_total_[static_cast<std::size_t>(load.v)] += hinge_laws::force<double>(load, at, v[load.v]);
  }
  for (const auto& p : prescribed_) vdot_given_[static_cast<std::size_t>(p.index)] = p.profile.acceleration(t, since);
  drive_loops(t, since, drives_);
}

// v' at (t, x) with the commands as they are; `since`: on which stretch between two corners.
bool Simulation::evaluate(double t, double since, const double* x, double* vdot) {
  const double *q = x, *v = q + model_->nq;
  apply_forces(t, since, q, v);
  if (devices_) devices_->set({t, v + model_->nv, state_.marks.data(), tau_total_.data(), wrenches_.data()});
  if (!forward_dynamics(*model_, workspace_, inputs(q, v), vdot, devices_.get())) {
    obstacle_.breakdown = workspace_.breakdown;
    keep_broken(t, q);
    obstacle_.culprit = plugin_at_fault(*model_, q, v);
    if (gravity_stopped_.empty()) gravity_stopped_ = told_of_gravity();
    return false;
  }
  if (twin_ && !evaluate_twin(x, vdot)) return false;
  if (all_finite(vdot, model_->nv)) {
    if (!x_evaluated_.empty()) std::copy_n(x, x_evaluated_.size(), x_evaluated_.begin()), t_evaluated_ = t;
    return true;
  }
  obstacle_.bad_rate = first_not_finite(vdot, model_->nv);
  obstacle_.vdot = vdot[obstacle_.bad_rate];
  if (gravity_stopped_.empty()) gravity_stopped_ = told_of_gravity();
  obstacle_.culprit = plugin_at_fault(*model_, q, v);
  return false;
}

// What chose this instant for itself.
void Simulation::pass_instant() {
  if (stopped_ || next_instant() > state_.t) return;
  const Stopwatch watch(timed(&RunProfile::tasks));
  at_instant_();
}

// Everything that ticks now, one after the other: a checkpoint that one of the tasks makes knows which are still to come at this instant.
void Simulation::tick() {
  bool looked = false, acted = false;
  while (schedule_.time() <= state_.t) {
    const Schedule::Tick tick = schedule_.next();
    tick_ = tick.k;
    const Stopwatch watch(timed(&RunProfile::tasks));
    const Task& task = tasks_[static_cast<std::size_t>(tick.entry)];
    (task.looks ? looked : acted) = true;
    task.work();
  }
  if (looked && !acted && !within_.looks && !restart_ && state_.t < t_end_) ++ended_by_looking_;
}

/// What only looks and is to happen before t_end, where the step just made ends: at states inside of it, by the method's polynomial. The
/// motion goes on as if nobody had looked.
void Simulation::look_inside(double t_end) {
  constexpr double eps = std::numeric_limits<double>::epsilon(), kMissed = 1e-3;  // of what a function is at the ends of a step
  const struct Look {
    explicit Look(Simulation& of) : sim(of), drifted(of.drifted_) { sim.within_.looks = true; }
    ~Look() { sim.within_.looks = false, sim.drifted_ = drifted; }
    Look(const Look&) = delete;
    Look& operator=(const Look&) = delete;
    Simulation& sim;
    bool drifted;
  } look(*this);
  within_.x.resize(x_.size());
  const auto of_event = [&](std::size_t i, double t, const double* x) { return events_[i].function(t, x, x + model_->nq); };
  if (!events_.empty()) {
    pack(within_.x.data());
    within_.event_ends.resize(events_.size());
    for (std::size_t i = 0; i < events_.size(); ++i)
      within_.event_ends[i] = {of_event(i, state_.t, within_.x.data()), of_event(i, t_end, x_.data())};
  }
  // Between two ends of one sign, both away from zero, another one: it went through zero twice, and nobody has seen it.
  const auto expect_no_event = [&] {
    for (std::size_t i = 0; i < events_.size(); ++i) {
      const auto [begin, end] = within_.event_ends[i];
      const double least = std::min(std::abs(begin), std::abs(end));
      if (!(begin * end > 0.0) || !(std::copysign(1.0, end) * of_event(i, state_.t, within_.x.data()) < -kMissed * least)) continue;
      warn(Code::mission_doubt, {fmt::format("event \"{}\"", events_[i].name), {}},
           "its function crosses zero twice inside of a step, which ends at none of the two: it is missed",
           "integrator.max_step as short as what is to be seen, or output.between_steps = false");
    }
  };
  while (schedule_.time() < t_end) {
    const double t = schedule_.time();
    within_.t = t_end - t <= 16.0 * eps * std::abs(t_end) ? t_end : t;  // a step of rounding has no inside
    try {
      if (within_.t == t_end)
        within_.x = x_;
      else
        integrator_->interpolate(t, within_.x.data());
    } catch (const NumericsError& e) {
      fail(explain(e.failure()));
    }
    if (!thrown_.empty()) fail(explain({}));
    expect_finite(within_.x);
    state_.t = t;
    unpack(within_.x.data());
    observed_ = ledger_known_ = false;
    expect_no_event();
    tick();
  }
  if (!drives_.empty()) drive_loops(t_end, t_end, drives_);
}

/// What happens where functions of roots() crossed zero, in their order.
void Simulation::pass_crossings(std::span<const int> crossed) {
  jumped_ = false;
  handle_events(crossed);
  const auto corners = crossed.subspan(events_.size(), limits_.size()), devices = crossed.subspan(events_.size() + limits_.size());
  const auto edges = crossed.last(static_cast<std::size_t>(model_->devices.n_edges));
  bool at_corner = false;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (corners[i] == 0) continue;
    limits_[i].passed = state_.t;
    // Where its rate is the other way, what a multistep method has between states went there within their error, and would again anew.
    at_corner = at_corner || corners[i] * state_.v[limits_[i].v] >= 0.0;
  }
  bounce(corners);
  const auto any = [](std::span<const int> of) { return std::ranges::any_of(of, [](int side) { return side != 0; }); };
  if (device_events(devices) || at_corner || any(edges))
    start_anew_for(RestartCause::event);  // a stop begins or ends to push, a device changed, a shadow begins: a corner
}

void Simulation::handle_events(std::span<const int> crossed) {
  for (std::size_t i = 0; i < events_.size() && !stopped_; ++i)
    if (crossed[i] != 0 && (events_[i].direction == 0 || events_[i].direction == crossed[i])) {
      if (auto failure = headway_.storms(state_.t, t_end_, events_[i].name)) fail(std::move(*failure));
      if (recorder_ && events_[i].noted) recorder_->note(Note::event, state_.t, {events_[i].name, crossed[i] > 0 ? "rising" : "falling"});
      if (!events_[i].action) continue;
      const struct InEvent {
        explicit InEvent(bool& of) : flag(of) { flag = true; }
        ~InEvent() { flag = false; }
        InEvent(const InEvent&) = delete;
        InEvent& operator=(const InEvent&) = delete;
        bool& flag;
      } here(in_event_);
      events_[i].action();
    }
}

}  // namespace cardan
