#include "core/sim/simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/hinge_laws.hpp"
#include "core/sim/choose_method.hpp"
#include "core/sim/diagonalised_form.hpp"
#include "core/sim/near_singular.hpp"
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

const std::shared_ptr<const Model>& require_model(const std::shared_ptr<const Model>& model) {
  if (!model) refuse(Code::empty_system, {"simulation"}, "a compiled model", "none");
  return model;
}

}  // namespace

Simulation::Simulation(std::shared_ptr<const Model> model, const SimulationOptions& options)
    : own_(require_model(model)->changes() ? std::make_shared<Model>(*model) : nullptr),
      model_(own_ ? std::shared_ptr<const Model>(own_) : std::move(model)),
      now_(identity(*model_)),
      options_(options),
      state_(model_->initial_state()),
      workspace_(*model_) {
  soa::instruction_set();  // refused before the run where the wished ones cannot run here
  tau_.assign(static_cast<std::size_t>(model_->nv), 0.0);
  build();
  sample_devices(false);
  let_inside();
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
  for (std::size_t i = 0; i < m.loads.size(); ++i)
    for (const std::size_t side : {0, 1})
      if (const HingeLoad& load = m.loads[i]; load.law == HingeLaw::stop && std::isfinite(load.p[side]))
        limits_.push_back({load.q, load.v, side == 0 ? -1 : 1, load.p[side], load.bounce, i});
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
  loads_at_.resize(m.loads.size());
  observer_->loads_at(loads_at_.data());
  fields_.reset();
  moment_ = nullptr;
  if ((gravity_field_ = field_of_gravity(m)) >= 0) {
    fields_ = std::make_unique<FieldMoments>(m);
    moment_ = &fields_->at(gravity_field_, state_.t);
  }
  loops_.reset();
  if (!m.loops.empty()) loops_ = std::make_unique<LoopProjection>(m), told_left_open_ = false, world_rates_ = true;
  devices_.reset(), on_trial_.reset(), beside_.reset(), holding_.reset();
  stores_ = false;
  wrenches_.assign(static_cast<std::size_t>(m.devices.n_loads), {});
  if (m.devices.all.empty()) return;
  devices_ = std::make_unique<DeviceForces>(m, own_.get());
  for (const Device& d : m.devices.all)
    for (const DeviceMount& mount : d.mounts)
      if (mount.node >= 0 && (mount.use & CARDAN_USE_LOAD) != 0) wrenches_[static_cast<std::size_t>(mount.load)].node = mount.node;
  stores_ = std::ranges::any_of(m.devices.all, [](const Device& d) { return d.family->momentum != nullptr; });
  delays_ = DelayLines(m);
  ages_ = CommandAges(m.devices);
  if (!m.devices.holds.empty()) holding_ = std::make_unique<Holding>(m, own_.get());
  if (m.devices.n_roots == 0 && m.devices.n_edges == 0) return;
  on_trial_ = std::make_unique<DeviceForces>(m);
  if (m.devices.reads_nodes) {
    beside_ = std::make_unique<Workspace>(m);
    beside_->require_world();
  }
}

Simulation::~Simulation() = default;

void Simulation::refuse_index(const char* what, int i, Eigen::Index n) {
  refuse(Code::out_of_range, {what}, fmt::format("an index below {}", n), fmt::format("{}", i));
}

void Simulation::set_state(const State& state) {
  if (state.q.size() != model_->nq || state.v.size() != model_->nv)
    refuse(Code::bad_initial_state, {"state"}, fmt::format("{} coordinates and {} velocities", model_->nq, model_->nv),
           fmt::format("{} and {}", state.q.size(), state.v.size()));
  state_ = state;
  if (state_.z.size() != model_->devices.n_z) state_.z = Eigen::VectorXd::Map(model_->devices.z0.data(), model_->devices.n_z);
  if (state_.marks.size() != model_->devices.n_marks)
    state_.marks = Eigen::VectorXd::Map(model_->devices.marks0.data(), model_->devices.n_marks);
  holds_.begin_anew = true;
  changed();
}

/// The masses of the present state; a fault of a device is told where the dynamics come upon it.
void Simulation::weigh() {
  int device = -1;
  if (own_) own_->weigh(state_.z.data(), state_.marks.data(), device);
}

void Simulation::keep_steps() {
  if (!integrator_) return;
  const StepInterval* interval = history_.close(state_.t, statistics(), recorder_ != nullptr);
  if (interval && recorder_) note(*recorder_, *interval);
}

void Simulation::take_over(const Simulation& other) {
  set_state(other.state_);
  tau_ = other.tau_;
  tau_total_ = other.tau_;
  prescribed_ = other.prescribed_;
  if (prescribed_loops_.size() == other.prescribed_loops_.size())  // not of loops that were open there
    prescribed_loops_ = other.prescribed_loops_, drives_ = other.drives_;
  if (devices_ && other.devices_) devices_->take_commands(*other.devices_), faults_ = other.faults_;
  delays_.take_over(other.delays_);
  for (std::size_t i = 0; i < std::min(wrenches_.size(), other.wrenches_.size()); ++i) wrenches_[i].f = other.wrenches_[i].f;
}

/// What ticks and crosses zero is counted, and kept in checkpoints, from the start on.
void Simulation::expect_before_run(const char* what) const {
  if (begun_)
    refuse(Code::unsupported, {what}, "before the run begins", "after it has begun",
           "let it be there from the start, and look whether it has anything to do");
}

void Simulation::every(Rational period, std::function<void()> task, Rational offset) {
  expect_before_run("a task that is added");
  add_task(period, offset, std::move(task), false);
}

void Simulation::watch(Rational period, std::function<void()> task, Rational offset) {
  expect_before_run("a task that is added");
  add_task(period, offset, std::move(task), true);
}

void Simulation::add_task(Rational period, Rational offset, std::function<void()> work, bool looks, int device) {
  schedule_.add(period, offset);
  tasks_.push_back({std::move(work), looks, device});
}

/// Which tasks may lie inside of steps. Of `extended` each look there would be a step of its own.
void Simulation::let_inside() {
  const bool inside = options_.between_steps && options_.integrator.method != "extended";
  for (std::size_t i = 0; i < tasks_.size(); ++i) {
    Task& task = tasks_[i];
    if (task.device >= 0) task.looks = only_looks(now_.device[static_cast<std::size_t>(task.device)]);
    schedule_.let_inside(static_cast<int>(i), inside && task.looks);
  }
}

void Simulation::refuse_inside() {
  refuse(Code::unsupported, {"a task inside of a step"}, "one that only looks", "one that changes a state or a command",
         "every() in place of watch(): a step ends where it ticks");
}

void Simulation::add_event(Event event) {
  if (!event.function) refuse(Code::missing_key, {"event " + event.name}, "the function whose zeros it is at", "none");
  expect_before_run("an event that is added");
  events_.push_back(std::move(event));
  headway_.watch_events();
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

int Simulation::add_wrench(int node, bool world_axes) {
  if (!model_->has(OpCode::node_wrenches) || (world_axes && !model_->has(OpCode::world)))
    throw std::logic_error("add_wrench: compile the model with CompileOptions::node_wrenches, in world axes also world_wrenches");
  if (node < 0 || node >= static_cast<int>(model_->nodes.size()))
    refuse(Code::unknown_node, {"wrench"}, fmt::format("an index below {}", model_->nodes.size()), fmt::format("{}", node));
  NodeWrench w;
  w.node = node;
  w.world_axes = world_axes;
  wrenches_.push_back(w);
  world_rates_ = true;
  return static_cast<int>(wrenches_.size()) - model_->devices.n_loads - 1;
}

void Simulation::record(Recorder& recorder, std::vector<Output> outputs, Rational period) {
  expect_before_run("a recorder");
  sample_devices(true);
  recorder_ = &recorder;
  for (const Warning& w : warnings_.all()) note(recorder, w);
  outputs_ = std::move(outputs);
  std::size_t n = 0;
  for (const Output& o : outputs_) n += o.channel.components.size();
  row_.assign(n, 0.0);
  watch(period, [this] { write_outputs(); });
}

void Simulation::set_force(int i, double value) {
  require_index("velocity component", i, model_->nv);
  if (tau_[static_cast<std::size_t>(i)] == value) return;
  tau_[static_cast<std::size_t>(i)] = tau_total_[static_cast<std::size_t>(i)] = value;
  changed();
}

void Simulation::set_wrench(int slot, const Force<double>& f) {
  require_index("slot of a wrench", slot, static_cast<Eigen::Index>(wrenches_.size()) - model_->devices.n_loads);
  wrenches_[static_cast<std::size_t>(model_->devices.n_loads + slot)].f = f;
  changed();
}

void Simulation::set_device_input(int i, double value) {
  double& command = devices_->commands[static_cast<std::size_t>(i)];
  ages_.set(model_->devices, i, state_.t);
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

void Simulation::drive_forces(double* tau) {
  observe().prescribed_forces(tau);
  for (int i = 0; i < model_->nv; ++i)
    if (model_->has_given_motion(i)) tau[i] -= tau_total_[static_cast<std::size_t>(i)];
}

Balances::Integrals Simulation::gained(const Sums& before, const Sums& now) {
  Balances::Integrals out;
  out << now.momentum.linear - before.momentum.linear, now.momentum.angular - before.momentum.angular,
      now.energy.total() - before.energy.total();
  return out;
}

double Simulation::scale_of_rates() const {
  return std::max(1.0, state_.v.size() == 0 ? 0.0 : state_.v.cwiseAbs().maxCoeff<Eigen::PropagateNaN>());
}

void Simulation::pack(double* x) const {
  x = std::copy_n(state_.q.data(), model_->nq, x);
  x = std::copy_n(state_.v.data(), model_->nv, x);
  std::copy_n(state_.z.data(), model_->devices.n_z, x);
}

/// [q; v; z] of the present state.
const double* Simulation::packed() {
  x_now_.resize(x_given_.size());
  pack(x_now_.data());
  return x_now_.data();
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
                                    obstacle_.breakdown = breakdown;
                                    obstacle_.culprit = plugin_at_fault(*model_, q, state_.v.data());
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
  ode.looked_inside = schedule_.any_inside();
  ode.n = m.nq + m.nv + m.devices.n_z;
  ode.n_quadrature = options_.ledger ? Balances::kIntegrals : 0;
  ode.rough_integrands =
      m.devices.rough || std::ranges::any_of(m.loads, [](const HingeLoad& load) { return load.law != HingeLaw::spring; });
  ode.rhs = [this](double t, const double* x, double* xdot) { return rhs(t, x, xdot); };
  ode.integrands = [this](double t, const double* x, double* ydot) {
    if (!unless_thrown([&] { integrands(t, x, ydot); }, x)) std::fill_n(ydot, Balances::kIntegrals, 0.0);
  };
  if (normalised_ || !prescribed_.empty() || loops_) ode.project = [this](double t, double* x) { project(t, x); };
  ode.absolute_tolerance = absolute_tolerances();
  ode.group.assign(static_cast<std::size_t>(ode.n), 0);
  for (const SweepBody& b : m.bodies) {
    std::fill_n(ode.group.begin() + b.eta, b.n_modes, 1);
    std::fill_n(ode.group.begin() + m.nq + b.etadot, b.n_modes, 1);
  }
  std::fill_n(ode.group.begin() + m.nq + m.nv, m.devices.n_z, 2);
  ode.n_roots = n_roots(), ode.n_corners = m.devices.n_edges;
  if (ode.n_roots > 0) ode.roots = [this](double t, const double* x, double* g) { roots(t, x, g); };
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
                             return rhs(t, x, xdot.data()) && unless_thrown([&] { integrands(t, x, y); }, x);
                           }});
  momentum_.reset();
  if (advances_linear_part(options_.integrator.method)) {
    ode.linear = [this](const std::string& method) { return std::make_shared<VehicleLinearPart>(model_, method, devices_.get()); };
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
    return unless_thrown([&] { good = jacobian_times(t, x, dx, J_dx); }, x) && good;
  };
  ode.prepare = [this](double, const double* x, double gamma, bool moved) { return newton_->prepare(x, gamma, moved); };
  ode.precondition = [this](const double* r, double* z) {
    newton_->precondition(r, z);
    return true;
  };
  return ode;
}

// An accepted state onto unit quaternions, given motions and closed loops. NaN: the loops cannot be closed from there; a smaller step, or
// the end.
void Simulation::project(double t, double* x) {
  if (normalised_) unless_thrown([&] { model_->normalise(x); });
  give_motion(t, x, x + model_->nq);
  if (loops_ && !close_loops(t, x, x + model_->nq)) x[0] = std::numeric_limits<double>::quiet_NaN();
  if (momentum_ && !acted_on()) momentum_->keep(x, x + model_->nq, within_.looks);
}

int Simulation::n_roots() const {
  const Devices& d = model_->devices;
  return static_cast<int>(events_.size() + limits_.size() + d.holds.size()) + d.n_roots + d.n_edges;
}

// Of events, stops, devices, what they hold and fields that they read: functions whose sign changes are located.
void Simulation::roots(double t, const double* x, double* g) {
  for (std::size_t i = 0; i < events_.size(); ++i) g[i] = events_[i].function(t, x, x + model_->nq);
  for (std::size_t i = 0; i < limits_.size(); ++i) g[events_.size() + i] = x[limits_[i].q] - limits_[i].value;
  double* of_devices = g + events_.size() + limits_.size();
  const bool known = unless_thrown([&] {
    if (on_trial_) device_roots(t, x, of_devices);
    if (holding_) hold_roots(t, x, of_devices + model_->devices.n_roots);
  });
  if (!known) std::fill_n(of_devices, static_cast<std::size_t>(n_roots()) - events_.size() - limits_.size(), 1.0);
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

const Observer& Simulation::observe() {
  if (!observed_) {
    obstacle_.forget();
    std::vector<double>& x = x_given_;
    pack(x.data());
    const auto look = [&] {
      if (!evaluate(state_.t, state_.t, x.data(), vdot_.data())) fail(explain({Code::not_finite, state_.t, "", "", "", "", ""}));
      if (!prescribed_.empty() && !told_of_gravity().empty()) fail(explain({}));  // no rate hangs on what pulls on a given motion
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

void Simulation::weigh_tolerances() {
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
    // Place times momentum: of what moves to the world's origin the product is rounding.
    balances_.allow_least(p.linear_magnitude, p.angular_parts, energy);
  }
  observed_ = false;
}

void Simulation::begin_ledger() {
  weigh_tolerances();
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
  if (integrator_) integrator_->integrals(within_.looks ? within_.t : state_.t, y.data(), off.data());
  const Momentum p = momentum();
  const Energy e = energy();
  if (loops_) off += off_near_singular(loops_->pivot(), options_.integrator.relative_tolerance, p, e);
  const double typed = model_->loops.left_open ? model_->loops.dependent : 0.0;  // rows that are left open, and accelerations by them
  ledger_ = balances_.look(p, e, y, off, statistics(), std::max(options_.integrator.relative_tolerance, typed), within_.looks);
  if (within_.looks) {  // it is judged where the step ends
    within_.ledger = true;
    return ledger_;
  }
  for (const auto& [name, sentence] : balances_.beyond(integrator_name()))
    warn(Code::ledger_residual, {fmt::format("ledger of {}", name), {}}, sentence, why_open());
  return ledger_;
}

/// What may have opened a balance, of what this run has.
std::string Simulation::why_open() const {
  if (nearest_.pivot < kInBalances)
    return fmt::format(
        "closed loops came near a singular posture (a scaled pivot of {:.2g} at t = {:.6g} s), where reactions and the direction of "
        "motion are known less well, or a step too large: let no output, tick or event fall there (docs/mathematics/loops.md, 7)",
        nearest_.pivot, nearest_.t);
  return fmt::format("{}a state that was changed in the run, or a step too large (docs/mathematics/integration.md)",
                     plugins_ ? "a hinge or body of a plugin whose laws do not fit together, " : "");
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

IntegratorStatistics Simulation::statistics() const {
  IntegratorStatistics all = of_former_models_;
  if (integrator_) all.add(integrator_->statistics());
  return all;
}

std::string Simulation::integrator_name() const { return integrator_ ? std::string(integrator_->name()) : options_.integrator.method; }

}  // namespace cardan
