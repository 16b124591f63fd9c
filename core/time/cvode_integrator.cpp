// SUNDIALS CVODES (Hindmarsh et al. 2005): variable-order Adams with fixed-point iteration, BDF with Newton: a dense
// matrix by differences, or matrix-free by preconditioned GMRES (Saad & Schultz 1986). One internal step per call;
// events and dense output from its interpolation polynomial.
#include <cvodes/cvodes.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <stdexcept>
#include <utility>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"
#include "core/time/node_quadrature.hpp"

namespace cardan {
namespace {

template <auto Free>
struct Freed {
  template <class T>
  void operator()(T* p) const {
    Free(p);
  }
};
void free_context(SUNContext c) { SUNContext_Free(&c); }
void free_memory(void* m) { CVodeFree(&m); }

template <class Handle, auto Free>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Freed<Free>>;
using Vector = Owned<N_Vector, N_VDestroy>;

/// Set-up calls fail only for want of memory or by a mistake of ours.
void check(int flag, const char* call) {
  if (flag < 0) throw std::runtime_error(fmt::format("CVODES: {} returned {}", call, flag));
}

SUNContext make_context() {
  SUNContext context = nullptr;
  check(SUNContext_Create(nullptr, &context), "SUNContext_Create");
  return context;
}

class Cvode final : public Integrator {
 public:
  Cvode(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)),
        name_(options.method),
        events_(problem_),
        context_(make_context()),
        n_(std::max(problem_.n, 1)),  // CVODES cannot do without states: one that rests stands in
        x_(static_cast<std::size_t>(n_)),
        x_out_(x_),
        quadrature_(problem_.n_quadrature),
        rates_(static_cast<std::size_t>(problem_.n_quadrature)),
        weights_(x_),
        errors_(x_) {
    const bool stiff = options.method == "cvode_bdf";
    x_vector_ = wrap(x_);
    x_out_vector_ = wrap(x_out_);
    weights_vector_ = wrap(weights_);
    errors_vector_ = wrap(errors_);
    memory_.reset(CVodeCreate(stiff ? CV_BDF : CV_ADAMS, context_.get()));
    void* m = memory_.get();
    check(CVodeSetErrHandlerFn(
              m, [](int, const char*, const char*, char*, void*) {}, nullptr),
          "CVodeSetErrHandlerFn");
    check(CVodeInit(m, &Cvode::f, 0.0, x_vector_.get()), "CVodeInit");
    check(CVodeSetUserData(m, this), "CVodeSetUserData");
    std::vector<double> absolute = problem_.absolute_tolerance;
    absolute.resize(x_.size(), 1.0);
    group_weights_ = group_weights(problem_.group);
    relative_ = options.relative_tolerance;
    if (group_weights_.empty())
      check(CVodeSVtolerances(m, relative_, wrap(absolute).get()), "CVodeSVtolerances");  // copied
    else
      check(CVodeWFtolerances(m, &Cvode::error_weights), "CVodeWFtolerances");
    max_step_ = options.max_step;
    check(CVodeSetMaxStep(m, max_step_), "CVodeSetMaxStep");
    check(CVodeSetInitStep(m, options.initial_step), "CVodeSetInitStep");
    // Orders 3 to 5 are unstable for modes with little damping.
    if (stiff) check(CVodeSetStabLimDet(m, SUNTRUE), "CVodeSetStabLimDet");
    nonlinear_.reset(stiff ? SUNNonlinSol_Newton(x_vector_.get(), context_.get())
                           : SUNNonlinSol_FixedPoint(x_vector_.get(), 0, context_.get()));
    solve_ = std::exchange(nonlinear_->ops->solve, &Cvode::solve);
    check(CVodeSetNonlinearSolver(m, nonlinear_.get()), "CVodeSetNonlinearSolver");
    explicit_ = !stiff;
    if (stiff && options.linear_solver == "krylov" && problem_.n > 0) {
      use_krylov();
    } else if (stiff) {
      matrix_.reset(SUNDenseMatrix(n_, n_, context_.get()));
      linear_.reset(SUNLinSol_Dense(x_vector_.get(), matrix_.get(), context_.get()));
      check(CVodeSetLinearSolver(m, linear_.get(), matrix_.get()), "CVodeSetLinearSolver");
      check(CVodeSetJacFn(m, &Cvode::jacobian), "CVodeSetJacFn");
    }
  }

  void restart(double t, const double* x) override {
    quadrature_.begin_stretch(t_);
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
      if (t_ == t_internal_) {  // else an event ended the last step inside of CVODES' own
        report.limit = advance(t_stop);
        report.stiff = explicit_ && steps_ % kStiffness == 0 && stiff();
      }
      report.t = std::min(t_internal_, t_stop);
      if (problem_.n_roots > 0) {
        report.event = events_.find(report.t, [this](double t) { return state_at(t); });
        if (report.event) report.crossed = events_.crossed(), report.limit = StepLimit::stop;
      }
      t_ = report.t;
      CVodeGetLastOrder(memory_.get(), &report.order);
    }
    interpolate(t_, x);
    return report;
  }

  void interpolate(double t, double* x) override { std::copy_n(state_at(t), problem_.n, x); }

  void integrals(double t, double* y, double* error) override { quadrature_.at(t, y, error); }

  void remember(Archive& archive) override {
    std::vector<double> y(rates_), error(rates_);
    quadrature_.at(t_, y.data(), error.data());
    archive(std::span(y), std::span(error), error_sum_, linear_before_.products, linear_before_.iterations, unconverged_, integrand_calls_,
            steps_, rhs_calls_, restarts_, rejected_, setups_, events_);
    if (archive.reading()) quadrature_.begin_stretch_at(y.data(), error.data());
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
    CVodeGetLastStep(memory_.get(), &s.last_step);
    CVodeGetLastOrder(memory_.get(), &s.last_order);
    return s;
  }

  int worst() const override { return worst_; }

  std::string_view name() const override { return name_; }

 private:
  Vector wrap(std::vector<double>& v) { return Vector(N_VMake_Serial(static_cast<sunindextype>(v.size()), v.data(), context_.get())); }

  /// GMRES, preconditioned from the left.
  void use_krylov() {
    constexpr int kSubspace = 10;  // products before CVODES asks for a new preconditioner, or a smaller step
    void* m = memory_.get();
    const bool preconditioned = static_cast<bool>(problem_.prepare);
    linear_.reset(SUNLinSol_SPGMR(x_vector_.get(), preconditioned ? SUN_PREC_LEFT : SUN_PREC_NONE, kSubspace, context_.get()));
    check(CVodeSetLinearSolver(m, linear_.get(), nullptr), "CVodeSetLinearSolver");
    if (problem_.jacobian_times) check(CVodeSetJacTimes(m, nullptr, &Cvode::jacobian_times), "CVodeSetJacTimes");
    if (preconditioned) check(CVodeSetPreconditioner(m, &Cvode::prepare, &Cvode::precondition), "CVodeSetPreconditioner");
    krylov_ = true;
  }

  // --- what CVODES calls: no exception may pass through its frames -------------------------------------------------

  int evaluate(double t, const double* x, double* xdot) noexcept {
    constexpr int recoverable = 1, fatal = -1;
    try {
      ++rhs_calls_;
      elsewhere_ = false;
      if (!problem_.rhs(t, x, xdot)) {
        trouble_ = "the right-hand side cannot be evaluated";
        return recoverable;
      }
      const int bad = first_not_finite(xdot, problem_.n);
      if (bad >= 0) trouble_ = fmt::format("the rate of state {} is {}", bad, xdot[bad]);
      if (bad >= 0) return recoverable;
      if (quadrature_.nodes() == 0) add_node(t, x);
      return 0;
    } catch (...) {
      thrown_ = std::current_exception();
      return fatal;
    }
  }

  static int error_weights(N_Vector x_vector, N_Vector weights, void* self) {
    const auto* me = static_cast<Cvode*>(self);
    const double* x = N_VGetArrayPointer(x_vector);
    double* w = N_VGetArrayPointer(weights);
    for (std::size_t i = 0; i < me->group_weights_.size(); ++i)
      w[i] = me->group_weights_[i] / (me->relative_ * std::abs(x[i]) + me->problem_.absolute_tolerance[i]);
    return 0;
  }

  static int f(double t, N_Vector x, N_Vector xdot, void* self) {
    return static_cast<Cvode*>(self)->evaluate(t, N_VGetArrayPointer(x), N_VGetArrayPointer(xdot));
  }

  /// J by differences, with the increments of CVODES' own. It is here because the integrands are taken from the last evaluation
  /// of f: that of x, and not one that stepped aside for a column.
  static int jacobian(double t, N_Vector x_vector, N_Vector xdot, SUNMatrix J, void* self, N_Vector, N_Vector, N_Vector) {
    auto* me = static_cast<Cvode*>(self);
    try {
      return me->columns(t, N_VGetArrayPointer(x_vector), N_VGetArrayPointer(xdot), J);
    } catch (...) {
      me->thrown_ = std::current_exception();
      return -1;
    }
  }

  int columns(double t, double* x, const double* xdot, SUNMatrix J) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    take_rates(t, x);
    double gamma = 0.0, size = 0.0;
    CVodeGetCurrentGamma(memory_.get(), &gamma);
    CVodeGetErrWeights(memory_.get(), weights_vector_.get());
    for (int i = 0; i < n_; ++i) size += std::pow(xdot[i] * weights_[static_cast<std::size_t>(i)], 2);
    const double least = size > 0.0 ? 1000.0 * std::abs(gamma) * eps * n_ * std::sqrt(size / n_) : 1.0;
    for (int j = 0; j < n_; ++j) {
      const double here = x[j], step = std::max(std::sqrt(eps) * std::abs(here), least / weights_[static_cast<std::size_t>(j)]);
      double* column = SUNDenseMatrix_Column(J, j);
      x[j] = here + step;
      const int flag = evaluate(t, x, column);
      x[j] = here;
      if (flag != 0) return flag;
      for (int i = 0; i < n_; ++i) column[i] = (column[i] - xdot[i]) / step;
    }
    elsewhere_ = true;
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
    auto* me = static_cast<Cvode*>(self);
    double* out = N_VGetArrayPointer(J_dx);
    return me->solve_part("J v cannot be evaluated", out,
                          [&] { return me->problem_.jacobian_times(t, N_VGetArrayPointer(x), N_VGetArrayPointer(dx), out); });
  }

  static int prepare(double t, N_Vector x, N_Vector, int same_jacobian, int* moved, double gamma, void* self) {
    auto* me = static_cast<Cvode*>(self);
    *moved = !same_jacobian;
    ++me->setups_;
    return me->solve_part("the preconditioner cannot be prepared", nullptr,
                          [&] { return me->problem_.prepare(t, N_VGetArrayPointer(x), gamma, !same_jacobian); });
  }

  static int precondition(double, N_Vector, N_Vector, N_Vector r, N_Vector z, double, double, int, void* self) {
    auto* me = static_cast<Cvode*>(self);
    double* out = N_VGetArrayPointer(z);
    return me->solve_part("the preconditioner cannot be applied", out,
                          [&] { return me->problem_.precondition(N_VGetArrayPointer(r), out); });
  }

  // --- steps -------------------------------------------------------------------------------------------------------

  /// x_ becomes the state at t.
  void start_at(double t) {
    const LinearCounts linear = linear_counts();
    linear_before_.products += linear.products, linear_before_.iterations += linear.iterations;
    check(CVodeReInit(memory_.get(), t, x_vector_.get()), "CVodeReInit");
    unsolved_ = 0;
    t_internal_ = t;
  }

  StepLimit advance(double t_stop) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    if (t_stop - t_ <= 8.0 * eps * std::max(std::abs(t_), std::abs(t_stop))) {  // too close for CVODES to start
      quadrature_.begin_stretch(t_);
      start_at(t_stop);
      return StepLimit::stop;
    }
    if (problem_.project && off_manifold()) {
      x_ = x_out_;
      start_at(t_);
    }
    trouble_.clear();
    tried_ = rejected_in_step_ = false;
    worst_ = -1;
    check(CVodeSetStopTime(memory_.get(), t_stop), "CVodeSetStopTime");
    const int flag = CVode(memory_.get(), t_stop, x_vector_.get(), &t_internal_, CV_ONE_STEP);
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    if (flag == CV_ERR_FAILURE) reject_last_trial();
    if (flag < 0 && flag != CV_ERR_FAILURE) worst_ = -1;
    long unsolved = 0;
    CVodeGetNumNonlinSolvConvFails(memory_.get(), &unsolved);
    const long failed = unsolved - std::exchange(unsolved_, unsolved);
    (trouble_.empty() ? rejected_.not_converged : rejected_.not_evaluated) += failed;
    if (flag < 0) fail(flag);
    if (t_internal_ != t_stop && t_internal_ - t_ <= 8.0 * eps * std::abs(t_)) fail(CV_ERR_FAILURE);
    ++steps_;
    if (problem_.n_quadrature > 0) {
      add_node(t_internal_, x_.data());
      if (steps_ % kSampled == 0) {
        CVodeGetEstLocalErrors(memory_.get(), errors_vector_.get());
        CVodeGetErrWeights(memory_.get(), weights_vector_.get());  // those of the next step
        error_sum_ += kSampled * std::min(1.0, N_VWrmsNorm(errors_vector_.get(), weights_vector_.get()));
      }
    }
    double h = 0.0;
    CVodeGetLastStep(memory_.get(), &h);
    if (rejected_in_step_) return worst_ = blamed_, StepLimit::error;
    if (worst_ < 0 || failed > 0 || (max_step_ > 0.0 && h >= max_step_)) return StepLimit::given;
    return flag == CV_TSTOP_RETURN ? StepLimit::stop : StepLimit::error;
  }

  /// CVODES' own solver, and a look at the correction that each trial comes to: of trials that are rejected CVODES tells no errors.
  static int solve(SUNNonlinearSolver solver, N_Vector x, N_Vector correction, N_Vector weights, double tolerance, int setup,
                   void* memory) {
    void* self = nullptr;
    CVodeGetUserData(memory, &self);
    auto* me = static_cast<Cvode*>(self);
    me->reject_last_trial();
    const int flag = me->solve_(solver, x, correction, weights, tolerance, setup, memory);
    if (flag != SUN_NLS_SUCCESS) return flag;
    me->share_ = Eigen::Map<const Eigen::ArrayXd>(N_VGetArrayPointer(correction), me->n_) *
                 Eigen::Map<const Eigen::ArrayXd>(N_VGetArrayPointer(weights), me->n_);
    me->worst_ = me->problem_.n > 0 ? largest_of(me->share_.data(), me->n_) : -1;
    me->tried_ = true;
    return flag;
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

  /// Whether the fixed-point iteration has failed in a tenth of the steps since the last look: it converges while h times the
  /// largest eigenvalue is about 1 at most.
  bool stiff() {
    const long failed = rejected_.not_converged + rejected_.not_evaluated;
    return failed - std::exchange(unconverged_, failed) > kStiffness / 10;
  }

  [[noreturn]] void fail(int flag) const {
    double h = 0.0;
    int order = 0;
    CVodeGetCurrentStep(memory_.get(), &h);
    CVodeGetCurrentOrder(memory_.get(), &order);
    const bool too_small = flag == CV_ERR_FAILURE || flag == CV_CONV_FAILURE;
    const char* unsolved = krylov_ ? "Newton's equations cannot be solved" : "the Newton matrix is singular";
    std::string what = flag == CV_ERR_FAILURE    ? "the error stays above the tolerance"
                       : flag == CV_CONV_FAILURE ? "the corrector iteration does not converge"
                       : flag == CV_TOO_MUCH_ACC ? "the tolerances ask for more digits than a double has"
                       : flag == CV_LSETUP_FAIL  ? "the Jacobian cannot be evaluated"
                       : flag == CV_LSOLVE_FAIL  ? unsolved
                                                 : fmt::format("CVODES returned {}", flag);
    if (!trouble_.empty()) what = trouble_;
    fail_integration(too_small ? Code::step_too_small : Code::integrator_failed, t_,
                     fmt::format("{}; {}, order {}, step = {:.3g} s", what, name_, order, h),
                     "a discontinuity that is no event, a singularity, or tolerances that do not fit");
  }

  /// Projected copy of the state inside the last internal step; the history keeps what CVODES computed.
  const double* state_at(double t) {
    if (t == t_internal_)
      x_out_ = x_;
    else
      check(CVodeGetDky(memory_.get(), t, 0, x_out_vector_.get()), "CVodeGetDky");
    if (problem_.project) problem_.project(t, x_out_.data());
    return x_out_.data();
  }

  struct LinearCounts {
    long products = 0, iterations = 0;
  };
  /// Of the Krylov solver since the last start.
  LinearCounts linear_counts() const {
    LinearCounts c;
    if (!krylov_) return c;
    CVodeGetNumJtimesEvals(memory_.get(), &c.products);
    CVodeGetNumLinIters(memory_.get(), &c.iterations);
    return c;
  }

  OdeProblem problem_;
  std::string name_;
  EventFinder events_;
  Owned<SUNContext, free_context> context_;  // outlives everything made in it
  int n_;
  std::vector<double> x_, x_out_;
  NodeQuadrature quadrature_;
  std::vector<double> rates_;          // of the integrals
  std::vector<double> group_weights_;  // empty: one group
  double relative_ = 0.0;
  std::vector<double> weights_, errors_;  // of the last step, as CVODES has them
  Vector x_vector_, x_out_vector_, weights_vector_, errors_vector_;
  Owned<SUNMatrix, SUNMatDestroy> matrix_;
  Owned<SUNLinearSolver, SUNLinSolFree> linear_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFree> nonlinear_;
  decltype(std::declval<SUNNonlinearSolver>()->ops->solve) solve_ = nullptr;  // as CVODES have it
  std::unique_ptr<void, Freed<free_memory>> memory_;
  double t_ = 0.0, t_internal_ = 0.0;  // [s] reported to the caller; reached by CVODES, >= t_
  bool krylov_ = false, explicit_ = false;
  bool elsewhere_ = false;  // the last evaluation of f was that of a column of J
  double error_sum_ = 0.0;
  LinearCounts linear_before_;
  static constexpr int kSampled = 4;        // steps to each whose error is looked at
  static constexpr long kStiffness = 1000;  // steps between two looks
  long unconverged_ = 0, integrand_calls_ = 0;
  long steps_ = 0, rhs_calls_ = 0, restarts_ = 0, setups_ = 0;
  Rejections rejected_;
  long unsolved_ = 0;                              // trials of CVODES since the last start that are counted
  bool tried_ = false, rejected_in_step_ = false;  // a trial was solved, and not yet rejected; one was
  Eigen::ArrayXd share_;                           // of each state in the correction of the last trial
  int worst_ = -1, blamed_ = -1;                   // the largest of them; of a trial that was rejected
  double max_step_ = 0.0;                          // [s] 0 = none
  std::string trouble_;                            // why the right-hand side was refused last
  std::exception_ptr thrown_;
};

}  // namespace

std::unique_ptr<Integrator> make_cvode(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Cvode>(std::move(problem), options);
}

}  // namespace cardan
