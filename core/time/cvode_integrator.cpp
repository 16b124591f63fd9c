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

#include <algorithm>
#include <exception>
#include <limits>
#include <stdexcept>
#include <utility>

#include "core/time/event_finder.hpp"
#include "core/time/methods.hpp"

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
        y_(static_cast<std::size_t>(problem_.n_quadrature)),
        scratch_(x_) {
    const bool stiff = options.method == "cvode_bdf";
    x_vector_ = wrap(x_);
    x_out_vector_ = wrap(x_out_);
    memory_.reset(CVodeCreate(stiff ? CV_BDF : CV_ADAMS, context_.get()));
    void* m = memory_.get();
    check(CVodeSetErrHandlerFn(
              m, [](int, const char*, const char*, char*, void*) {}, nullptr),
          "CVodeSetErrHandlerFn");
    check(CVodeInit(m, &Cvode::f, 0.0, x_vector_.get()), "CVodeInit");
    check(CVodeSetUserData(m, this), "CVodeSetUserData");
    std::vector<double> absolute = problem_.absolute_tolerance;
    absolute.resize(x_.size(), 1.0);
    check(CVodeSVtolerances(m, options.relative_tolerance, wrap(absolute).get()), "CVodeSVtolerances");  // copied
    check(CVodeSetMaxStep(m, options.max_step), "CVodeSetMaxStep");
    check(CVodeSetInitStep(m, options.initial_step), "CVodeSetInitStep");
    if (problem_.n_quadrature > 0) {
      y_vector_ = wrap(y_);
      check(CVodeQuadInit(m, &Cvode::g, y_vector_.get()), "CVodeQuadInit");
      // Under error control: the low orders after a start would leave residues in the balances.
      check(CVodeQuadSStolerances(m, options.relative_tolerance, options.relative_tolerance), "CVodeQuadSStolerances");
      check(CVodeSetQuadErrCon(m, SUNTRUE), "CVodeSetQuadErrCon");
    }
    // Orders 3 to 5 are unstable for modes with little damping.
    if (stiff) check(CVodeSetStabLimDet(m, SUNTRUE), "CVodeSetStabLimDet");
    if (stiff && options.linear_solver == "krylov" && problem_.n > 0) {
      use_krylov();
    } else if (stiff) {
      matrix_.reset(SUNDenseMatrix(n_, n_, context_.get()));
      linear_.reset(SUNLinSol_Dense(x_vector_.get(), matrix_.get(), context_.get()));
      check(CVodeSetLinearSolver(m, linear_.get(), matrix_.get()), "CVodeSetLinearSolver");
    } else {
      fixed_point_.reset(SUNNonlinSol_FixedPoint(x_vector_.get(), 0, context_.get()));
      check(CVodeSetNonlinearSolver(m, fixed_point_.get()), "CVodeSetNonlinearSolver");
    }
  }

  void restart(double t, const double* x, const double* y) override {
    std::copy_n(x, problem_.n, x_.begin());
    std::copy_n(y, problem_.n_quadrature, y_.begin());
    t_ = t;
    start_at(t);
    if (problem_.n_roots > 0) events_.restart(t, x_.data());
    ++restarts_;
  }

  StepReport step(double t_stop, double* x, double* y) override {
    StepReport report;
    report.t = t_;
    if (t_ < t_stop) {
      if (t_ == t_internal_) advance(t_stop);  // else an event ended the last step inside of CVODES' own
      report.t = std::min(t_internal_, t_stop);
      if (problem_.n_roots > 0) {
        report.event = events_.find(report.t, [this](double t) { return state_at(t); });
        if (report.event) report.crossed = events_.crossed();
      }
      t_ = report.t;
    }
    write(t_, x, y);
    return report;
  }

  void interpolate(double t, double* x, double* y) override { write(t, x, y); }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s;
    s.steps = steps_;
    s.rhs_calls = rhs_calls_;
    s.rejected = rejected_before_ + rejected();
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

  std::string_view name() const override { return name_; }

 private:
  Vector wrap(std::vector<double>& v) {
    return Vector(N_VMake_Serial(static_cast<sunindextype>(v.size()), v.data(), context_.get()));
  }

  /// GMRES, preconditioned from the left.
  void use_krylov() {
    constexpr int kSubspace = 10;  // products before CVODES asks for a new preconditioner, or a smaller step
    void* m = memory_.get();
    const bool preconditioned = static_cast<bool>(problem_.prepare);
    linear_.reset(
        SUNLinSol_SPGMR(x_vector_.get(), preconditioned ? SUN_PREC_LEFT : SUN_PREC_NONE, kSubspace, context_.get()));
    check(CVodeSetLinearSolver(m, linear_.get(), nullptr), "CVodeSetLinearSolver");
    if (problem_.jacobian_times) check(CVodeSetJacTimes(m, nullptr, &Cvode::jacobian_times), "CVodeSetJacTimes");
    if (preconditioned)
      check(CVodeSetPreconditioner(m, &Cvode::prepare, &Cvode::precondition), "CVodeSetPreconditioner");
    krylov_ = true;
  }

  // --- what CVODES calls: no exception may pass through its frames -------------------------------------------------

  int evaluate(double t, const double* x, double* xdot, double* ydot) noexcept {
    constexpr int recoverable = 1, fatal = -1;
    try {
      ++rhs_calls_;
      if (!problem_.rhs(t, x, xdot, ydot)) {
        trouble_ = "the right-hand side cannot be evaluated";
        return recoverable;
      }
      int bad = first_not_finite(xdot, problem_.n);
      if (bad >= 0) trouble_ = fmt::format("the rate of state {} is {}", bad, xdot[bad]);
      if (bad < 0 && ydot != nullptr) {
        bad = first_not_finite(ydot, problem_.n_quadrature);
        if (bad >= 0) trouble_ = fmt::format("the rate of integral {} is {}", bad, ydot[bad]);
      }
      return bad < 0 ? 0 : recoverable;
    } catch (...) {
      thrown_ = std::current_exception();
      return fatal;
    }
  }

  static int f(double t, N_Vector x, N_Vector xdot, void* self) {
    return static_cast<Cvode*>(self)->evaluate(t, N_VGetArrayPointer(x), N_VGetArrayPointer(xdot), nullptr);
  }

  static int g(double t, N_Vector x, N_Vector ydot, void* self) {
    auto* me = static_cast<Cvode*>(self);
    return me->evaluate(t, N_VGetArrayPointer(x), me->scratch_.data(), N_VGetArrayPointer(ydot));
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
    return me->solve_part("J v cannot be evaluated", out, [&] {
      return me->problem_.jacobian_times(t, N_VGetArrayPointer(x), N_VGetArrayPointer(dx), out);
    });
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

  /// x_ and y_ become the state at t.
  void start_at(double t) {
    rejected_before_ += rejected();
    const LinearCounts linear = linear_counts();
    linear_before_.products += linear.products, linear_before_.iterations += linear.iterations;
    check(CVodeReInit(memory_.get(), t, x_vector_.get()), "CVodeReInit");
    if (y_vector_) check(CVodeQuadReInit(memory_.get(), y_vector_.get()), "CVodeQuadReInit");
    t_internal_ = t;
    stepped_ = false;
  }

  void advance(double t_stop) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    if (t_stop - t_ <= 8.0 * eps * std::max(std::abs(t_), std::abs(t_stop))) {  // too close for CVODES to start
      integrals_at(t_);
      return start_at(t_stop);
    }
    trouble_.clear();
    check(CVodeSetStopTime(memory_.get(), t_stop), "CVodeSetStopTime");
    const int flag = CVode(memory_.get(), t_stop, x_vector_.get(), &t_internal_, CV_ONE_STEP);
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    if (flag < 0) fail(flag);
    if (t_internal_ != t_stop && t_internal_ - t_ <= 8.0 * eps * std::abs(t_)) fail(CV_ERR_FAILURE);
    stepped_ = true;
    ++steps_;
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
    if (problem_.project) problem_.project(x_out_.data());
    return x_out_.data();
  }

  void integrals_at(double t) {
    if (y_vector_ && stepped_) check(CVodeGetQuadDky(memory_.get(), t, 0, y_vector_.get()), "CVodeGetQuadDky");
  }

  void write(double t, double* x, double* y) {
    std::copy_n(state_at(t), problem_.n, x);
    integrals_at(t);
    std::copy_n(y_.data(), problem_.n_quadrature, y);
  }

  long rejected() const {
    long error_tests = 0, convergence = 0;
    CVodeGetNumErrTestFails(memory_.get(), &error_tests);
    CVodeGetNumNonlinSolvConvFails(memory_.get(), &convergence);
    return error_tests + convergence;
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
  std::vector<double> x_, x_out_, y_, scratch_;
  Vector x_vector_, x_out_vector_, y_vector_;
  Owned<SUNMatrix, SUNMatDestroy> matrix_;
  Owned<SUNLinearSolver, SUNLinSolFree> linear_;
  Owned<SUNNonlinearSolver, SUNNonlinSolFree> fixed_point_;
  std::unique_ptr<void, Freed<free_memory>> memory_;
  double t_ = 0.0, t_internal_ = 0.0;  // [s] reported to the caller; reached by CVODES, >= t_
  bool stepped_ = false;               // since the last start
  bool krylov_ = false;
  LinearCounts linear_before_;
  long steps_ = 0, rhs_calls_ = 0, restarts_ = 0, rejected_before_ = 0, setups_ = 0;
  std::string trouble_;  // why the right-hand side was refused last
  std::exception_ptr thrown_;
};

}  // namespace

std::unique_ptr<Integrator> make_cvode(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Cvode>(std::move(problem), options);
}

}  // namespace cardan
