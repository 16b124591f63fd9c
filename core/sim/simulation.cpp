#include "core/sim/simulation.hpp"
#include "core/abi/port_vectors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>

#include "core/base/finite.hpp"
#include "core/base/noise.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/model/device_units.hpp"
#include "core/sim/choose_method.hpp"
#include "core/sim/diagonalised_form.hpp"
#include "core/sim/expected_stiffness.hpp"
#include "core/sim/fastest_motion.hpp"
#include "core/sim/newton_operators.hpp"
#include "core/sim/plugin_faults.hpp"
#include "core/sim/twin_dynamics.hpp"
#include "core/sim/vehicle_extended.hpp"
#include "core/sim/vehicle_implicit_form.hpp"
#include "core/sim/vehicle_linear_part.hpp"
#include "core/sim/vehicle_momentum_form.hpp"
#include "core/soa/program.hpp"

namespace cardan {
namespace {

// Of closed loops, relative to their size:
constexpr double kDrift = 10.0;         // relative tolerances that the history of an integrator may be off before it starts anew
constexpr double kGivenOpen = 1e-6;     // what a state that was given may be open by: typed numbers have a finite number of digits
constexpr double kGivenDrift = 1e3;     // ... or so many relative tolerances
constexpr double kNearSingular = 1e-3;  // a scaled pivot below is told of: of loops in good postures they are above 0.05

double pace_of(const Eigen::VectorXd& v) { return std::max(1.0, v.size() == 0 ? 0.0 : v.cwiseAbs().maxCoeff<Eigen::PropagateNaN>()); }

}  // namespace

Simulation::Simulation(std::shared_ptr<const Model> model, const SimulationOptions& options)
    : own_(model->changes() ? std::make_shared<Model>(*model) : nullptr),
      model_(own_ ? std::shared_ptr<const Model>(own_) : std::move(model)),
      now_(identity(*model_)),
      options_(options),
      state_(model_->initial_state()),
      workspace_(*model_) {
  soa::instruction_set();  // refused before the run where the wished ones cannot run here
  tau_.assign(static_cast<std::size_t>(model_->nv), 0.0);
  build();
  sample_devices(false);
}

/// All that hangs on the model, beside state and commands.
void Simulation::build() {
  const Model& m = *model_;
  twin_.reset();
  tau_total_ = tau_;
  vdot_given_.assign(static_cast<std::size_t>(m.nv), 0.0);
  vdot_ = Eigen::VectorXd::Zero(m.nv);
  normalised_ = std::ranges::any_of(m.user, [](const UserBody& u) { return u.nq > 0 && u.hinge->normalise; });
  plugins_ = has_plugins(m);
  limits_.clear();
  for (const HingeLoad& load : m.loads)
    for (const std::size_t side : {0, 1})
      if (load.law == HingeLaw::stop && std::isfinite(load.p[side]))
        limits_.push_back({load.q, load.v, side == 0 ? -1 : 1, load.p[side], load.bounce});
  x_given_.assign(static_cast<std::size_t>(m.nq + m.nv + m.devices.n_z), 0.0);
  prescribed_.clear();
  for (int i = 0; i < m.nv; ++i) {
    if (!m.has_given_motion(i)) continue;
    int coordinate = -1;
    for (const PlainRates& r : m.plain_rates)
      if (i >= r.v && i < r.v + r.n) coordinate = r.q + i - r.v;
    prescribed_.push_back({i, coordinate, MotionProfile::hold(state_.v[i])});
  }
  prescribed_loops_.clear();
  for (const Loop& loop : m.loops.all)
    if (loop.drive >= 0) prescribed_loops_.push_back({loop.name, MotionProfile::hold()});
  drives_.assign(prescribed_loops_.size(), {});
  // Impulse from outside is zero, and its rates need no world poses, when nothing touches the system but its own hinges.
  world_rates_ = m.gravity.kind != GravitySpec::Kind::none || m.devices.n_loads > 0;
  roots_.clear();
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    if (m.user[i].parent >= 0) continue;
    roots_.push_back(static_cast<int>(i));
    if (m.user[i].nv < 6) world_rates_ = true;
  }
  observer_ = std::make_unique<Observer>(m, workspace_);
  fields_.reset();
  moment_ = nullptr;
  if ((gravity_field_ = field_of_gravity(m)) >= 0) {
    fields_ = std::make_unique<FieldMoments>(m);
    moment_ = &fields_->at(gravity_field_, state_.t);
  }
  loops_.reset();
  if (!m.loops.empty()) loops_ = std::make_unique<LoopProjection>(m), world_rates_ = true;
  devices_.reset(), on_trial_.reset(), beside_.reset(), holding_.reset();
  stores_ = false;
  wrenches_.assign(static_cast<std::size_t>(m.devices.n_loads), {});
  if (m.devices.all.empty()) return;
  devices_ = std::make_unique<DeviceForces>(m, own_.get());
  for (const Device& d : m.devices.all)
    for (const DeviceMount& mount : d.mounts)
      if (mount.node >= 0 && (mount.use & CARDAN_USE_LOAD) != 0) wrenches_[static_cast<std::size_t>(mount.load)].node = mount.node;
  stores_ = std::ranges::any_of(m.devices.all, [](const Device& d) { return d.family->momentum != nullptr; });
  resolve_delays();
  last_set_.assign(m.devices.timeouts.size(), 0.0);
  if (!m.devices.holds.empty()) holding_ = std::make_unique<Holding>(m, own_.get());
  if (m.devices.n_roots == 0) return;
  on_trial_ = std::make_unique<DeviceForces>(m);
  if (m.devices.reads_nodes) {
    beside_ = std::make_unique<Workspace>(m);
    beside_->require_world();
  }
}

Simulation::~Simulation() = default;

void Simulation::set_state(const State& state) {
  state_ = state;
  if (state_.z.size() != model_->devices.n_z) state_.z = Eigen::VectorXd::Map(model_->devices.z0.data(), model_->devices.n_z);
  if (state_.marks.size() != model_->devices.n_marks)
    state_.marks = Eigen::VectorXd::Map(model_->devices.marks0.data(), model_->devices.n_marks);
  rates_were_set_ = true;
  changed();
}

/// The masses of the present state; a fault of a device is told where the dynamics come upon it.
void Simulation::weigh() {
  int device = -1;
  if (own_) own_->weigh(state_.z.data(), state_.marks.data(), device);
}

/// Body or device, and which of its states; `state`: index into [q, v, z].
std::pair<std::string, std::string> Simulation::named_state(int state) const {
  const Model& m = *model_;
  for (const Device& d : m.devices.all) {
    const int i = state - m.nq - m.nv - d.z;
    if (i >= 0 && i < static_cast<int>(d.family->n_states)) return {d.name, d.family->states[i].name};
  }
  const bool is_q = state < m.nq;
  for (const UserBody& u : m.user) {
    const int i = is_q ? state - u.q : state - m.nq - u.v;
    const auto& names = is_q ? u.q_names : u.v_names;
    if (i >= 0 && i < std::ssize(names)) return {u.name, names[static_cast<std::size_t>(i)]};
    const int mode = is_q ? state - u.eta : state - m.nq - u.etadot;
    if (u.n_modes > 0 && mode >= 0 && mode < u.n_modes) return {u.name, fmt::format("mode {}", mode + 1)};
  }
  return {"", fmt::format("state {}", state)};
}

RunFailure Simulation::not_finite(int state, double value) const {
  RunFailure f{Code::not_finite, state_.t, "", "", "", "too large a step, or a command that grows without limit?", ""};
  std::tie(f.body, f.what) = named_state(state);
  f.what += std::isnan(value) ? " = nan" : value > 0 ? " = inf" : " = -inf";
  return f;
}

void Simulation::keep_steps() {
  if (!integrator_) return;
  const StepInterval* interval = history_.close(state_.t, statistics(), recorder_ != nullptr);
  if (interval && recorder_) note(*recorder_, *interval);
}

void Simulation::expect_finite(const std::vector<double>& x) {
  const int n = static_cast<int>(x.size());
  if (all_finite(x.data(), n)) return;
  const int bad = first_not_finite(x.data(), n);
  fail(not_finite(bad, x[static_cast<std::size_t>(bad)]));
}

/// What the sweeps know about a step that the integrator gave up.
RunFailure Simulation::explain(const RunFailure& failure) const {
  if (!thrown_.empty())
    return {Code::plugin_failed, state_.t, "", "", thrown_, "a fault of the plugin: cardan check-plugin tries what it can", ""};
  if (const std::string told = gravity_stopped_.empty() ? told_of_gravity() : gravity_stopped_; !told.empty())
    return {Code::field_failed,
            state_.t,
            "",
            "",
            told,
            "where the vehicle is may be outside of what the field knows: another field, or `outside: hold` where it can hold",
            ""};
  if (breakdown_.body != 0) {
    RunFailure f = describe_breakdown(*model_, breakdown_, state_.t);
    if (!std::isfinite(breakdown_.value)) f.code = Code::not_finite;
    if (!culprit_.empty()) f.hint = culprit_;
    return f;
  }
  if (const FieldFault* tried = devices_ ? devices_->tried_limit() : nullptr) return beyond_a_field(*tried);
  if (devices_ && devices_->fault().device >= 0) {
    const Device& d = model_->devices.all[static_cast<std::size_t>(devices_->fault().device)];
    return {Code::device_failed,
            state_.t,
            "",
            "",
            fmt::format("{}: {}", told_device(d), devices_->fault().what),
            "its parameters and inputs; what it reads may be outside of what it is made for",
            ""};
  }
  if (bad_rate_ < 0) {
    RunFailure f = failure;
    if (f.code != Code::step_too_small || integrator_->worst() < 0) return f;
    std::string state;
    std::tie(f.body, state) = named_state(integrator_->worst());
    f.what += fmt::format(", most of it that of {}", state);
    return f;
  }
  RunFailure f = not_finite(model_->nq + bad_rate_, vdot_bad_);
  if (!culprit_.empty()) f.hint = culprit_;
  return f;
}

RunFailure Simulation::beyond_a_field(const FieldFault& fault) const {
  const Device& d = model_->devices.all[static_cast<std::size_t>(fault.device)];
  return {Code::device_failed,
          state_.t,
          "",
          "",
          fmt::format("{}: {}", told_device(d), fault.what),
          "another field, or `outside: hold` where it can hold",
          ""};
}

void Simulation::warn(Code code, Located at, std::string about, std::string hint) {
  const std::size_t before = warnings_.all().size();
  warnings_.add(code, std::move(at), std::move(about), std::move(hint), state_.t);
  if (warnings_.all().size() == before) return;
  if (recorder_) note(*recorder_, warnings_.all().back());
  if (told_) told_(warnings_.all().back());
}

void Simulation::take_over(const Simulation& other) {
  set_state(other.state_);
  tau_ = other.tau_;
  tau_total_ = other.tau_;
  prescribed_ = other.prescribed_;
  prescribed_loops_ = other.prescribed_loops_, drives_ = other.drives_;
  if (devices_ && other.devices_) devices_->commands = other.devices_->commands;
  if (delayed_.size() == other.delayed_.size()) delayed_ = other.delayed_;
  for (std::size_t i = 0; i < std::min(wrenches_.size(), other.wrenches_.size()); ++i) wrenches_[i].f = other.wrenches_[i].f;
}

void Simulation::every(Rational period, std::function<void()> task, Rational offset) {
  schedule_.add(period, offset);
  tasks_.push_back(std::move(task));
}

void Simulation::add_event(Event event) {
  events_.push_back(std::move(event));
  event_times_.resize(1000);
}

/// As many events as the ring holds, in less than 1e-7 of the time that is left: the end is more than 1e10 events away.
void Simulation::expect_no_storm(const Event& event) {
  double& earliest = event_times_[events_seen_ % event_times_.size()];
  const double span = state_.t - earliest;
  if (events_seen_ >= event_times_.size() && span <= 1e-7 * (t_end_ - state_.t))
    fail({Code::event_storm, state_.t, "", "",
          fmt::format("{} events in the last {:.2g} s, the last of them \"{}\"", event_times_.size(), span, event.name),
          "let the action leave the zero of `when` for good: a band (hysteresis), a latch, a smallest time between two events", ""});
  earliest = state_.t;
  ++events_seen_;
}

/// Looks once in so many steps whether the end can be reached at all.
void Simulation::expect_progress() {
  constexpr long kLook = 200'000;
  if (steps_ - looked_at_ < kLook) return;
  const double advanced = state_.t - t_looked_at_, left = t_end_ - state_.t;
  looked_at_ = steps_, t_looked_at_ = state_.t;
  if (!std::isfinite(left) || left <= 1e7 * advanced) return;
  fail({Code::step_too_small, state_.t, "", "",
        fmt::format("time does not advance: the last {} steps went {:.2g} s further, {:.3g} s are left", kLook, advanced, left),
        "rates or a stiffness beyond all measure, or a max_step or step that is far too small", ""});
}

/// Before the first step.
void Simulation::foresee_stiffness(double t_end) {
  const Warnings expected = expected_stiffness(model_, state_.q.data(), options_.integrator, schedule_.shortest_period(), t_end - state_.t);
  for (const Warning& w : expected.all()) warn(w.what.code, w.what.at, w.what.about, w.what.hint);
}

/// The integrator found that stability sets its steps.
void Simulation::say_stiff() {
  const FastestMotion fastest = warned_stiff_ ? FastestMotion{} : fastest_motion(model_, state_.q.data());
  warned_stiff_ = true;
  const double h = statistics().last_step;
  warn(Code::stiff_scene, {"integrator.method", {}},
       fmt::format("stability and not accuracy sets the steps of {}, {:.2g} s: {:.1e} of them are left{}", integrator_name(), h,
                   (t_end_ - state_.t) / h,
                   fastest.rate > 0 ? fmt::format("; fastest is {}, {:.3g} 1/s", fastest.what, fastest.rate) : std::string()),
       kStiffHint);
}

/// "boom.angle" of a velocity component.
std::string Simulation::name_of(int v_index) const {
  for (const UserBody& u : model_->user) {
    const int i = v_index - u.v, n = static_cast<int>(u.v_names.size());
    if (i >= 0 && i < n) return u.name + "." + u.v_names[static_cast<std::size_t>(i)];
    if (const int mode = v_index - u.etadot; u.n_modes > 0 && mode >= 0 && mode < u.n_modes)
      return fmt::format("{}, mode {}", u.name, mode + 1);
  }
  return "velocity " + std::to_string(v_index);
}

void Simulation::prescribe(int v_index, MotionProfile profile) {
  const auto p = std::ranges::find(prescribed_, v_index, &Prescribed::index);
  if (p == prescribed_.end())
    refuse(Code::bad_initial_state, {"profile of " + name_of(v_index)}, "a component that is prescribed", "one that is free to move",
           "say so in the vehicle: hinge.prescribed");
  p->profile = std::move(profile);
  p->given = true;
  if (begun_) start_given_motion();
  changed();
}

void Simulation::prescribe_loop(std::string_view loop, MotionProfile profile) {
  const auto p = std::ranges::find(prescribed_loops_, loop, &PrescribedLoop::name);
  if (p == prescribed_loops_.end())
    refuse(Code::bad_initial_state, {fmt::format("profile of {}", loop)}, "a loop that is prescribed, and closed", "one that is not",
           "say so in the vehicle: loops.<name>.prescribed");
  p->more_0 = p->more(state_.t), p->t_0 = state_.t;
  const double before = p->profile.rate(state_.t), rate = profile.rate(state_.t);
  if (begun_ && std::abs(rate - before) > 1e-9 * std::max(std::abs(rate), std::abs(before))) {
    struck_by_loops_ = true;
    warn(Code::mission_doubt, {fmt::format("profile of {}", loop), {}},
         fmt::format("the rate is {:.6g} and the profile's {:.6g}: it jumps, and the vehicle takes it as a blow", before, rate),
         "let the profile begin with the rate that is there, and change it over a time");
  }
  p->profile = std::move(profile);
  p->given = true;
  changed();
}

const MotionProfile* Simulation::loop_profile(std::string_view loop) const {
  const auto p = std::ranges::find(prescribed_loops_, loop, &PrescribedLoop::name);
  return p == prescribed_loops_.end() || !p->given ? nullptr : &p->profile;
}

/// `since`: as in MotionProfile::acceleration().
void Simulation::drive_loops(double t, double since, std::vector<LoopDrive>& drives) const {
  drives.resize(prescribed_loops_.size());
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const PrescribedLoop& p = prescribed_loops_[i];
    drives[i] = {p.more(t), p.profile.rate(t), p.profile.acceleration(t, since)};
  }
}

/// Rates are those of the profiles from now on, coordinates go on from where they are.
void Simulation::start_given_motion() {
  for (PrescribedLoop& p : prescribed_loops_) p.more_0 = p.more(state_.t), p.t_0 = state_.t;
  for (Prescribed& p : prescribed_) {
    double& v = state_.v[p.index];
    if (!p.given && p.profile.rate(state_.t) != v) p.profile = MotionProfile::hold(v);
    const double rate = p.profile.rate(state_.t), before = v;
    if (std::abs(rate - before) > 1e-9 * std::max(std::abs(rate), std::abs(before)) && (begun_ || before != 0.0))
      warn(Code::mission_doubt, {"profile of " + name_of(p.index), {}},
           fmt::format("the rate is {:.6g} and the profile's {:.6g}: it jumps, and what that does to other bodies is left out", before,
                       rate),
           "let the profile begin with the rate that is there, and change it over a time");
    v = rate;
    p.t_0 = state_.t;
    if (p.coordinate >= 0) p.q_0 = state_.q[p.coordinate];
  }
}

void Simulation::give_motion(double t, double* q, double* v) const {
  for (const Prescribed& p : prescribed_) {
    v[p.index] = p.profile.rate(t);
    if (p.coordinate >= 0) q[p.coordinate] = p.q_0 + p.profile.travel(p.t_0, t);
  }
}

/// x as the physics sees it: prescribed components are functions of time and not what was integrated of them.
const double* Simulation::with_given_motion(double t, const double* x) {
  if (prescribed_.empty()) return x;
  std::copy_n(x, x_given_.size(), x_given_.begin());
  give_motion(t, x_given_.data(), x_given_.data() + model_->nq);
  return x_given_.data();
}

const MotionProfile* Simulation::profile(int v_index) const {
  const auto p = std::ranges::find(prescribed_, v_index, &Prescribed::index);
  return p == prescribed_.end() || !p->given ? nullptr : &p->profile;
}

int Simulation::add_wrench(int node, bool world_axes) {
  if (!model_->has(OpCode::node_wrenches) || (world_axes && !model_->has(OpCode::world)))
    throw std::logic_error("add_wrench: compile the model with CompileOptions::node_wrenches, in world axes also world_wrenches");
  NodeWrench w;
  w.node = node;
  w.world_axes = world_axes;
  wrenches_.push_back(w);
  world_rates_ = true;
  return static_cast<int>(wrenches_.size()) - model_->devices.n_loads - 1;
}

void Simulation::record(Recorder& recorder, std::vector<Output> outputs, Rational period) {
  sample_devices(true);
  recorder_ = &recorder;
  for (const Warning& w : warnings_.all()) note(recorder, w);
  outputs_ = std::move(outputs);
  std::size_t n = 0;
  for (const Output& o : outputs_) n += o.channel.components.size();
  row_.assign(n, 0.0);
  every(period, [this] { write_outputs(); });
}

void Simulation::set_force(int i, double value) {
  if (tau_[static_cast<std::size_t>(i)] == value) return;
  tau_[static_cast<std::size_t>(i)] = tau_total_[static_cast<std::size_t>(i)] = value;
  changed();
}

void Simulation::set_wrench(int slot, const Force<double>& f) {
  wrenches_[static_cast<std::size_t>(model_->devices.n_loads + slot)].f = f;
  changed();
}

void Simulation::set_device_input(int i, double value) {
  double& command = devices_->commands[static_cast<std::size_t>(i)];
  for (std::size_t k = 0; k < last_set_.size(); ++k)
    if (model_->devices.timeouts[k].input == i) last_set_[k] = state_.t;
  if (command == value) return;
  command = value;
  const auto& all = model_->devices.all;
  const auto owner = std::find_if(all.begin(), all.end(), [&](const Device& d) { return i < d.in + d.n_in; });
  if (owner->acts) return changed();
  observed_ = ledger_known_ = false;  // read anew; the motion goes on as it was
}

std::vector<double> Simulation::applied_forces() {
  std::vector<double> tau = tau_;
  if (devices_) observe(), devices_->add_hinge_forces(tau.data());
  return tau;
}

void Simulation::pack(double* x) const {
  x = std::copy_n(state_.q.data(), model_->nq, x);
  x = std::copy_n(state_.v.data(), model_->nv, x);
  std::copy_n(state_.z.data(), model_->devices.n_z, x);
}

void Simulation::unpack(const double* x) {
  std::copy_n(x, model_->nq, state_.q.data());
  std::copy_n(x + model_->nq, model_->nv, state_.v.data());
  std::copy_n(x + model_->nq + model_->nv, model_->devices.n_z, state_.z.data());
  weigh();
}

void Simulation::make_integrator_once() {
  if (integrator_) return;
  x_.assign(static_cast<std::size_t>(model_->nq + model_->nv + model_->devices.n_z), 0.0);
  if (options_.integrator.method == "auto") {
    MethodChoice choice = choose_method(model_, schedule_.shortest_period(), options_.integrator, options_.dynamics);
    options_.integrator = std::move(choice.options);
    why_ = std::move(choice.why);
  }
  diagonalise();
  OdeProblem problem = ode();
  if (diagonalised_) problem = diagonalised_->problem(std::move(problem));
  time_calls(problem);
  integrator_ = make_integrator(std::move(problem), options_.integrator);
  if (diagonalised_) integrator_ = diagonalised_->integrator(std::move(integrator_));
}

/// With diagonalised `dynamics`.
void Simulation::diagonalise() {
  diagonalised_.reset();
  if (!is_diagonalised(options_.dynamics)) return;
  diagonalised_ = std::make_unique<DiagonalisedForm>(
      model_, options_.dynamics, options_.integrator,
      DiagonalisedForm::Hooks{.give = [this](double t, double* q, double* v) { give_motion(t, q, v); },
                              .guard = [this](const std::function<void()>& work) { return unless_thrown(work); },
                              .broken =
                                  [this](const soa::Breakdown& breakdown, const double* q) {
                                    breakdown_ = breakdown;
                                    culprit_ = plugin_at_fault(*model_, q, state_.v.data());
                                  }});
}

std::vector<double> Simulation::absolute_tolerances(const Model& m) const {
  const double absolute = options_.absolute_tolerance != 0 ? options_.absolute_tolerance : options_.integrator.relative_tolerance;
  std::vector<double> all(static_cast<std::size_t>(m.nq + m.nv), absolute);
  const TolerancesByKind& by = options_.tolerances;
  const auto or_absolute = [absolute](double x) { return x > 0.0 ? x : absolute; };
  for (const UserBody& u : m.user) {
    for (int i = 0; i < u.nq; ++i) {
      const std::string& unit = u.q_units[static_cast<std::size_t>(i)];  // "1": of a quaternion, half an angle
      double& tolerance = all[static_cast<std::size_t>(u.q + i)];
      if (unit == "m") tolerance = or_absolute(by.position);
      if (unit == "rad") tolerance = or_absolute(by.angle);
      if (unit == "1" && u.has_attitude() && by.angle > 0.0) tolerance = 0.5 * by.angle;
    }
    for (int i = 0; i < u.nv; ++i) {
      const std::string& unit = u.v_units[static_cast<std::size_t>(i)];
      double& tolerance = all[static_cast<std::size_t>(m.nq + u.v + i)];
      if (unit == "m/s") tolerance = or_absolute(by.velocity);
      if (unit == "rad/s") tolerance = or_absolute(by.rate);
    }
  }
  for (const double nominal : m.devices.nominal) all.push_back(absolute * nominal);
  // A mass-normalised modal coordinate that moves the body as much as 1 m of a rigid one is far larger than those in use:
  // eta counts as 1e-3 (slow modes) and as (1 rad/s / omega)^2 of that for fast ones, eta' as omega times it.
  for (const SweepBody& b : m.bodies) {
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = m.flexible[static_cast<std::size_t>(b.flexible)];
    for (int j = 0; j < b.n_modes; ++j) {
      const auto at = static_cast<std::size_t>(f.K_diagonal ? j : j * b.n_modes + j);
      const double w2 = std::max(1.0, f.K[at] / f.M_ee[static_cast<std::size_t>(j * b.n_modes + j)]);
      all[static_cast<std::size_t>(b.eta + j)] = 1e-3 * or_absolute(by.modes) / w2;
      all[static_cast<std::size_t>(m.nq + b.etadot + j)] = 1e-3 * or_absolute(by.modes) / std::sqrt(w2);
    }
  }
  return all;
}

// Onto closed loops. false: they cannot be closed from there.
bool Simulation::close_loops(double t, double* q, double* v) {
  bool closed = false;
  drive_loops(t, std::min(t, stretch_), drives_);
  unless_thrown([&] { closed = loops_->close(q, v, drives_.data()); });
  if (!closed) breakdown_ = loops_->breakdown();
  if (closed && loops_->pivot() < kNearSingular) tell_near_singular();
  drifted_ = drifted_ || loops_->distance() > kDrift * options_.integrator.relative_tolerance;
  return closed;
}

// Once for each loop.
void Simulation::tell_near_singular() {
  const int row = loops_->weakest();
  const Loop& loop = *std::ranges::find_if(model_->loops.all, [row](const Loop& l) { return row < l.first + l.rows; });
  Located at = model_->spec->locate("loops." + loop.name);
  for (const Warning& w : warnings_.all())
    if (w.what.code == Code::near_singular && w.what.at.key_path == at.key_path) return;
  warn(Code::near_singular, std::move(at),
       fmt::format("row {} of the loop has a scaled pivot of {:.2g}, below {:g}", row - loop.first + 1, loops_->pivot(), kNearSingular),
       "multipliers grow as its inverse, and the way on may be another branch: see docs/errors.md");
}

// Of loops whose length or offset is given: initial rates that move it are those of its profile.
void Simulation::expect_profiles() {
  if (std::ranges::all_of(prescribed_loops_, &PrescribedLoop::given)) return;
  start_lengths();
}

void Simulation::start_lengths() {
  if (drives_.empty()) return;
  const Eigen::VectorXd rates = loop_matrix(*model_, workspace_, state_.q.data(), drives_.data()) * state_.v;
  observed_ = ledger_known_ = false;
  const double limit = kGivenOpen * pace_of(state_.v);
  for (const Loop& loop : model_->loops.all) {
    if (loop.drive < 0) continue;
    const PrescribedLoop& p = prescribed_loops_[static_cast<std::size_t>(loop.drive)];
    const double rate = rates[loop.first], wanted = p.profile.rate(state_.t);
    if (std::abs(rate) <= limit || std::abs(rate - wanted) <= limit) continue;  // from rest the vehicle begins with the profile's
    const auto unit = [&](double x) { return fmt::format("{:.6g}{}", x, loop.closing == Closing::distance ? " m/s" : " 1/s"); };
    if (!p.given)
      refuse(Code::open_start, model_->spec->locate("loops." + loop.name),
             "a profile that begins with its rate, or initial rates that leave it as it is", unit(rate),
             fmt::format("in the mission: sat:loop(\"{}\"):profile{{...}}", loop.name));
    warn(Code::mission_doubt, {fmt::format("profile of {}", loop.name), {}},
         fmt::format("the rate is {} and the profile's {}: the vehicle begins with that of the profile", unit(rate), unit(wanted)),
         "give `initial` of the hinges rates that go with it, or none");
  }
}

// A state that was given is closed but for rounding and typing.
void Simulation::start_closed() {
  if (!loops_) return;
  breakdown_ = {};
  const double pace = pace_of(state_.v);
  const bool struck = std::exchange(struck_by_loops_, false);
  Momentum p_before;
  Energy e_before;
  if (struck) ledger(), p_before = momentum(), e_before = energy();
  if (!close_loops(state_.t, state_.q.data(), state_.v.data())) fail(explain({}));
  const double limit = std::max(kGivenOpen, kGivenDrift * options_.integrator.relative_tolerance);
  const double open = prescribed_.empty() && drives_.empty() ? std::max(loops_->distance(), loops_->rate() / pace) : loops_->distance();
  if (!(open <= limit)) {
    breakdown_ = {.body = 1, .value = open, .limit = limit, .row = loops_->worst()};
    fail(explain({}));
  }
  drifted_ = false;
  if (!struck) return;
  observed_ = ledger_known_ = false;
  const Momentum p = momentum();
  Balances::Integrals given;
  given << p.linear - p_before.linear, p.angular - p_before.angular, energy().total() - e_before.total();
  balances_.jump(given);
}

/// The functions that an integrator calls, each with a clock around it.
void Simulation::time_calls(OdeProblem& ode) {
  if (!times_) return;
  const auto around = [this](auto& function, RunProfile::Part RunProfile::*part) {
    if (!function) return;
    function = [this, part, inner = std::move(function)](auto... arguments) {
      const Stopwatch watch(timed(part));
      return inner(arguments...);
    };
  };
  around(ode.rhs, &RunProfile::rhs), around(ode.integrands, &RunProfile::ledger);
  around(ode.roots, &RunProfile::events), around(ode.project, &RunProfile::projection);
}

OdeProblem Simulation::ode() {
  const Model& m = *model_;
  if (options_.absolute_tolerance != 0 && !(options_.absolute_tolerance > 0 && options_.absolute_tolerance <= 1))
    refuse(Code::out_of_range, {"integrator.absolute"}, "a number > 0 and at most 1", fmt::format("{:g}", options_.absolute_tolerance));
  const TolerancesByKind& by = options_.tolerances;
  for (const auto& [kind, x] :
       {std::pair{"angle", by.angle}, {"position", by.position}, {"rate", by.rate}, {"velocity", by.velocity}, {"modes", by.modes}})
    if (!(x >= 0.0 && x <= 1e300))
      refuse(Code::out_of_range, {std::string("integrator.tolerances.") + kind}, "a number > 0, or 0 for none", fmt::format("{:g}", x));
  start_given_motion();
  OdeProblem ode;
  ode.n = m.nq + m.nv + m.devices.n_z;
  ode.n_quadrature = options_.ledger ? Balances::kIntegrals : 0;
  ode.rough_integrands =
      m.devices.rough || std::ranges::any_of(m.loads, [](const HingeLoad& load) { return load.law != HingeLaw::spring; });
  ode.rhs = [this](double t, const double* x, double* xdot) { return rhs(t, x, xdot); };
  ode.integrands = [this](double t, const double* x, double* ydot) {
    if (!unless_thrown([&] { integrands(t, x, ydot); })) std::fill_n(ydot, Balances::kIntegrals, 0.0);
  };
  if (normalised_ || !prescribed_.empty() || loops_)
    ode.project = [this](double t, double* x) {
      if (normalised_) unless_thrown([&] { model_->normalise(x); });
      give_motion(t, x, x + model_->nq);
      if (loops_ && !close_loops(t, x, x + model_->nq)) x[0] = std::numeric_limits<double>::quiet_NaN();  // a smaller step, or the end
      if (momentum_ && !acted_on()) momentum_->keep(x, x + model_->nq);
    };
  ode.absolute_tolerance = absolute_tolerances();
  ode.group.assign(static_cast<std::size_t>(ode.n), 0);
  for (const SweepBody& b : m.bodies) {
    std::fill_n(ode.group.begin() + b.eta, b.n_modes, 1);
    std::fill_n(ode.group.begin() + m.nq + b.etadot, b.n_modes, 1);
  }
  std::fill_n(ode.group.begin() + m.nq + m.nv, m.devices.n_z, 2);
  ode.n_roots = static_cast<int>(events_.size() + limits_.size() + m.devices.holds.size()) + m.devices.n_roots;
  if (ode.n_roots > 0)
    ode.roots = [this](double t, const double* x, double* g) {
      for (std::size_t i = 0; i < events_.size(); ++i) g[i] = events_[i].function(t, x, x + model_->nq);
      for (std::size_t i = 0; i < limits_.size(); ++i) g[events_.size() + i] = x[limits_[i].q] - limits_[i].value;
      double* of_devices = g + events_.size() + limits_.size();
      const bool known = unless_thrown([&] {
        if (model_->devices.n_roots > 0) device_roots(t, x, of_devices);
        if (holding_) hold_roots(t, x, of_devices + model_->devices.n_roots);
      });
      if (!known) std::fill_n(of_devices, static_cast<std::size_t>(model_->devices.n_roots) + model_->devices.holds.size(), 1.0);
    };
  twin_.reset();
  if (options_.dynamics == Dynamics::dense) {
    expect_twin_takes(m, options_.integrator);
    twin_ = std::make_unique<TwinDynamics<double>>(m);
  }
  if (options_.integrator.method == "extended")
    ode.extended = std::make_shared<VehicleExtended>(
        model_, ode.absolute_tolerance, options_.integrator.relative_tolerance,
        [this] {
          ExtendedLoads loads{.tau = tau_, .wrenches = wrenches_};
          for (const Prescribed& p : prescribed_) loads.motions.push_back({p.index, p.coordinate, &p.profile});
          for (const PrescribedLoop& p : prescribed_loops_) loads.lengths.push_back({p.more_0, &p.profile});
          return loads;
        },
        ExtendedIntegrands{ode.n_quadrature, [this, xdot = std::vector<double>(static_cast<std::size_t>(ode.n))](double t, const double* x,
                                                                                                                 double* y) mutable {
                             return rhs(t, x, xdot.data()) && unless_thrown([&] { integrands(t, x, y); });
                           }});
  momentum_.reset();
  if (advances_linear_part(options_.integrator.method)) {
    ode.linear = std::make_shared<VehicleLinearPart>(model_, options_.integrator.method);
    if (MomentumKeeper::honours(m) && !own_) momentum_ = std::make_unique<MomentumKeeper>(m);
  }
  if (options_.integrator.method.starts_with("variational"))
    ode.momenta = std::make_shared<VehicleMomentumForm>(
        model_,
        [this](double t, const double* q, const double* v) {
          apply_forces(t, t, q, v);
          return inputs(q, v);
        },
        [this](const std::function<void()>& work) { return unless_thrown(work); });
  if (options_.integrator.method == "ida") {
    ode.implicit = std::make_shared<VehicleImplicitForm>(
        model_, m.loops.absolute ? absolute_tolerances(*m.loops.absolute->bodies) : std::vector<double>(),
        [this](double t, const double* q, const double* v) { return act(t, q, v) ? &acting_ : nullptr; },
        [this](double t, double* q, double* v) {
          drive_loops(t, std::min(t, stretch_), drives_);
          give_motion(t, q, v);
          return drives_.data();
        },
        [this](const std::function<void()>& work) { return unless_thrown(work); });
  }
  if (options_.integrator.linear_solver != "krylov") return ode;
  newton_ = std::make_unique<NewtonOperators>(model_, devices_.get());
  x_evaluated_.resize(static_cast<std::size_t>(ode.n));
  const auto jacobian_times = [this](double t, const double* x, const double* dx, double* J_dx) {
    const double *q = with_given_motion(t, x), *v = q + model_->nq;
    // For their values, which the right-hand side at this very state has left behind for all directions.
    const bool known = t_evaluated_ == t && std::equal(x_evaluated_.begin(), x_evaluated_.end(), q);
    if (devices_ && !known && !evaluate(t, std::min(t, stretch_), q, vdot_.data())) return false;
    if (!devices_) apply_forces(t, std::min(t, stretch_), q, v);
    return newton_->jacobian_times(inputs(q, v), dx, J_dx);
  };
  ode.jacobian_times = [this, jacobian_times](double t, const double* x, const double* dx, double* J_dx) {
    bool good = false;
    return unless_thrown([&] { good = jacobian_times(t, x, dx, J_dx); }) && good;
  };
  ode.prepare = [this](double, const double* x, double gamma, bool moved) { return newton_->prepare(x, gamma, moved); };
  ode.precondition = [this](const double* r, double* z) {
    newton_->precondition(r, z);
    return true;
  };
  return ode;
}

// Loads and forces at (t, q, v), of devices too, without dynamics.
bool Simulation::act(double t, const double* q, const double* v) {
  apply_forces(t, std::min(t, stretch_), q, v);
  acting_ = inputs(q, v);
  if (!devices_) return true;
  devices_->set({t, state_.z.data(), state_.marks.data(), tau_total_.data(), wrenches_.data()});
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  S.ground(*model_, workspace_, acting_);
  soa::run_kinematics(*model_, S, workspace_, acting_);
  return devices_->act(workspace_, acting_);
}

// Something acts on the one free root from outside, or stores momentum beside the bodies.
bool Simulation::acted_on() const {
  const UserBody& root = model_->user[static_cast<std::size_t>(roots_.front())];
  const auto of_root = [&](int v) { return v >= root.v && v < root.v + root.nv; };
  if (world_rates_ || stores_) return true;
  for (int i = root.v; i < root.v + root.nv; ++i)
    if (tau_[static_cast<std::size_t>(i)] != 0.0) return true;
  if (std::ranges::any_of(model_->loads, of_root, &HingeLoad::v)) return true;
  return std::ranges::any_of(model_->devices.all, [&](const Device& d) {
    return std::ranges::any_of(d.mounts, [&](const DeviceMount& mount) { return mount.node < 0 && of_root(mount.v); });
  });
}

// v' of the dense twin in the place of that of the sweeps, which have just run at x: what acts, and what devices read, is as they found it.
bool Simulation::evaluate_twin(const double* x, double* vdot) {
  const Model& m = *model_;
  const double *q = x, *v = q + m.nq;
  tau_twin_ = tau_;
  if (devices_) devices_->add_hinge_forces(tau_twin_.data());
  TwinLoads<double> loads;
  loads.tau = tau_twin_.data(), loads.vdot = vdot_given_.data();
  loads.wrenches = wrenches_, loads.drives = twin_drives<double>(drives_), loads.moment = moment_;
  loads.z = v + m.nv, loads.marks = state_.marks.data();
  try {
    const auto state = twin_->at(Eigen::VectorXd::Map(q, m.nq), Eigen::VectorXd::Map(v, m.nv), loads);
    Eigen::VectorXd::Map(vdot, m.nv) = twin_->vdot(state, loads);
    qdot_twin_.assign(state.qdot.begin(), state.qdot.end());
  } catch (const NumericsError&) {  // no positive mass matrix here
    return false;
  }
  return !devices_ || devices_->follow(workspace_, inputs(q, v), vdot);
}

// Force and moment about the world's origin from outside, and power. The workspace is that of rhs() at x, or near to it.
void Simulation::integrands(double t, const double* x, double* ydot) {
  const Model& m = *model_;
  const double *q = with_given_motion(t, x), *v = q + m.nq;
  apply_forces(t, std::min(t, stretch_), q, v);
  if (devices_) devices_->add_hinge_forces(tau_total_.data());
  const Inputs in = inputs(q, v);
  // Forces of actuators on a free root are forces from outside.
  const auto driven = [&](int root) {
    const UserBody& u = m.user[static_cast<std::size_t>(root)];
    for (int j = u.v; j < u.v + u.nv; ++j)
      if (in.tau[j] != 0.0 || (m.has_prescribed() && m.prescribed[static_cast<std::size_t>(j)])) return true;
    return false;
  };
  ExternalLoads e;
  if (world_rates_ || std::ranges::any_of(roots_, driven))
    e = observer_->external(in, vdot_.data());
  else
    e.power = observer_->internal_power(in, vdot_.data());
  if (stores_) {
    const Force<double> f = devices_->storing_loads();
    e.force -= to_eigen(f.f), e.moment -= to_eigen(f.n);
  }
  if (own_) {
    const LeavingMass out = devices_->leaving(moment_);
    e.force += to_eigen(out.momentum.f), e.moment += to_eigen(out.momentum.n);
    e.power += out.power;
  }
  for (int i = 0; i < 3; ++i) ydot[i] = e.force[i], ydot[3 + i] = e.moment[i];
  ydot[6] = e.power + (devices_ ? devices_->unseen_power() : 0.0);
}

/// "field earth (acme/oblate): earth is asked beyond its limit inside: ..."; empty where nothing is wrong with it in the last evaluation.
std::string Simulation::told_of_gravity() const {
  for (std::size_t k = 1; gravity_field_ >= 0 && k < model_->bodies.size(); ++k) {
    const Field& field = model_->fields[static_cast<std::size_t>(gravity_field_)];
    const int beyond = gravity_beyond(static_cast<int>(k));
    const std::string told = beyond == -1 ? fmt::format("gravity of {} is not finite", told_name(field)) : told_beyond(field, beyond);
    if (!told.empty()) return fmt::format("field {} ({}): {}", field.name, field.source->family->type, told);
  }
  return {};
}

/// After a step: no motion goes on beyond what its fields know. Where they know no value beyond, smaller and smaller steps come nearer to
/// the limit for ever: after some that hardly went further it ends there.
void Simulation::expect_within_fields() {
  const FieldFault* tried = devices_ ? devices_->tried_limit() : nullptr;
  const bool near = !gravity_stopped_.empty() || tried;
  constexpr int kMost = 50;
  if (near) {
    if (state_.t - t_limited_ > 1e-6 * (t_end_ - state_.t)) limited_steps_ = 0;
    t_limited_ = state_.t;
    ++limited_steps_;
  }
  if (limited_steps_ > kMost && !gravity_stopped_.empty()) fail(explain({}));
  const FieldFault* passed = devices_ ? devices_->passed_limit() : nullptr;
  if (!passed && limited_steps_ > kMost) passed = tried;
  if (passed) fail(beyond_a_field(*passed));
  if (!near) return;
  gravity_stopped_.clear();
  if (devices_) devices_->forget_limit();
}

/// Fields that gave what they have at the end of what they know, at an accepted state.
void Simulation::say_held_fields() {
  for (std::size_t i = 0; i < model_->fields.size(); ++i) {
    const Field& field = model_->fields[i];
    if (field.source->held == 0) continue;
    int beyond = devices_ ? devices_->held_fields()[i] : 0;
    if (static_cast<int>(i) == gravity_field_)
      for (std::size_t k = 1; k < model_->bodies.size(); ++k) beyond |= gravity_beyond(static_cast<int>(k));
    if (beyond != 0)
      warn(Code::field_held, model_->spec->locate(fmt::format("fields.{}.outside", field.name)), held_text(field, beyond),
           "outside: refuse ends the run there");
  }
}

/// Bits of limits of the field of gravity, at the mass centre of a sweep body in the last evaluation; -1: it is not finite there.
int Simulation::gravity_beyond(int k) const {
  if (!workspace_.has_world() || model_->bodies[static_cast<std::size_t>(k)].kind == BodyKernel::rotor) return 0;
  const FieldSource& f = *model_->field.source;
  const SweepBody& b = model_->bodies[static_cast<std::size_t>(k)];
  const RigidInertia<double>& M = b.n_modes > 0 ? workspace_.modal_of(k)->M_rr : b.M;
  if (!(M.m > 0.0)) return 0;
  const Pose<double>& body = workspace_.pose_W(k);
  const Vec3<double> p = body.p + body.R * ((1.0 / M.m) * M.h);
  const double point[3] = {p.x, p.y, p.z};
  double value[CARDAN_FIELD_NUMBERS];
  const cardan_field_args args{sizeof args, moment_->t, f.packed.data(), moment_->prepared};
  const int beyond = f.family->evaluate(&args, 1, point, value, nullptr);
  return all_finite(value, 3) ? beyond | moment_->beyond : -1;
}

const Observer& Simulation::observe() {
  if (!observed_) {
    breakdown_ = {};
    bad_rate_ = -1;
    std::vector<double>& x = x_given_;
    pack(x.data());
    const auto look = [&] {
      if (!evaluate(state_.t, state_.t, x.data(), vdot_.data())) fail(explain({Code::not_finite, state_.t, "", "", "", "", ""}));
      observer_->update(inputs(state_.q.data(), state_.v.data()), vdot_.data());
      if (devices_ && !devices_->complete(workspace_, inputs(state_.q.data(), state_.v.data()))) fail(explain({}));
    };
    if (!unless_thrown(look)) fail(explain({}));
    say_held_fields();
    observed_ = true;
  }
  return *observer_;
}

const Eigen::VectorXd& Simulation::vdot() {
  observe();
  return vdot_;
}

void Simulation::begin_ledger() {
  const std::vector<double> absolute = absolute_tolerances();
  const Inputs creeping = inputs(state_.q.data(), absolute.data() + model_->nq);
  if (options_.ledger && forward_dynamics(*model_, workspace_, creeping, vdot_.data())) {
    observer_->update(creeping, nullptr);
    double energy = observer_->energy().kinetic;
    for (const HingeLoad& load : model_->loads)
      energy += 0.5 * std::max(0.0, hinge_laws::linear(load, state_.q[load.q], 0.0).stiffness) *
                std::pow(absolute[static_cast<std::size_t>(load.q)], 2);
    for (const SweepBody& b : model_->bodies)
      for (int j = 0; j < b.n_modes; ++j) {
        const FlexibleBody& f = model_->flexible[static_cast<std::size_t>(b.flexible)];
        const auto at = static_cast<std::size_t>(f.K_diagonal ? j : j * b.n_modes + j);
        energy += 0.5 * f.K[at] * std::pow(absolute[static_cast<std::size_t>(b.eta + j)], 2);
      }
    const Momentum p = observer_->momentum();
    balances_.set_least(p.linear_magnitude, p.angular_magnitude, energy);
  }
  observed_ = false;
  balances_.begin(momentum(), energy());
}

Energy Simulation::energy() {
  Energy e = observe().energy();
  if (devices_ && !unless_thrown([&] { e.devices = devices_->energy(), e.magnitude += std::abs(e.devices); })) fail(explain({}));
  return e;
}

Momentum Simulation::momentum() {
  Momentum p = observe().momentum();
  if (!stores_) return p;
  Eigen::Vector3d h;
  if (!unless_thrown([&] { h = to_eigen(devices_->stored_momentum()); })) fail(explain({}));
  p.angular += h, p.angular_magnitude += h.norm();
  return p;
}

LedgerState Simulation::ledger() {
  if (!options_.ledger || !begun_) return {};
  if (ledger_known_) return ledger_;
  ledger_known_ = true;
  Balances::Integrals y = Balances::Integrals::Zero(), off = y;
  if (integrator_) integrator_->integrals(state_.t, y.data(), off.data());
  ledger_ = balances_.look(momentum(), energy(), y, off, statistics(), options_.integrator.relative_tolerance);
  for (const auto& [name, sentence] : balances_.beyond(integrator_name()))
    warn(Code::ledger_residual, {fmt::format("ledger of {}", name), {}}, sentence,
         "a hinge or body of a plugin whose laws do not fit together, a state that was changed in the run, or a step too large "
         "(docs/mathematics/integration.md)");
  return ledger_;
}

void Simulation::write_outputs() {
  if (!recorder_ || last_output_ == state_.t) return;
  const Stopwatch watch(timed(&RunProfile::outputs));
  observe();
  if (plugins_) expect_good_plugins();
  std::size_t at = 0;
  for (const Output& o : outputs_) {
    o.fill(row_.data() + at);
    at += o.channel.components.size();
  }
  recorder_->row(state_.t, row_);
  last_output_ = state_.t;
}

namespace {
/// Its noise, and what it may change.
std::size_t numbers_of_tick(const Device& d) { return std::size_t{d.family->n_noise} + d.family->n_states + d.family->n_marks; }
}  // namespace

/// Puts devices with a sampled part on the schedule, who gives before who takes: sensors at once, others after the controllers.
void Simulation::sample_devices(bool late) {
  if (!devices_) return;
  if (late && std::exchange(actuators_tick_, true)) return;
  for (const int i : model_->devices.order) {
    const Device& d = model_->devices.all[static_cast<std::size_t>(i)];
    if (!d.family->tick || ticks_late(d) != late) continue;
    Rational offset;
    const Rational period = period_of(d, &offset);
    const double seconds = static_cast<double>(period.numerator) / static_cast<double>(period.denominator);
    noise_.resize(std::max(noise_.size(), numbers_of_tick(d)));
    const auto id = static_cast<std::size_t>(id_of(now_.device, i));
    every(
        period, [this, id, seconds] { shift_delays(now_.device[id]), tick_device(now_.device[id], seconds); }, offset);
  }
  if (!late) return;
  // After all ticks of an instant: what is taken later is what outputs are now.
  for (std::size_t i = 0; i < model_->devices.all.size(); ++i)
    if (std::ranges::any_of(model_->devices.delays, [&](const DelayLine& line) { return line.clock == static_cast<int>(i); })) {
      Rational offset;
      const Rational period = period_of(model_->devices.all[i], &offset);
      every(
          period, [this, i] { sample_delays(static_cast<int>(i)); }, offset);
    }
}

Rational Simulation::period_of(const Device& d, Rational* offset) const {
  const DeviceSpec& spec = model_->spec->devices[static_cast<std::size_t>(d.spec)];
  const std::string path = "devices." + d.name;
  if (offset && spec.offset != 0.0) {
    const auto at = model_->spec->locate(path + ".offset");
    const auto exact = to_rational(spec.offset);
    if (!(spec.offset > 0.0) || !exact || exact->numerator > Rational::kLargest)
      refuse(Code::out_of_range, at, "a time >= 0 that is a ratio of whole numbers", fmt::format("{:g} s", spec.offset));
    *offset = *exact;
  }
  return spec.rate > 0.0 ? period_from_hertz(spec.rate, model_->spec->locate(path + ".rate"))
                         : period_from_seconds(spec.period, model_->spec->locate(path + ".period"));
}

/// A latency in ticks; the memory of all lines.
void Simulation::resolve_delays() {
  lines_.clear(), delayed_.clear();
  for (const DelayLine& line : model_->devices.delays) {
    const Device& clock = model_->devices.all[static_cast<std::size_t>(line.clock)];
    int ticks = line.ticks;
    if (ticks == 0) {
      const Rational period = period_of(clock, nullptr);
      const double tick = static_cast<double>(period.numerator) / static_cast<double>(period.denominator);
      const auto latency = to_rational(line.latency);
      // latency / period = (a d) / (b n), whole
      const std::int64_t above = latency ? latency->numerator * period.denominator : 1,
                         below = latency ? latency->denominator * period.numerator : 0;
      if (below == 0 || above % below != 0 || above / below > kMostTicks) {
        const double nearest = std::max(1.0, std::round(line.latency / tick));
        refuse(Code::bad_connection, model_->spec->locate(told_input(line.input) + ".latency"),
               fmt::format("a whole number of ticks of {}, {:g} s each, at most {}", clock.name, tick, kMostTicks),
               fmt::format("{:g} s", line.latency), fmt::format("{:g} s, or another rate of {}", nearest * tick, clock.name));
      }
      ticks = static_cast<int>(above / below);
    }
    lines_.push_back({ticks, static_cast<int>(delayed_.size())});
    delayed_.insert(delayed_.end(), static_cast<std::size_t>(ticks), line.fallback);
  }
}

/// "devices.wheel.inputs.torque".
std::string Simulation::told_input(int input) const {
  for (const Device& d : model_->devices.all)
    if (input >= d.in && input < d.in + d.n_in)
      return fmt::format("devices.{}.inputs.{}", d.name, port_at(*d.family, CARDAN_PORT_IN, input - d.in).name);
  return "devices";
}

/// At a tick of its clock a line gives its oldest number, until the next.
void Simulation::shift_delays(int clock) {
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const DelayLine& line = model_->devices.delays[i];
    if (line.clock != clock) continue;
    double* first = delayed_.data() + lines_[i].first;
    set_device_input(line.input, *first);
    std::copy(first + 1, first + lines_[i].ticks, first);
  }
}
void Simulation::sample_delays(int clock) {
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const DelayLine& line = model_->devices.delays[i];
    if (line.clock != clock) continue;
    observe();
    double sum = 0.0;
    for (const int out : line.outs) sum += devices_->output(out);
    delayed_[static_cast<std::size_t>(lines_[i].first + lines_[i].ticks - 1)] = sum;
  }
}

namespace {
/// [s] when a command that was set at t is too old: later than a tick that comes after just `timeout`, whatever rounding did to both.
double due(double t, double timeout) { return (t + timeout) * (1.0 + 4.0 * std::numeric_limits<double>::epsilon()); }
}  // namespace

/// After the ticks of an instant.
void Simulation::expire_commands() {
  for (std::size_t k = 0; k < last_set_.size(); ++k) {
    const CommandTimeout& timeout = model_->devices.timeouts[k];
    if (state_.t < due(last_set_[k], timeout.timeout)) continue;
    set_device_input(timeout.input, timeout.safe);
    last_set_[k] = std::numeric_limits<double>::infinity();
    if (recorder_) recorder_->note(Note::event, state_.t, {told_input(timeout.input), "timeout"});
  }
}

void Simulation::tick_device(int index, double period) {
  const Device& d = model_->devices.all[static_cast<std::size_t>(index)];
  const Observer& o = observe();
  for (std::size_t i = 0; i < d.mounts.size(); ++i) {
    cardan_mount_motion& to = devices_->motion_of_tick(d.mount + static_cast<int>(i));
    if (d.mounts[i].v >= 0) to.vdot = vdot_[static_cast<std::size_t>(d.mounts[i].v)];
    if (d.mounts[i].node < 0 || (d.mounts[i].use & CARDAN_USE_ACCELERATION) == 0) continue;
    const NodeState n = o.node(d.mounts[i].node);
    Eigen::Vector3d::Map(to.alpha) = n.acceleration.head<3>();
    Eigen::Vector3d::Map(to.specific_force) = n.specific_force;
  }
  if (noise_.size() < numbers_of_tick(d)) noise_.resize(numbers_of_tick(d));  // of a model that was adopted
  normal_noise(noise_key(options_.seed, d.name), static_cast<std::uint64_t>(tick_), d.family->n_noise, noise_.data());
  // Behind the noise: what it may change, as it was.
  double *const z = state_.z.data() + d.z, *const marks = state_.marks.data() + d.mark;
  double *const z_before = noise_.data() + d.family->n_noise, *const marks_before = std::copy_n(z, d.family->n_states, z_before);
  std::copy_n(marks, d.family->n_marks, marks_before);
  if (d.family->impulse) ask_for_impulse(index, CARDAN_CAUSE_TICK, 0);
  bool good = false;
  if (!unless_thrown([&] { good = devices_->tick(index, period, noise_.data(), state_.z.data(), state_.marks.data()); }) || !good)
    fail(explain({}));
  strike();
  const bool same_states = std::equal(z, z + d.family->n_states, z_before);
  if (same_states && std::equal(marks, marks + d.family->n_marks, marks_before)) return;
  if (d.acts || !same_states) return changed();
  devices_->set({state_.t, state_.z.data(), state_.marks.data(), tau_total_.data(), wrenches_.data()});
  if (!unless_thrown([&] { good = devices_->evaluate(); }) || !good) fail(explain({}));  // what it gives now; the motion is as it was
}

void Simulation::device_event(int device, std::uint32_t root, int direction) {
  if (!unless_thrown([&] { devices_->event(device, root, direction, state_.z.data(), state_.marks.data()); })) fail(explain({}));
}

/// At a trial state.
void Simulation::device_roots(double t, const double* x, double* g) {
  const Model& m = *model_;
  const double *q = with_given_motion(t, x), *v = q + m.nq;
  on_trial_->set({t, v + m.nv, state_.marks.data(), nullptr, nullptr});
  on_trial_->look_at(*devices_, beside_.get(), inputs(q, v));
  on_trial_->roots(g);
}

/// `but`: devices that have started before.
void Simulation::start_devices(std::span<const int> but) {
  if (!devices_) return;
  observe();
  for (std::size_t i = 0; i < model_->devices.all.size(); ++i)
    if (std::ranges::find(but, static_cast<int>(i)) == but.end())
      device_event(static_cast<int>(i), model_->devices.all[i].family->n_roots, 0);
  changed();
  rates_were_set_ = false;
  settle_holds();
}

Inputs Simulation::hold_inputs(double t, const double* x) {
  const double *q = x, *v = q + model_->nq;
  hold_tau_ = tau_;
  hinge_laws::add_forces(*model_, q, v, hold_tau_.data());
  hold_vdot_ = vdot_given_;
  for (const Prescribed& p : prescribed_) hold_vdot_[static_cast<std::size_t>(p.index)] = p.profile.acceleration(t, std::min(t, stretch_));
  drive_loops(t, std::min(t, stretch_), hold_drives_);
  return {.q = q, .v = v, .tau = hold_tau_.data(), .vdot = hold_vdot_.data(), .wrenches = wrenches_, .drives = hold_drives_.data()};
}

bool Simulation::look_at_holds(double t, const double* x) {
  return holding_->look(*devices_, hold_inputs(t, x), t, x + model_->nq + model_->nv, state_.marks.data());
}

namespace {
/// What holds gives way at a root that lies a little beyond the most that settle_holds() leaves alone: on which side of it a state begins
/// is never a matter of rounding.
constexpr double kLoose = 1.0 + 1e-12, kRoot = 1.0 + 1e-10;
}  // namespace

bool Simulation::anything_is_held() const {
  return std::ranges::any_of(model_->devices.holds,
                             [&](const DeviceHold& h) { return model_->prescribed[static_cast<std::size_t>(h.v)] != 0; });
}

/// At a trial state: what is left until each held component breaks away; 1 of others, and where v' cannot be evaluated.
void Simulation::hold_roots(double t, const double* x, double* g) {
  const auto& holds = model_->devices.holds;
  std::fill_n(g, holds.size(), 1.0);
  if (!anything_is_held()) return;
  const bool good = look_at_holds(t, with_given_motion(t, x));
  devices_->weigh_again();
  for (std::size_t i = 0; good && i < holds.size(); ++i)
    if (const Holding::Force& f = holding_->forces()[i]; f.held) g[i] = f.leaves != 0 ? -1.0 : kRoot * f.most - std::abs(f.force);
}

void Simulation::break_away(std::size_t hold, int direction) {
  const int device = model_->devices.holds[hold].device;
  const std::uint32_t n = model_->devices.all[static_cast<std::size_t>(device)].family->n_roots;
  device_event(device, n + 1, direction);
  changed();
}

namespace {
bool gives_way(const Holding::Force& f) { return f.leaves != 0 || std::abs(f.force) > kLoose * f.most; }
/// It begins to move against what was found to hold it.
int way_of(const Holding::Force& f) { return f.leaves != 0 ? f.leaves : f.force > 0.0 ? -1 : 1; }
}  // namespace

void Simulation::stop_what_is_held() {
  for (const DeviceHold& h : model_->devices.holds)
    if (model_->prescribed[static_cast<std::size_t>(h.v)] != 0 && state_.v[h.v] != 0.0) state_.v[h.v] = 0.0, changed();
}

/// What closed loops do not let move while something else is held stands still, and holds as well.
bool Simulation::hold_what_is_blocked(const std::vector<std::uint8_t>& gave_way) {
  bool any = false;
  for (std::size_t i = 0; i < gave_way.size(); ++i) {
    const DeviceHold& h = model_->devices.holds[i];
    if (gave_way[i] != 0 || model_->prescribed[static_cast<std::size_t>(h.v)] != 0 ||
        !holding_->is_blocked(i, state_.q.data(), hold_drives_.data()))
      continue;
    state_.v[h.v] = 0.0;
    changed();
    observe();
    device_event(h.device, model_->devices.all[static_cast<std::size_t>(h.device)].family->n_roots, 0);
    changed();
    any = any || model_->prescribed[static_cast<std::size_t>(h.v)] != 0;
  }
  return any;
}

/// What is held stands still; what more would be needed for than can be breaks away, one after the other. Where rates were set from
/// outside, devices that hold begin with them as at the start.
void Simulation::settle_holds() {
  const auto& holds = model_->devices.holds;
  if (std::exchange(rates_were_set_, false) && begun_ && !holds.empty()) {
    observe();
    for (const DeviceHold& h : holds) device_event(h.device, model_->devices.all[static_cast<std::size_t>(h.device)].family->n_roots, 0);
    changed();
  }
  std::vector<std::uint8_t> gave_way(loops_ ? holds.size() : 0);
  for (std::size_t pass = 0; holding_ && pass <= 2 * holds.size(); ++pass) {
    if (!anything_is_held()) return;
    if (!loops_) stop_what_is_held();  // with loops once it is known to hold: others may move on
    hold_x_.resize(x_given_.size());
    pack(hold_x_.data());
    if (!look_at_holds(state_.t, hold_x_.data())) return;  // told where the dynamics come upon it
    const auto& forces = holding_->forces();
    const auto loose = std::ranges::find_if(forces, gives_way);
    if (loose != forces.end()) {
      const auto i = static_cast<std::size_t>(loose - forces.begin());
      break_away(i, way_of(*loose));
      if (loops_) gave_way[i] = 1;
    } else {
      stop_what_is_held();
      if (!loops_ || !hold_what_is_blocked(gave_way)) return;
    }
  }
}

/// What devices do where one of their roots crossed zero; true if any did.
bool Simulation::device_events(std::span<const int> crossed) {
  bool any = false;
  for (std::size_t i = 0; devices_ && i < model_->devices.all.size(); ++i) {
    const Device& d = model_->devices.all[i];
    for (std::uint32_t root = 0; root < d.family->n_roots; ++root) {
      const int side = crossed[static_cast<std::size_t>(d.root) + root];
      if (side == 0) continue;
      observe();
      if (d.family->impulse) ask_for_impulse(static_cast<int>(i), root, side);
      device_event(static_cast<int>(i), root, side);
      any = true;
      changed();
      strike();
    }
  }
  for (std::size_t i = 0; holding_ && i < model_->devices.holds.size(); ++i) {
    if (crossed[static_cast<std::size_t>(model_->devices.n_roots) + i] >= 0) continue;
    hold_x_.resize(x_given_.size());
    pack(hold_x_.data());
    if (look_at_holds(state_.t, hold_x_.data()) && holding_->forces()[i].held) break_away(i, way_of(holding_->forces()[i]));
    any = true;
  }
  if (any) settle_holds();
  return any;
}

double Simulation::next_corner() const {
  double t = std::numeric_limits<double>::infinity();
  for (const auto& p : prescribed_) t = std::min(t, p.profile.next_corner(state_.t));
  for (const auto& p : prescribed_loops_) t = std::min(t, p.profile.next_corner(state_.t));
  for (std::size_t k = 0; k < last_set_.size(); ++k) t = std::min(t, due(last_set_[k], model_->devices.timeouts[k].timeout));
  return t;
}

IntegratorStatistics Simulation::statistics() const {
  IntegratorStatistics all = of_former_models_;
  if (integrator_) all.add(integrator_->statistics());
  return all;
}

std::string Simulation::integrator_name() const { return integrator_ ? std::string(integrator_->name()) : options_.integrator.method; }

/// Called where an exception is caught: of a fault of ours it goes on.
void Simulation::keep_thrown(const std::string& what) {
  if (!plugins_) throw;
  if (!thrown_.empty()) return;
  for (const DeviceForces* d : {devices_.get(), on_trial_.get()}) {
    if (!d) continue;
    if (d->called().device >= 0)
      thrown_ = fmt::format("{}: {} throws: {}", told_device(model_->devices.all[static_cast<std::size_t>(d->called().device)]),
                            d->called().function, what);
    else if (d->field_asked() >= 0)
      thrown_ = fmt::format("field {}: evaluate throws: {}", told_name(model_->fields[static_cast<std::size_t>(d->field_asked())]), what);
    if (!thrown_.empty()) return;
  }
  thrown_ = plugin_at_fault(*model_, state_.q.data(), state_.v.data());
  if (thrown_.empty() && gravity_field_ >= 0 && is_of_plugin(model_->fields[static_cast<std::size_t>(gravity_field_)].origin))
    thrown_ = fmt::format("field {}: evaluate throws: {}", told_name(model_->fields[static_cast<std::size_t>(gravity_field_)]), what);
  if (thrown_.empty()) thrown_ = fmt::format("a function of a plugin throws, and not when it is asked again: {}", what);
}

/// Where a row is written: what laws have tried at random holds here too.
void Simulation::expect_good_plugins() {
  std::string told;
  const bool whole = unless_thrown([&] {
    told = plugin_at_fault(*model_, state_.q.data(), state_.v.data());
    if (told.empty() && devices_) told = plugin_at_fault(*model_, *devices_);
    if (told.empty() && gravity_field_ >= 0 && workspace_.has_world()) {
      const Vec3<double> at = workspace_.pose_W(1).p;
      const double point[3] = {at.x, at.y, at.z};
      told = plugin_at_fault(model_->fields[static_cast<std::size_t>(gravity_field_)], *moment_, 1, point);
    }
  });
  if (whole && told.empty()) return;
  if (whole) thrown_ = told;
  fail(explain({}));
}

void Simulation::fail(RunFailure failure) {
  if (recorder_) {
    std::vector<double> x(static_cast<std::size_t>(model_->nq + model_->nv + model_->devices.n_z));
    pack(x.data());
    keep_steps();
    recorder_->restart_state(state_.t, x);
    recorder_->flush();
  }
  throw NumericsError(std::move(failure));
}

}  // namespace cardan
