#include "core/sim/simulation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "core/base/finite.hpp"
#include "core/sim/newton_operators.hpp"

namespace cardan {

Simulation::Simulation(std::shared_ptr<const Model> model, const SimulationOptions& options)
    : model_(std::move(model)), options_(options), state_(model_->initial_state()), workspace_(*model_) {
  const Model& m = *model_;
  soa::kernels();  // refused before the run where the wished ones cannot run here
  const auto nv = static_cast<std::size_t>(m.nv);
  tau_.assign(nv, 0.0);
  tau_total_.assign(nv, 0.0);
  vdot_given_.assign(nv, 0.0);
  vdot_ = Eigen::VectorXd::Zero(m.nv);
  scratch_q_.assign(static_cast<std::size_t>(m.nq), 0.0);
  for (std::size_t i = 0; i < m.user.size(); ++i)
    if (m.user[i].nq > 0 && m.user[i].hinge->normalise) normalised_.push_back(static_cast<int>(i));
  for (int i = 0; m.has_prescribed() && i < m.nv; ++i)
    if (m.prescribed[static_cast<std::size_t>(i)]) prescribed_.push_back({i, MotionProfile::hold(state_.v[i])});
  // Impulse from outside is zero, and its rates need no world poses, when nothing touches the system but its own hinges.
  world_rates_ = m.gravity.kind != GravitySpec::Kind::none;
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    if (m.user[i].parent >= 0) continue;
    roots_.push_back(static_cast<int>(i));
    if (m.user[i].nv < 6) world_rates_ = true;
  }
  observer_ = std::make_unique<Observer>(m, workspace_);
}

Simulation::~Simulation() = default;

void Simulation::set_state(const State& state) {
  state_ = state;
  changed();
}

/// `state`: index into [q, v].
RunFailure Simulation::not_finite(int state, double value) const {
  const Model& m = *model_;
  RunFailure f{Code::not_finite, state_.t, "", "", "", "too large a step, or a command that grows without limit?", ""};
  for (const UserBody& u : m.user) {
    const bool is_q = state < m.nq;
    const auto& names = is_q ? u.q_names : u.v_names;
    const int i = is_q ? state - u.q : state - m.nq - u.v, n = static_cast<int>(names.size());
    if (i < 0 || i >= n + u.n_modes) continue;
    f.body = u.name;
    f.what = i < n ? names[static_cast<std::size_t>(i)] : fmt::format("mode {}", i - n + 1);
  }
  f.what += std::isnan(value) ? " = nan" : value > 0 ? " = inf" : " = -inf";
  return f;
}

void Simulation::expect_finite(const std::vector<double>& x) {
  const int n = static_cast<int>(x.size());
  if (all_finite(x.data(), n)) return;
  const int bad = first_not_finite(x.data(), n);
  fail(not_finite(bad, x[static_cast<std::size_t>(bad)]));
}

/// What the sweeps know about a step that the integrator gave up.
RunFailure Simulation::explain(const RunFailure& failure) const {
  if (breakdown_.body != 0) {
    RunFailure f = describe_breakdown(*model_, breakdown_, state_.t);
    if (!std::isfinite(breakdown_.value)) f.code = Code::not_finite;
    return f;
  }
  return bad_rate_ < 0 ? failure : not_finite(model_->nq + bad_rate_, vdot_bad_);
}

void Simulation::warn(Code code, Located at, std::string about, std::string hint) {
  const std::size_t before = warnings_.all().size();
  warnings_.add(code, std::move(at), std::move(about), std::move(hint), state_.t);
  if (told_ && warnings_.all().size() > before) told_(warnings_.all().back());
}

void Simulation::take_over(const Simulation& other) {
  set_state(other.state_);
  tau_ = other.tau_;
  tau_total_ = other.tau_;
  prescribed_ = other.prescribed_;
  for (std::size_t i = 0; i < std::min(wrenches_.size(), other.wrenches_.size()); ++i) wrenches_[i].f = other.wrenches_[i].f;
}

void Simulation::every(Rational period, std::function<void()> task, Rational offset) {
  schedule_.add(period, offset);
  tasks_.push_back(std::move(task));
}

void Simulation::add_event(Event event) { events_.push_back(std::move(event)); }

void Simulation::prescribe(int v_index, MotionProfile profile) {
  const auto p = std::ranges::find(prescribed_, v_index, &Prescribed::index);
  if (p == prescribed_.end()) return;
  p->profile = std::move(profile);
  p->given = true;
  if (begun_) state_.v[v_index] = p->profile.rate(state_.t);
  changed();
}

const MotionProfile* Simulation::profile(int v_index) const {
  const auto p = std::ranges::find(prescribed_, v_index, &Prescribed::index);
  return p == prescribed_.end() || !p->given ? nullptr : &p->profile;
}

int Simulation::add_wrench(int node, bool world_axes) {
  if (!model_->has(Kernel::node_wrenches) || (world_axes && !model_->has(Kernel::world)))
    throw std::logic_error("add_wrench: compile the model with CompileOptions::node_wrenches, in world axes also world_wrenches");
  NodeWrench w;
  w.node = node;
  w.world_axes = world_axes;
  wrenches_.push_back(w);
  world_rates_ = true;
  return static_cast<int>(wrenches_.size()) - 1;
}

void Simulation::record(Recorder& recorder, std::vector<Output> outputs, Rational period) {
  recorder_ = &recorder;
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
  wrenches_[static_cast<std::size_t>(slot)].f = f;
  changed();
}

void Simulation::make_integrator_once() {
  if (integrator_) return;
  x_.assign(static_cast<std::size_t>(model_->nq + model_->nv), 0.0);
  y_.assign(7, 0.0);
  integrator_ = make_integrator(ode(), options_.integrator);
}

OdeProblem Simulation::ode() {
  const Model& m = *model_;
  OdeProblem ode;
  ode.n = m.nq + m.nv;
  ode.n_quadrature = options_.ledger ? 7 : 0;
  ode.rhs = [this](double t, const double* x, double* xdot, double* ydot) { return rhs(t, x, xdot, ydot); };
  if (!normalised_.empty()) ode.project = [this](double* x) { model_->normalise(x); };
  const double absolute = options_.absolute_tolerance > 0 ? options_.absolute_tolerance : options_.integrator.relative_tolerance;
  ode.absolute_tolerance.assign(static_cast<std::size_t>(ode.n), absolute);
  // A mass-normalised modal coordinate that moves the body as much as 1 m of a rigid one is far larger than those in use:
  // eta counts as 1e-3 (slow modes) and as (1 rad/s / omega)^2 of that for fast ones, eta' as omega times it.
  for (const SweepBody& b : m.bodies) {
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = m.flexible[static_cast<std::size_t>(b.flexible)];
    for (int j = 0; j < b.n_modes; ++j) {
      const auto at = static_cast<std::size_t>(f.K_diagonal ? j : j * b.n_modes + j);
      const double w2 = std::max(1.0, f.K[at] / f.M_ee[static_cast<std::size_t>(j * b.n_modes + j)]);
      ode.absolute_tolerance[static_cast<std::size_t>(b.eta + j)] = 1e-3 * absolute / w2;
      ode.absolute_tolerance[static_cast<std::size_t>(m.nq + b.etadot + j)] = 1e-3 * absolute / std::sqrt(w2);
    }
  }
  ode.n_roots = static_cast<int>(events_.size());
  if (ode.n_roots > 0)
    ode.roots = [this](double t, const double* x, double* g) {
      for (std::size_t i = 0; i < events_.size(); ++i) g[i] = events_[i].function(t, x, x + model_->nq);
    };
  if (options_.integrator.linear_solver != "krylov") return ode;
  newton_ = std::make_unique<NewtonOperators>(model_, options_.quaternion_stabilisation);
  ode.jacobian_times = [this](double t, const double* x, const double* dx, double* J_dx) {
    const double *q = x, *v = x + model_->nq;
    apply_forces(t, q, v);
    return newton_->jacobian_times(inputs(q, v), dx, J_dx);
  };
  ode.prepare = [this](double, const double* x, double gamma, bool moved) { return newton_->prepare(x, gamma, moved); };
  ode.precondition = [this](const double* r, double* z) {
    newton_->precondition(r, z);
    return true;
  };
  return ode;
}

void Simulation::external_rates(const Inputs& in, const double* vdot, double* ydot) {
  // Forces of actuators on a free root are forces from outside.
  const Model& m = *model_;
  const auto driven = [&](int root) {
    const UserBody& u = m.user[static_cast<std::size_t>(root)];
    for (int j = u.v; j < u.v + u.nv; ++j)
      if (in.tau[j] != 0.0 || (m.has_prescribed() && m.prescribed[static_cast<std::size_t>(j)])) return true;
    return false;
  };
  ExternalLoads e;
  if (world_rates_ || std::ranges::any_of(roots_, driven))
    e = observer_->external(in, vdot);
  else
    e.power = observer_->internal_power(in, vdot);
  for (int i = 0; i < 3; ++i) ydot[i] = e.force[i], ydot[3 + i] = e.moment[i];
  ydot[6] = e.power;
}

const Observer& Simulation::observe() {
  if (!observed_) {
    breakdown_ = {};
    bad_rate_ = -1;
    if (!evaluate(state_.t, state_.q.data(), state_.v.data(), vdot_.data())) fail(explain({Code::not_finite, state_.t, "", "", "", "", ""}));
    observer_->update(inputs(state_.q.data(), state_.v.data()), vdot_.data());
    observed_ = true;
  }
  return *observer_;
}

const Eigen::VectorXd& Simulation::vdot() {
  observe();
  return vdot_;
}

void Simulation::begin_ledger() {
  const Observer& o = observe();
  momentum_0_ = o.momentum();
  energy_0_ = o.energy();
  scale_linear_ = momentum_0_.linear_magnitude;
  scale_angular_ = momentum_0_.angular_magnitude;
  scale_energy_ = energy_0_.magnitude;
}

LedgerState Simulation::ledger() {
  LedgerState s;
  if (!options_.ledger || !begun_) return s;
  const Observer& o = observe();
  const Momentum p = o.momentum();
  const Energy e = o.energy();
  const Eigen::Map<const Eigen::Matrix<double, 7, 1>> y(y_.data());
  s.linear = p.linear - momentum_0_.linear - y.head<3>();
  s.angular = p.angular - momentum_0_.angular - y.segment<3>(3);
  s.energy = e.total() - energy_0_.total() - y[6];
  scale_linear_ = std::max(scale_linear_, p.linear_magnitude);
  scale_angular_ = std::max(scale_angular_, p.angular_magnitude);
  scale_energy_ = std::max(scale_energy_, e.magnitude);
  const auto relative = [](double residual, double scale) { return scale > 0 ? residual / scale : residual; };
  s.linear_relative = relative(s.linear.norm(), scale_linear_);
  s.angular_relative = relative(s.angular.norm(), scale_angular_);
  s.energy_relative = relative(std::abs(s.energy), scale_energy_);
  worst_ledger_.linear_relative = std::max(worst_ledger_.linear_relative, s.linear_relative);
  worst_ledger_.angular_relative = std::max(worst_ledger_.angular_relative, s.angular_relative);
  worst_ledger_.energy_relative = std::max(worst_ledger_.energy_relative, s.energy_relative);
  return s;
}

void Simulation::write_outputs() {
  if (!recorder_ || last_output_ == state_.t) return;
  observe();
  std::size_t at = 0;
  for (const Output& o : outputs_) {
    o.fill(row_.data() + at);
    at += o.channel.components.size();
  }
  recorder_->row(state_.t, row_);
  last_output_ = state_.t;
}

double Simulation::next_corner() const {
  double t = std::numeric_limits<double>::infinity();
  for (const auto& p : prescribed_) t = std::min(t, p.profile.next_corner(state_.t));
  return t;
}

IntegratorStatistics Simulation::statistics() const { return integrator_ ? integrator_->statistics() : IntegratorStatistics{}; }

std::string Simulation::integrator_name() const { return integrator_ ? std::string(integrator_->name()) : options_.integrator.method; }

void Simulation::fail(RunFailure failure) {
  if (recorder_) {
    std::vector<double> x(state_.q.data(), state_.q.data() + state_.q.size());
    x.insert(x.end(), state_.v.data(), state_.v.data() + state_.v.size());
    recorder_->restart_state(state_.t, x);
    recorder_->flush();
  }
  throw NumericsError(std::move(failure));
}

}  // namespace cardan
