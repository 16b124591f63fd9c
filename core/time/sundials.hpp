#pragma once
// CVODES and ARKODE of SUNDIALS as integrators: what they have in common is almost everything. `Api` names the functions of one of them.
// One internal step per call; dense output, of which events are found, from the interpolation of CVODES or of our own; Newton's equations
// with a dense matrix by differences, or matrix-free by preconditioned GMRES (Saad & Schultz 1986).
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunmatrix/sunmatrix_sparse.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <stdexcept>
#include <utility>

#include "core/time/event_finder.hpp"
#include "core/time/hermite_output.hpp"
#include "core/time/methods.hpp"

namespace cardan::sundials {

// What both return by other names.
constexpr int kAtStop = 1, kTooAccurate = -2, kErrorFailure = -3, kNotConverged = -4, kLinearSetupFailed = -6, kLinearSolveFailed = -7;

/// How the equations of a step are solved.
struct Solution {
  bool newton = false, fixed_point = false;
  bool split = false;  // f in a linear part, implicit, and the rest of it
};

/// f, its rest and its linear part.
struct Rates {
  int (*all)(double t, N_Vector x, N_Vector xdot, void* self);
  int (*rest)(double t, N_Vector x, N_Vector xdot, void* self);
  int (*linear)(double t, N_Vector x, N_Vector xdot, void* self);
};

template <auto Free>
struct Freed {
  template <class T>
  void operator()(T* p) const {
    Free(p);
  }
};
inline void free_context(SUNContext c) { SUNContext_Free(&c); }

template <class Handle, auto Free>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Freed<Free>>;
using Vector = Owned<N_Vector, N_VDestroy>;

/// Set-up calls fail only for want of memory or by a mistake of ours.
inline void check(int flag, const char* call) {
  if (flag < 0) throw std::runtime_error(fmt::format("SUNDIALS: {} returned {}", call, flag));
}

inline SUNContext make_context() {
  SUNContext context = nullptr;
  check(SUNContext_Create(nullptr, &context), "SUNContext_Create");
  return context;
}

template <class Api>
class Sundials final : public Integrator {
 public:
  Sundials(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)),
        name_(options.method),
        events_(problem_),
        context_(make_context()),
        n_(std::max(problem_.n, 1)),  // SUNDIALS cannot do without states: one that rests stands in
        x_(static_cast<std::size_t>(n_)),
        x_out_(x_),
        quadrature_(Api::quadrature(options.method, problem_.n_quadrature)),
        rates_(static_cast<std::size_t>(problem_.n_quadrature)),
        part_(rates_),
        weights_(x_),
        errors_(x_),
        last_x_(x_),
        last_rate_(x_),
        beside_(x_),
        beside_rate_(x_),
        dense_(x_.size()) {
    x_vector_ = wrap(x_);
    x_out_vector_ = wrap(x_out_);
    weights_vector_ = wrap(weights_);
    errors_vector_ = wrap(errors_);
    beside_vector_ = wrap(beside_);
    memory_.reset(Api::create(name_, kRates, x_vector_.get(), context_.get()));
    void* m = memory_.get();
    check(Api::set_error_handler(
              m, [](int, const char*, const char*, char*, void*) {}, nullptr),
          "SetErrHandlerFn");
    check(Api::set_user_data(m, this), "SetUserData");
    std::vector<double> absolute = problem_.absolute_tolerance;
    absolute.resize(x_.size(), 1.0);
    group_weights_ = group_weights(problem_.group);
    relative_ = options.relative_tolerance;
    if (group_weights_.empty())
      check(Api::set_tolerances(m, relative_, wrap(absolute).get()), "SVtolerances");  // copied
    else
      check(Api::set_weights(m, &Sundials::error_weights), "WFtolerances");
    max_step_ = options.max_step;
    check(Api::set_max_step(m, max_step_), "SetMaxStep");
    initial_step_ = next_step_ = options.initial_step;
    check(Api::set_initial_step(m, next_step_), "SetInitStep");
    const Solution solution = Api::solution(name_);
    explicit_ = !solution.newton;
    split_ = solution.split;
    if (split_) J_ = Eigen::MatrixXd::Zero(n_, n_), centre_ = x_;
    if (solution.newton)
      nonlinear_.reset(SUNNonlinSol_Newton(x_vector_.get(), context_.get()));
    else if (solution.fixed_point)
      nonlinear_.reset(SUNNonlinSol_FixedPoint(x_vector_.get(), 0, context_.get()));
    if (nonlinear_) {
      solve_ = std::exchange(nonlinear_->ops->solve, &Sundials::solve);
      check(Api::set_nonlinear_solver(m, nonlinear_.get()), "SetNonlinearSolver");
      if (!Api::multistep && !split_) check(SUNNonlinSolSetConvTestFn(nonlinear_.get(), &Sundials::converged, this), "SetConvTestFn");
    }
    if (solution.newton && options.linear_solver == "krylov" && problem_.n > 0) {
      use_krylov();
    } else if (solution.newton) {
      matrix_.reset(SUNDenseMatrix(n_, n_, context_.get()));
      linear_.reset(SUNLinSol_Dense(x_vector_.get(), matrix_.get(), context_.get()));
      check(Api::set_linear_solver(m, linear_.get(), matrix_.get()), "SetLinearSolver");
      check(Api::set_jacobian(m, &Sundials::jacobian), "SetJacFn");
    }
  }

  void restart(double t, const double* x) override {
    begin_stretch();
    fell_short_ = 0;
    if (!Api::multistep && t != t_) next_step_ = initial_step_, near_limit_ = 0, since_linear_ = -1;
    if (std::exchange(had_event_, false)) since_linear_ = -1;  // as what friction holds from here on
    evaluated_ = false;
    stands_ = 0;
    std::copy_n(x, problem_.n, x_.begin());
    t_ = t;
    start_at(t);
    if (problem_.n_roots > 0) events_.restart(t, x_.data());
    ++restarts_;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    report.t = t_;
    if (t_ < t_stop) {
      const bool whole = t_ == t_internal_;  // else an event ended the last step inside of theirs
      if (whole) {
        report.limit = advance(t_stop);
        report.stiff = explicit_ && steps_ % (Api::multistep ? kStiffness : kStiffness / kLooks / 2) == 0 && stiff();
        if (steps_ % kStiffness == 0) look_at_rounding(report);
      }
      report.t = std::min(t_internal_, t_stop);
      if (problem_.n_roots > 0) {
        find_event(report, !Api::multistep && whole);
        if constexpr (!Api::multistep) {
          if (report.t < t_internal_ && problem_.n_quadrature > 0) integrals_inside(report.t);  // before anything is changed there
          if (report.event) next_step_ = initial_step_, had_event_ = true;  // what acts from here on may be far shorter, as a contact is
        }
      }
      if constexpr (Api::multistep) note_rates(report.t);
      t_ = report.t;
      report.order = Api::last_order(memory_.get(), name_);
    }
    interpolate(t_, x);
    return report;
  }

  void interpolate(double t, double* x) override { std::copy_n(state_at(t), problem_.n, x); }

  void integrals(double t, double* y, double* error) override {
    if constexpr (Api::multistep) {
      quadrature_.at(t, y, error);
    } else {
      const std::vector<double>& sum = t == t_internal_ ? quadrature_.sum() : integrals_inside(t);
      std::copy(sum.begin(), sum.end(), y);
      if (error) std::copy(quadrature_.error().begin(), quadrature_.error().end(), error);
    }
  }

  void remember(Archive& archive) override {
    std::vector<double> y(rates_), error(rates_);
    integrals(t_, y.data(), error.data());
    archive(std::span(y), std::span(error), error_sum_, linear_before_.products, linear_before_.iterations, unconverged_, integrand_calls_,
            steps_, rhs_calls_, restarts_, rejected_, setups_, events_);
    if constexpr (!Api::multistep) archive(next_step_, near_limit_);
    if (split_) archive(since_linear_, std::span(J_.data(), static_cast<std::size_t>(J_.size())), std::span(centre_));
    if (!archive.reading()) return;
    if constexpr (Api::multistep)
      quadrature_.begin_stretch_at(y.data(), error.data());
    else
      quadrature_.set(y.data(), error.data());
    check(Api::set_initial_step(memory_.get(), next_step_), "SetInitStep");
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s;
    s.steps = steps_;
    s.rhs_calls = rhs_calls_;
    s.integrand_calls = integrand_calls_;
    s.error_sum = error_sum_;
    s.rejected = rejected_;
    s.root_evaluations = events_.evaluations();
    s.restarts = restarts_;
    const LinearCounts linear = linear_counts();
    s.jacobian_products = linear_before_.products + linear.products;
    s.preconditioner_setups = setups_;
    s.linear_iterations = linear_before_.iterations + linear.iterations;
    Api::last_step(memory_.get(), &s.last_step);
    s.last_order = Api::last_order(memory_.get(), name_);
    return s;
  }

  int worst() const override { return worst_; }
  bool keeps_unprojected() const override { return true; }

  std::string_view name() const override { return name_; }

 private:
  Vector wrap(std::vector<double>& v) { return Vector(N_VMake_Serial(static_cast<sunindextype>(v.size()), v.data(), context_.get())); }

  /// GMRES, preconditioned from the left.
  void use_krylov() {
    constexpr int kSubspace = 10;  // products before they ask for a new preconditioner, or a smaller step
    void* m = memory_.get();
    const bool preconditioned = static_cast<bool>(problem_.prepare);
    linear_.reset(SUNLinSol_SPGMR(x_vector_.get(), preconditioned ? SUN_PREC_LEFT : SUN_PREC_NONE, kSubspace, context_.get()));
    check(Api::set_linear_solver(m, linear_.get(), nullptr), "SetLinearSolver");
    if (problem_.jacobian_times) check(Api::set_jacobian_times(m, nullptr, &Sundials::jacobian_times), "SetJacTimes");
    if (preconditioned) check(Api::set_preconditioner(m, &Sundials::prepare, &Sundials::precondition), "SetPreconditioner");
    krylov_ = true;
  }

  // --- what they call: no exception may pass through their frames -------------------------------------------------

  int evaluate(double t, const double* x, double* xdot) noexcept {
    constexpr int recoverable = 1, fatal = -1;
    try {
      elsewhere_ = false;
      if (problem_.n == 0) *xdot = 0.0;
      if (evaluated_ && t == last_t_ && std::equal(x, x + problem_.n, last_x_.begin())) {
        std::copy_n(last_rate_.begin(), problem_.n, xdot);
        return 0;
      }
      ++rhs_calls_;
      evaluated_ = false;
      if constexpr (!Api::multistep) reject_failed_trials();
      if (!problem_.rhs(t, x, xdot)) {
        trouble_ = "the right-hand side cannot be evaluated";
        ++refused_, refused_t_ = t;
        return recoverable;
      }
      const int bad = first_not_finite(xdot, problem_.n);
      if (bad >= 0) {
        trouble_ = fmt::format("the rate of state {} is {}", bad, xdot[bad]);
        ++refused_, refused_t_ = t;
        return recoverable;
      }
      if constexpr (Api::multistep) {
        if (!aside_) std::copy_n(xdot, problem_.n, last_rate_.begin());
        if (quadrature_.nodes() == 0) add_node(t, x);
      } else if (!aside_) {
        note_stage(t, x, xdot);
      }
      return 0;
    } catch (...) {
      thrown_ = std::current_exception();
      return fatal;
    }
  }

  void note_stage(double t, const double* x, const double* xdot) {
    const bool first = fresh_ && t == t_;
    if (!first && nonlinear_ && !split_ && !solved_) return;
    if (first) std::copy_n(xdot, problem_.n, dense_.begin_rate().begin());
    if (problem_.n_quadrature == 0) return;
    ++integrand_calls_;
    problem_.integrands(t, x, first ? quadrature_.start() : quadrature_.stage(t));
  }

  static int error_weights(N_Vector x_vector, N_Vector weights, void* self) {
    const auto* me = static_cast<Sundials*>(self);
    const double* x = N_VGetArrayPointer(x_vector);
    double* w = N_VGetArrayPointer(weights);
    for (std::size_t i = 0; i < me->group_weights_.size(); ++i)
      w[i] = me->group_weights_[i] / (me->relative_ * std::abs(x[i]) + me->problem_.absolute_tolerance[i]);
    return 0;
  }

  static int rest(double t, N_Vector x, N_Vector xdot, void* self) {
    auto* me = static_cast<Sundials*>(self);
    const int flag = me->evaluate(t, N_VGetArrayPointer(x), N_VGetArrayPointer(xdot));
    if (flag == 0) Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(xdot), me->n_) -= me->linear_part(x);
    return flag;
  }
  static int linear(double, N_Vector x, N_Vector xdot, void* self) {
    auto* me = static_cast<Sundials*>(self);
    Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(xdot), me->n_) = me->linear_part(x);
    return 0;
  }
  const Eigen::VectorXd& linear_part(N_Vector x) {
    from_centre_ = Eigen::Map<const Eigen::VectorXd>(N_VGetArrayPointer(x), n_) - Eigen::Map<const Eigen::VectorXd>(centre_.data(), n_);
    linear_part_.noalias() = J_ * from_centre_;
    return linear_part_;
  }
  /// The linear part is f's own at x_, by differences; f is linear enough while no trial is rejected.
  void linearise() {
    aside_ = true;
    const bool known = evaluated_;
    centre_ = x_;
    int flag = evaluate(t_, x_.data(), beside_rate_.data());
    evaluated_ = false;
    for (int j = 0; j < problem_.n && flag == 0; ++j) {
      double& x = x_[static_cast<std::size_t>(j)];
      const double here = x, step = std::sqrt(std::numeric_limits<double>::epsilon()) * std::max(1.0, std::abs(here));
      x = here + step;
      flag = evaluate(t_, x_.data(), beside_.data());
      x = here;
      for (int i = 0; i < n_; ++i) J_(i, j) = (beside_[static_cast<std::size_t>(i)] - beside_rate_[static_cast<std::size_t>(i)]) / step;
    }
    if (flag != 0) J_.setZero();
    evaluated_ = known;
    aside_ = false;
    since_linear_ = 0;
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    start_at(t_);
  }

  static int f(double t, N_Vector x, N_Vector xdot, void* self) {
    return static_cast<Sundials*>(self)->evaluate(t, N_VGetArrayPointer(x), N_VGetArrayPointer(xdot));
  }

  /// J by differences, with their own increments. It is here because the integrands are taken from the last evaluation
  /// of f: that of x, and not one that stepped aside for a column.
  static int jacobian(double t, N_Vector x_vector, N_Vector xdot, SUNMatrix J, void* self, N_Vector, N_Vector, N_Vector) {
    auto* me = static_cast<Sundials*>(self);
    if (me->split_) {
      for (int j = 0; j < me->n_; ++j)
        std::copy_n(me->J_.data() + static_cast<std::ptrdiff_t>(j) * me->n_, me->n_, SUNDenseMatrix_Column(J, j));
      return 0;
    }
    try {
      return me->columns(t, N_VGetArrayPointer(x_vector), N_VGetArrayPointer(xdot), J);
    } catch (...) {
      me->thrown_ = std::current_exception();
      return -1;
    }
  }

  int columns(double t, double* x, const double* xdot, SUNMatrix J) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    if constexpr (Api::multistep) take_rates(t, x);
    aside_ = true;
    double gamma = 0.0, size = 0.0;
    Api::gamma(memory_.get(), &gamma);
    Api::weights(memory_.get(), weights_vector_.get());
    for (int i = 0; i < n_; ++i) size += std::pow(xdot[i] * weights_[static_cast<std::size_t>(i)], 2);
    const double least = size > 0.0 ? 1000.0 * std::abs(gamma) * eps * n_ * std::sqrt(size / n_) : 1.0;
    for (int j = 0; j < n_; ++j) {
      const double here = x[j], step = std::max(std::sqrt(eps) * std::abs(here), least / weights_[static_cast<std::size_t>(j)]);
      double* column = SUNDenseMatrix_Column(J, j);
      x[j] = here + step;
      const int flag = evaluate(t, x, column);
      x[j] = here;
      if (flag != 0) return aside_ = false, flag;
      for (int i = 0; i < n_; ++i) column[i] = (column[i] - xdot[i]) / step;
    }
    elsewhere_ = true;
    aside_ = false;
    return 0;
  }

  // --- integrals: their rates at the ends of steps, from the last evaluation of f there -------------------------------

  void take_rates(double t, const double* x) {
    if (problem_.n_quadrature == 0 || elsewhere_) return;
    ++integrand_calls_;
    problem_.integrands(t, x, rates_.data());
  }

  void add_node(double t, const double* x) {
    if (problem_.n_quadrature == 0) return;
    take_rates(t, x);
    quadrature_.add(t, rates_.data());
  }

  /// Of a method of many steps, at t, where the last one ends. An event inside of theirs is a node of its own: what acts may have a corner
  /// there, and the end of theirs lies beyond.
  void note_rates(double t) {
    if (problem_.n_quadrature == 0 || still_) return;
    if (t == t_internal_) return quadrature_.add(t, rates_.data());
    state_at(t);
    aside_ = true;
    const int flag = evaluate(t, x_out_.data(), beside_rate_.data());
    aside_ = false;
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    if (flag != 0) return;
    ++integrand_calls_;
    problem_.integrands(t, x_out_.data(), part_.data());
    quadrature_.add(t, part_.data());
  }

  /// A part of Newton's equations that may refuse or throw; `out`: n numbers that must be finite, or null.
  template <class Part>
  int solve_part(const char* refused, const double* out, const Part& part) noexcept {
    constexpr int recoverable = 1, fatal = -1;
    try {
      if (part() && (out == nullptr || first_not_finite(out, problem_.n) < 0)) return 0;
      trouble_ = refused;
      return recoverable;
    } catch (...) {
      thrown_ = std::current_exception();
      return fatal;
    }
  }

  static int jacobian_times(N_Vector dx, N_Vector J_dx, double t, N_Vector x, N_Vector, void* self, N_Vector) {
    auto* me = static_cast<Sundials*>(self);
    double* out = N_VGetArrayPointer(J_dx);
    return me->solve_part("J v cannot be evaluated", out,
                          [&] { return me->problem_.jacobian_times(t, N_VGetArrayPointer(x), N_VGetArrayPointer(dx), out); });
  }

  static int prepare(double t, N_Vector x, N_Vector, int same_jacobian, int* moved, double gamma, void* self) {
    auto* me = static_cast<Sundials*>(self);
    *moved = !same_jacobian;
    ++me->setups_;
    return me->solve_part("the preconditioner cannot be prepared", nullptr,
                          [&] { return me->problem_.prepare(t, N_VGetArrayPointer(x), gamma, !same_jacobian); });
  }

  static int precondition(double, N_Vector, N_Vector, N_Vector r, N_Vector z, double, double, int, void* self) {
    auto* me = static_cast<Sundials*>(self);
    double* out = N_VGetArrayPointer(z);
    return me->solve_part("the preconditioner cannot be applied", out,
                          [&] { return me->problem_.precondition(N_VGetArrayPointer(r), out); });
  }

  // --- steps -------------------------------------------------------------------------------------------------------

  /// x_ becomes the state at t.
  void start_at(double t) {
    const LinearCounts linear = linear_counts();
    linear_before_.products += linear.products, linear_before_.iterations += linear.iterations;
    check(Api::restart(memory_.get(), name_, kRates, t, x_vector_.get()), "ReInit");
    check(Api::set_initial_step(memory_.get(), next_step_), "SetInitStep");
    unsolved_ = refused_ = failures_ = 0;
    t_internal_ = t;
    fresh_ = true;
    part_t_ = std::numeric_limits<double>::quiet_NaN();
  }

  /// to_it: while it lies inside of the step, up to it anew. Polynomials inside of a step go through rates there, which may be those beyond
  /// the event.
  void find_event(StepReport& report, bool to_it) {
    constexpr int kTries = 8;
    constexpr double kThere = 1e-7;  // of the step, from its ends
    constexpr int kShort = 2;
    const double there = std::max(kThere * (t_internal_ - t_), 64.0 * std::numeric_limits<double>::epsilon() * std::abs(t_));
    const auto state = [this](double t) { return state_at(t); };
    const int worst = worst_;
    const double whole = report.t;
    for (int tries = to_it && !still_ ? kTries : 0;; --tries) {
      const auto beside_at = [this](double t, double dt) { return beside(t, dt); };
      report.event = events_.find(report.t, state, state, beside_at, [this](double t) { return roughly(t); });
      const double way = report.t - t_;
      if (tries == 0 || !report.event || t_internal_ - report.t <= there || way <= there) break;
      if (fell_short_ >= kShort && way <= 2.0 * last_way_) break;  // their sum of stages does not come there for rounding
      if constexpr (!Api::multistep) {
        last_way_ = way;
        events_.take_back();
        take_back();
        advance(report.t);
        report.t = t_internal_;
        worst_ = worst;  // what limited the step is what limited the whole one
      }
    }
    fell_short_ = report.event || report.t == whole ? 0 : fell_short_ + 1;
    if (report.event) report.crossed = events_.crossed(), report.limit = StepLimit::stop;
  }
  /// The last step, of a method of one step, has not been.
  void take_back() {
    x_ = dense_.begin();
    evaluated_ = false;
    quadrature_.take_back();
    error_sum_ = error_sum_before_;
    --steps_;
    start_at(t_);
  }

  StepLimit advance(double t_stop) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    still_ = t_stop - t_ <= 8.0 * eps * std::max(std::abs(t_), std::abs(t_stop));
    if (still_) {  // too close for them to start
      begin_stretch();
      start_at(t_stop);
      return StepLimit::stop;
    }
    if (problem_.project && off_manifold()) {
      x_ = x_out_;
      start_at(t_);
    }
    if (split_ && (since_linear_ < 0 || since_linear_ >= kLinear)) linearise();
    trouble_.clear();
    tried_ = rejected_in_step_ = false;
    worst_ = -1;
    error_sum_before_ = error_sum_;
    check(Api::set_stop_time(memory_.get(), t_stop), "SetStopTime");
    if constexpr (!Api::multistep) begin_step();
    int flag = Api::step(memory_.get(), t_stop, x_vector_.get(), &t_internal_);
    // ARKODE gives up where what it takes explicitly cannot be evaluated: up to there by halves.
    while (!Api::multistep && (explicit_ || split_) && flag < 0 && !thrown_ && refused_ > 0 &&
           refused_t_ - t_ > 16.0 * eps * std::abs(t_)) {
      rejected_.not_evaluated += refused_;
      next_step_ = 0.5 * (refused_t_ - t_);
      x_ = dense_.begin();
      start_at(t_);
      check(Api::set_stop_time(memory_.get(), t_stop), "SetStopTime");
      flag = Api::step(memory_.get(), t_stop, x_vector_.get(), &t_internal_);
    }
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    if constexpr (Api::multistep) {
      if (flag == kErrorFailure) reject_last_trial();
    } else {
      look_at_errors(flag);
    }
    if (flag < 0 && flag != kErrorFailure) worst_ = -1;
    long unsolved = refused_;
    if (nonlinear_) Api::unsolved(memory_.get(), &unsolved);
    const long failed = unsolved - std::exchange(unsolved_, unsolved);
    (trouble_.empty() ? rejected_.not_converged : rejected_.not_evaluated) += failed;
    if (flag < 0) fail(flag);
    // They begin with what the rates change a state that is zero by its tolerance in, however short, and grow from there: no step yet for
    // events and integrals, which are over time.
    constexpr int kMostStanding = 16;
    stands_ = t_internal_ != t_stop && t_internal_ - t_ <= 8.0 * eps * std::abs(t_) ? stands_ + 1 : 0;
    if (stands_ > (trouble_.empty() ? kMostStanding : 0)) fail(kErrorFailure);
    if constexpr (!Api::multistep) evaluate_the_end();
    if (stands_ > 0) return t_ = t_internal_, advance(t_stop);
    ++steps_;
    since_linear_ = rejected_in_step_ || failed > 0 ? -1 : since_linear_ + 1;
    if (problem_.n_quadrature > 0) {
      if constexpr (Api::multistep) {
        Api::weights(memory_.get(), weights_vector_.get());  // those of the next step
        take_rates_of_end();
        Api::local_errors(memory_.get(), errors_vector_.get());
      } else {
        error_sum_ += Api::left_by_newton(name_);
      }
      error_sum_ += std::min(1.0, N_VWrmsNorm(errors_vector_.get(), weights_vector_.get()));
    }
    double h = 0.0;
    Api::last_step(memory_.get(), &h);
    if (!Api::multistep) {
      double next = 0.0;
      Api::current_step(memory_.get(), &next);
      const bool cut = flag == kAtStop && !rejected_in_step_ && failed == 0;
      next_step_ = cut ? std::max(next_step_, next) : next;
    }
    if (rejected_in_step_) return worst_ = blamed_, worst_ >= 0 ? StepLimit::error : StepLimit::given;
    if (worst_ < 0 || failed > 0 || (max_step_ > 0.0 && h >= max_step_)) return StepLimit::given;
    return flag == kAtStop ? StepLimit::stop : StepLimit::error;
  }

  /// Of a multistep method, whose last evaluation of f may be that of the predicted state: where a stiff force makes much of the
  /// difference, one more at x. Where Newton's iteration leaves as much, rates are off by what they changed by, in that proportion.
  void take_rates_of_end() {
    take_rates(t_internal_, x_.data());
    if (off_history() > 1.0) {
      off_ = rates_, errors_ = beside_;
      if (evaluate(t_internal_, x_.data(), beside_rate_.data()) == 0) take_rates(t_internal_, x_.data());
      if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
      const double left = off_history(), h = t_internal_ - t_;
      for (std::size_t i = 0; i < x_.size(); ++i) errors_[i] -= beside_[i];
      const double change = h * N_VWrmsNorm(errors_vector_.get(), weights_vector_.get());
      for (std::size_t i = 0; i < off_.size(); ++i) off_[i] = change > 0.0 ? h * left / change * std::abs(rates_[i] - off_[i]) : 0.0;
      quadrature_.add_error(off_.data());
    }
  }
  /// In the norm of the error test: a step with the rates of the last evaluation of f, from one with those of the method's polynomial.
  double off_history() {
    check(Api::slope(memory_.get(), t_internal_, beside_vector_.get()), "GetDky");
    for (std::size_t i = 0; i < x_.size(); ++i) beside_[i] -= last_rate_[i];
    return (t_internal_ - t_) * N_VWrmsNorm(beside_vector_.get(), weights_vector_.get());
  }

  void begin_stretch() {
    if constexpr (Api::multistep) {
      quadrature_.begin_stretch(t_);
    } else if (t_ != t_internal_ && problem_.n_quadrature > 0) {
      quadrature_.set_sum(integrals_inside(t_));
    }
  }

  /// The integrals to t inside the last step of a method of one step.
  const std::vector<double>& integrals_inside(double t) {
    double h = 0.0;
    Api::last_step(memory_.get(), &h);
    if (still_ || h == 0.0) return quadrature_.sum();
    if (t == part_t_) return part_;
    part_t_ = t;
    inside(t);
    quadrature_.inside(1.0 + (t - t_internal_) / h, part_.data());
    return part_;
  }

  void begin_step() {
    dense_.begin(x_, last_rate_);
    part_t_ = std::numeric_limits<double>::quiet_NaN();
    rate_ = kUnknownRate;
  }

  /// A method of one step begins the next one with the rate at the end of this one: that of the integrals is taken with it.
  void evaluate_the_end() {
    aside_ = true;
    evaluated_ = evaluate(t_internal_, x_.data(), last_rate_.data()) == 0;
    aside_ = false;
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    last_x_ = x_;
    last_t_ = t_internal_;
    fresh_ = !evaluated_;
    if (problem_.n_quadrature == 0) return;
    if (evaluated_) ++integrand_calls_, problem_.integrands(t_internal_, x_.data(), quadrature_.end());
    quadrature_.step(t_internal_ - t_);
  }

  /// Of a method of one step, whose errors are known when it is done.
  void look_at_errors(int flag) {
    reject_failed_trials();
    if (flag >= 0) find_worst();
  }
  /// Before the first evaluation after a trial whose error was too large: that error is still there.
  void reject_failed_trials() {
    long all = 0;
    Api::error_failures(memory_.get(), &all);
    if (all == std::exchange(failures_, all)) return;
    find_worst();
    count_rejection(rejected_, problem_, worst_);
    rejected_in_step_ = true;
    blamed_ = worst_;
  }
  void find_worst() {
    Api::local_errors(memory_.get(), errors_vector_.get());
    Api::weights(memory_.get(), weights_vector_.get());
    share_ = Eigen::Map<const Eigen::ArrayXd>(errors_.data(), n_) * Eigen::Map<const Eigen::ArrayXd>(weights_.data(), n_);
    worst_ = problem_.n > 0 ? largest_of(share_.data(), n_) : -1;
  }

  /// Their own solver. CVODES: and a look at the correction that each trial comes to, as of trials that are rejected it tells no errors.
  /// ARKODE: and f where it ends, which it does not ask for, for the integrals; with and without them, so that nothing depends on it.
  static int solve(SUNNonlinearSolver solver, N_Vector x, N_Vector correction, N_Vector weights, double tolerance, int setup,
                   void* memory) {
    void* self = nullptr;
    Api::user_data(memory, &self);
    auto* me = static_cast<Sundials*>(self);
    if constexpr (Api::multistep) me->reject_last_trial();
    const int flag = me->solve_(solver, x, correction, weights, tolerance, setup, memory);
    if (flag != SUN_NLS_SUCCESS) return flag;
    if constexpr (!Api::multistep) {
      if (me->split_) return flag;  // its rest is asked for there
      double t = 0.0;
      Api::stage_time(memory, &t);
      for (std::size_t i = 0; i < me->x_.size(); ++i) me->beside_[i] = N_VGetArrayPointer(x)[i] + N_VGetArrayPointer(correction)[i];
      me->solved_ = true;
      const int refused = me->evaluate(t, me->beside_.data(), me->beside_rate_.data());
      me->solved_ = false;
      return refused;
    }
    me->share_ = Eigen::Map<const Eigen::ArrayXd>(N_VGetArrayPointer(correction), me->n_) *
                 Eigen::Map<const Eigen::ArrayXd>(N_VGetArrayPointer(weights), me->n_);
    me->worst_ = me->problem_.n > 0 ? largest_of(me->share_.data(), me->n_) : -1;
    me->tried_ = true;
    return flag;
  }
  /// ARKODE: of each solution its own rate of convergence; theirs is that of a stage before, when the matrix was newer, and lets a
  /// correction of any size pass. The first correction is mostly the motion itself, along which any matrix is right: the second beside it
  /// tells nothing of how errors of the matrix converge. That is known from a third one, of an earlier stage of the same step.
  static int converged(SUNNonlinearSolver solver, N_Vector, N_Vector correction, double tolerance, N_Vector weights, void* self) {
    auto* me = static_cast<Sundials*>(self);
    const double size = N_VWrmsNorm(correction, weights), before = std::exchange(me->correction_, size);
    int iteration = 0;
    SUNNonlinSolGetCurIter(solver, &iteration);
    if (size == 0.0) return SUN_NLS_SUCCESS;
    if (iteration == 0) return size <= 1e-3 * tolerance ? SUN_NLS_SUCCESS : SUN_NLS_CONTINUE;
    const double rate = size / before;
    if (iteration > 1) me->rate_ = rate;
    const double slowest = std::max(rate, me->rate_);
    if (slowest < 1.0 && slowest / (1.0 - slowest) * size <= tolerance) return SUN_NLS_SUCCESS;
    return rate > 2.0 ? SUN_NLS_CONV_RECVR : SUN_NLS_CONTINUE;
  }
  /// If there was one in this step: another one follows, or none.
  void reject_last_trial() {
    if (!std::exchange(tried_, false)) return;
    count_rejection(rejected_, problem_, worst_);
    rejected_in_step_ = true;
    blamed_ = worst_;
  }

  /// How far a projection moves x_ does not matter (f is linear in unit quaternions, the history is not touched), until it is
  /// of the size of x_ itself and changes the weights of the error test.
  bool off_manifold() {
    constexpr double kFar = 0.1;
    state_at(t_);
    for (std::size_t i = 0; i < x_.size(); ++i)
      if (std::abs(x_out_[i] - x_[i]) > kFar * std::max(1.0, std::abs(x_[i]))) return true;
    return false;
  }

  /// CVODES: whether the fixed-point iteration has failed in a tenth of the steps since the last look: it converges while h times the
  /// largest eigenvalue is about 1 at most. ARKODE: whether h times the rate at which the error of a step grows, which is soon in the
  /// direction of that eigenvalue, was beyond what is stable in most of the last looks.
  bool stiff() {
    if constexpr (Api::multistep) {
      const long failed = rejected_.not_converged + rejected_.not_evaluated;
      return failed - std::exchange(unconverged_, failed) > kStiffness / 10;
    } else {
      const double size = N_VWrmsNorm(errors_vector_.get(), weights_vector_.get());
      double h = 0.0;
      Api::last_step(memory_.get(), &h);
      if (!(size > 0.0) || !evaluated_) return false;
      x_out_ = x_;
      for (std::size_t i = 0; i < x_.size(); ++i) x_out_[i] += errors_[i] / size;
      const bool known = std::exchange(evaluated_, false);
      aside_ = true;
      const int flag = evaluate(t_internal_, x_out_.data(), beside_.data());
      aside_ = false;
      evaluated_ = known;
      if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
      if (flag != 0) return false;
      for (std::size_t i = 0; i < x_.size(); ++i) beside_[i] -= last_rate_[i];
      const bool beyond = h * N_VWrmsNorm(beside_vector_.get(), weights_vector_.get()) > kStable;
      near_limit_ = std::clamp(near_limit_ + (beyond ? 1 : -1), 0, 2 * kLooks);
      return near_limit_ >= kLooks;
    }
  }

  /// At the end of the last step, whose own rates may be those of a predicted state.
  void look_at_rounding(StepReport& report) {
    for (int i = 0; i < problem_.n; ++i) x_out_[static_cast<std::size_t>(i)] = moved_by_digits(x_[static_cast<std::size_t>(i)], i);
    if (problem_.n == 0 || !problem_.rhs(t_internal_, x_.data(), beside_rate_.data()) ||
        !problem_.rhs(t_internal_, x_out_.data(), beside_.data()))
      return;
    double h = 0.0;
    Api::last_step(memory_.get(), &h);
    check(Api::weights(memory_.get(), weights_vector_.get()), "GetErrWeights");
    for (std::size_t i = 0; i < x_.size(); ++i) beside_[i] -= beside_rate_[i];
    const double rounding = h * kLostOfMoved * Api::noise(memory_.get(), name_) * N_VWrmsNorm(beside_vector_.get(), weights_vector_.get());
    if (!(rounding > kMuchRounding)) return;
    report.rounding = rounding;
    N_VProd(beside_vector_.get(), weights_vector_.get(), beside_vector_.get());
    report.rounded = largest_of(beside_.data(), problem_.n);
  }

  [[noreturn]] void fail(int flag) const {
    double h = 0.0;
    Api::current_step(memory_.get(), &h);
    const bool too_small = flag == kErrorFailure || flag == kNotConverged;
    const char* unsolved = krylov_ ? "Newton's equations cannot be solved" : "the Newton matrix is singular";
    std::string what = flag == kErrorFailure        ? "the error stays above the tolerance"
                       : flag == kNotConverged      ? "the corrector iteration does not converge"
                       : flag == kTooAccurate       ? "the tolerances ask for more digits than a double has"
                       : flag == kLinearSetupFailed ? "the Jacobian cannot be evaluated"
                       : flag == kLinearSolveFailed ? unsolved
                                                    : fmt::format("{} returned {}", Api::name, flag);
    if (!trouble_.empty()) what = trouble_;
    fail_integration(too_small ? Code::step_too_small : Code::integrator_failed, t_,
                     fmt::format("{}; {}, order {}, step = {:.3g} s", what, name_, Api::current_order(memory_.get(), name_), h),
                     "a discontinuity that is no event, a singularity, or tolerances that do not fit");
  }

  /// Projected copy of the state inside the last internal step; their history keeps what they computed.
  const double* state_at(double t) {
    if (t == t_internal_ || still_)
      x_out_ = x_;
    else if constexpr (Api::multistep)
      check(Api::dense_output(memory_.get(), t, x_out_vector_.get()), "GetDky");
    else
      inside(t);
    if (problem_.project) problem_.project(t, x_out_.data());
    return x_out_.data();
  }

  /// The state at t + dt, near to t inwards; at the end of a step of a method of one step by the rate there.
  const double* beside(double t, double dt) {
    if (Api::multistep || t != t_internal_ || !evaluated_) return state_at(t + dt);
    for (std::size_t i = 0; i < x_.size(); ++i) x_out_[i] = x_[i] + dt * last_rate_[i];
    return x_out_.data();
  }

  /// state_at() without an evaluation of f.
  const double* roughly(double t) {
    if (Api::multistep || dense_.known() || still_) return state_at(t);
    double h = 0.0;
    Api::last_step(memory_.get(), &h);
    dense_.end(x_, last_rate_, h);
    dense_.at(1.0 + (t - t_internal_) / h, x_out_.data());
    if (problem_.project) problem_.project(t, x_out_.data());
    return x_out_.data();
  }

  /// x_out_ at t inside the last step of a method of one step.
  void inside(double t) {
    double h = 0.0;
    Api::last_step(memory_.get(), &h);
    if (!dense_.known()) {
      quadrature_.guess_inside();
      aside_ = true;
      const bool known = std::exchange(evaluated_, false);
      dense_.end(x_, last_rate_, h);
      dense_.complete([&](double s, double* x, double* xdot) {
        const double at = t_internal_ + (s - 1.0) * h;
        if (problem_.project) problem_.project(at, x);
        if (evaluate(at, x, xdot) != 0) return false;
        if (problem_.n_quadrature == 0) return true;
        ++integrand_calls_;
        problem_.integrands(at, x, s < 0.5 ? quadrature_.third() : quadrature_.two_thirds());
        return true;
      });
      aside_ = false;
      evaluated_ = known;
      if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    }
    dense_.at(1.0 + (t - t_internal_) / h, x_out_.data());
  }

  struct LinearCounts {
    long products = 0, iterations = 0;
  };
  /// Of the Krylov solver since the last start.
  LinearCounts linear_counts() const {
    LinearCounts c;
    if (!krylov_) return c;
    Api::jacobian_products(memory_.get(), &c.products);
    Api::linear_iterations(memory_.get(), &c.iterations);
    return c;
  }

  static constexpr Rates kRates = {&Sundials::f, &Sundials::rest, &Sundials::linear};

  OdeProblem problem_;
  std::string name_;
  EventFinder events_;
  Owned<SUNContext, free_context> context_;  // outlives everything made in it
  int n_;
  std::vector<double> x_, x_out_;
  typename Api::Quadrature quadrature_;
  std::vector<double> rates_, part_;                          // of the integrals; they at part_t_, inside the last step
  double part_t_ = std::numeric_limits<double>::quiet_NaN();  // [s]
  std::vector<double> group_weights_;                         // empty: one group
  double relative_ = 0.0;
  std::vector<double> weights_, errors_;  // of the last step, as they have them
  Vector x_vector_, x_out_vector_, weights_vector_, errors_vector_, beside_vector_;
  Owned<SUNMatrix, SUNMatDestroy> matrix_;
  Owned<SUNLinearSolver, SUNLinSolFree> linear_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFree> nonlinear_;
  decltype(std::declval<SUNNonlinearSolver>()->ops->solve) solve_ = nullptr;  // as they have it
  std::unique_ptr<void, Freed<&Api::free>> memory_;
  double t_ = 0.0, t_internal_ = 0.0;  // [s] reported to the caller; reached by them, >= t_
  bool krylov_ = false, explicit_ = false;
  bool still_ = false;                               // the last step was one of rounding, in which nothing moves
  bool elsewhere_ = false;                           // the last evaluation of f was that of a column of J
  double error_sum_ = 0.0, error_sum_before_ = 0.0;  // the last step
  LinearCounts linear_before_;
  static constexpr double kUnknownRate = 0.5;  // of Newton's iteration: what is left is as large as the last correction
  static constexpr long kStiffness = 1000;     // steps between two looks
  static constexpr double kStable = 3.0;       // h times an eigenvalue: about where explicit methods of order 5 and 6 end
  static constexpr int kLooks = 10;            // of that at most, half of them in doubt
  int near_limit_ = 0;
  int fell_short_ = 0;      // steps one after the other to an event that was not there
  double last_way_ = 0.0;   // [s] to it
  bool had_event_ = false;  // since the last restart
  bool split_ = false;      // f into J_ (x - centre_) and the rest
  Eigen::MatrixXd J_;
  Eigen::VectorXd from_centre_, linear_part_;
  std::vector<double> centre_;
  static constexpr int kLinear = 50;             // steps after which they are taken anew
  int since_linear_ = -1;                        // steps; -1: they are too old
  double correction_ = 0.0;                      // of Newton's last iteration, in the norm of the error test
  double rate_ = kUnknownRate;                   // of Newton's corrections from the second on, where last seen in this step
  bool solved_ = false;                          // f is evaluated where the equations of a stage are solved
  bool aside_ = false;                           // f is evaluated for something else than a stage
  int stands_ = 0;                               // so many steps in a row were no longer than rounding of t
  bool fresh_ = true;                            // the rates at the start of the step are not known yet
  bool evaluated_ = false;                       // f at last_x_ is last_rate_
  std::vector<double> last_x_, last_rate_;       // the end of the last step
  std::vector<double> beside_, beside_rate_;     // scratch
  std::vector<double> off_;                      // of rates_
  HermiteOutput dense_;                          // of a method of one step
  double last_t_ = 0.0;                          // [s] of last_x_
  double initial_step_ = 0.0, next_step_ = 0.0;  // [s] 0: theirs to choose
  double refused_t_ = 0.0;                       // [s] of the last of these
  long refused_ = 0, failures_ = 0;              // since the last start: evaluations; trials whose error was too large
  long unconverged_ = 0, integrand_calls_ = 0;
  long steps_ = 0, rhs_calls_ = 0, restarts_ = 0, setups_ = 0;
  Rejections rejected_;
  long unsolved_ = 0;                              // trials since the last start that are counted
  bool tried_ = false, rejected_in_step_ = false;  // a trial was solved, and not yet rejected; one was
  Eigen::ArrayXd share_;                           // of each state in the correction of the last trial
  int worst_ = -1, blamed_ = -1;                   // the largest of them; of a trial that was rejected
  double max_step_ = 0.0;                          // [s] 0 = none
  std::string trouble_;                            // why the right-hand side was refused last
  std::exception_ptr thrown_;
};

}  // namespace cardan::sundials
