// SUNDIALS IDA (Hindmarsh et al. 2005): BDF of variable order and step for F(t, y, y') = 0, Newton's matrix by grouped differences (Curtis,
// Powell & Reid 1974) and sparse.
#include <ida/ida.h>

#include "core/linalg/sparse_lu.hpp"
#include "core/time/node_quadrature.hpp"
#include "core/time/sundials.hpp"

namespace cardan {
namespace {

using sundials::check;
using sundials::Owned;
using sundials::Vector;

/// SparseLu as one of their linear solvers. Their matrix has its pattern.
struct SparseSolver {
  SparseLu lu;
  Eigen::SparseMatrix<double> matrix;
  Eigen::VectorXd b, x;
  bool known = false;

  static SUNLinearSolver_Type type(SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; }
  static int setup(SUNLinearSolver solver, SUNMatrix A) {
    auto& me = *static_cast<SparseSolver*>(solver->content);
    std::copy_n(SUNSparseMatrix_Data(A), me.matrix.nonZeros(), me.matrix.valuePtr());
    return (me.known = me.lu.factor(me.matrix)) ? SUNLS_SUCCESS : SUNLS_LUFACT_FAIL;
  }
  static int solve(SUNLinearSolver solver, SUNMatrix, N_Vector x, N_Vector b, double) {
    auto& me = *static_cast<SparseSolver*>(solver->content);
    if (!me.known) return SUNLS_PACKAGE_FAIL_UNREC;
    me.b = Eigen::Map<const Eigen::VectorXd>(N_VGetArrayPointer(b), me.matrix.cols());
    me.lu.solve(me.b, me.x);
    std::copy_n(me.x.data(), me.x.size(), N_VGetArrayPointer(x));
    return me.x.allFinite() ? SUNLS_SUCCESS : SUNLS_PACKAGE_FAIL_REC;
  }
  static int free(SUNLinearSolver solver) {
    solver->content = nullptr;  // it is a member of who made it
    SUNLinSolFreeEmpty(solver);
    return SUNLS_SUCCESS;
  }
  SUNLinearSolver wrapped(SUNContext context) {
    SUNLinearSolver solver = SUNLinSolNewEmpty(context);
    solver->ops->gettype = type, solver->ops->setup = setup, solver->ops->solve = solve, solver->ops->free = free;
    solver->content = this;
    return solver;
  }
};

void free_memory(void* m) { IDAFree(&m); }

class Ida final : public Integrator {
 public:
  Ida(OdeProblem problem, const IntegratorOptions& options)
      : problem_(std::move(problem)),
        form_(*problem_.implicit),
        relative_(options.relative_tolerance),
        initial_step_(options.initial_step),
        events_(problem_),
        nodes_(problem_.n_quadrature),
        context_(sundials::make_context()),
        n_(form_.size()) {
    for (std::vector<double>* y : {&y_, &ydot_, &within_, &errors_, &weights_, &F_, &beside_, &beside_rate_, &step_})
      y->assign(at(n_), 0.0);
    for (std::vector<double>* x : {&x_, &rate_, &part_}) x->assign(at(problem_.n), 0.0);
    integrand_.assign(at(problem_.n_quadrature), 0.0);
    y_vector_ = wrap(y_), ydot_vector_ = wrap(ydot_), within_vector_ = wrap(within_);
    errors_vector_ = wrap(errors_), weights_vector_ = wrap(weights_);
    prepare_matrix();
    memory_.reset(IDACreate(context_.get()));
    void* m = memory_.get();
    check(IDASetErrHandlerFn(
              m, [](int, const char*, const char*, char*, void*) {}, nullptr),
          "IDASetErrHandlerFn");
    check(IDAInit(m, &Ida::residual, 0.0, y_vector_.get(), ydot_vector_.get()), "IDAInit");
    check(IDASetUserData(m, this), "IDASetUserData");
    check(IDAWFtolerances(m, &Ida::error_weights), "IDAWFtolerances");
    check(IDASetMaxStep(m, options.max_step), "IDASetMaxStep");
    check(IDASetLinearSolver(m, linear_.get(), matrix_.get()), "IDASetLinearSolver");
    check(IDASetJacFn(m, &Ida::jacobian), "IDASetJacFn");
  }

  void restart(double t, const double* x) override {
    nodes_.begin_stretch(t_);
    t_ = t_internal_ = t;
    std::copy_n(x, problem_.n, x_.begin());
    entered_ = false;
    if (problem_.n_roots > 0) events_.restart(t, x_.data());
    ++statistics_.restarts;
  }

  StepReport step(double t_stop, double* x) override {
    StepReport report;
    report.t = t_;
    if (t_ < t_stop) {
      if (t_ == t_internal_) report.limit = advance(t_stop);  // else an event ended the last step inside of theirs
      report.t = std::min(t_internal_, t_stop);
      if (problem_.n_roots > 0) {
        report.event = events_.find(report.t, [this](double t) { return state_at(t); });
        if (report.event) report.crossed = events_.crossed(), report.limit = StepLimit::stop;
      }
      if (entered_) add_node(report.t);
      t_ = report.t;
      report.order = statistics_.last_order;
    }
    interpolate(t_, x);
    return report;
  }

  void interpolate(double t, double* x) override { std::copy_n(state_at(t), problem_.n, x); }
  void integrals(double t, double* y, double* error) override { nodes_.at(t, y, error); }

  void remember(Archive& archive) override {  // what a restart keeps: its integrals and counts
    std::vector<double> y(integrand_), error(integrand_);
    nodes_.at(t_, y.data(), error.data());
    archive(std::span(y), std::span(error), statistics_, events_);
    if (archive.reading()) nodes_.begin_stretch_at(y.data(), error.data());
  }

  IntegratorStatistics statistics() const override {
    IntegratorStatistics s = statistics_;
    s.root_evaluations = events_.evaluations();
    return s;
  }
  int worst() const override { return worst_; }
  std::string_view name() const override { return "ida"; }

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  Vector wrap(std::vector<double>& v) { return Vector(N_VMake_Serial(static_cast<sunindextype>(v.size()), v.data(), context_.get())); }

  /// Columns that share no row are found by one difference.
  void prepare_matrix() {
    const auto& pattern = form_.pattern();
    std::vector<Eigen::Triplet<double>> entries;
    std::vector<std::vector<int>> in_row(at(n_));
    for (int j = 0; j < n_; ++j)
      for (const int i : pattern[at(j)]) entries.emplace_back(i, j, 1.0), in_row[at(i)].push_back(j);
    solver_.matrix.resize(n_, n_);
    solver_.matrix.setFromTriplets(entries.begin(), entries.end());
    group_.assign(at(n_), -1);
    std::vector<int> taken;  // per group: the last column that cannot be in it
    for (int j = 0; j < n_; ++j) {
      for (const int i : pattern[at(j)])
        for (const int other : in_row[at(i)])
          if (group_[at(other)] >= 0) taken[at(group_[at(other)])] = j;
      const auto found = std::ranges::find_if(taken, [j](int by) { return by != j; });
      group_[at(j)] = static_cast<int>(found - taken.begin());
      if (found == taken.end()) taken.push_back(-1);
    }
    groups_ = static_cast<int>(taken.size());
    matrix_.reset(SUNSparseMatrix(n_, n_, solver_.matrix.nonZeros(), CSC_MAT, context_.get()));
    linear_.reset(solver_.wrapped(context_.get()));
  }

  // --- what IDA calls: no exception may pass through its frames -----------------------------------------------------

  int evaluate(double t, const double* y, const double* ydot, double* F) noexcept {
    constexpr int recoverable = 1, fatal = -1;
    try {
      ++statistics_.rhs_calls;
      trouble_ = !form_.residual(t, y, ydot, F) || !all_finite(F, n_);
      return trouble_ ? recoverable : 0;
    } catch (...) {
      thrown_ = std::current_exception();
      return fatal;
    }
  }
  static int residual(double t, N_Vector y, N_Vector ydot, N_Vector F, void* self) {
    return static_cast<Ida*>(self)->evaluate(t, N_VGetArrayPointer(y), N_VGetArrayPointer(ydot), N_VGetArrayPointer(F));
  }

  static int error_weights(N_Vector y, N_Vector weights, void* self) {
    const auto* me = static_cast<Ida*>(self);
    double* w = N_VGetArrayPointer(weights);
    me->form_.tolerances(me->relative_, N_VGetArrayPointer(y), w);
    for (int i = 0; i < me->n_; ++i) w[i] = 1.0 / w[i];
    return 0;
  }

  static int jacobian(double t, double alpha, N_Vector y, N_Vector ydot, N_Vector F, SUNMatrix J, void* self, N_Vector, N_Vector,
                      N_Vector) {
    return static_cast<Ida*>(self)->columns(t, alpha, N_VGetArrayPointer(y), N_VGetArrayPointer(ydot), N_VGetArrayPointer(F), J);
  }
  /// dF/dy + alpha dF/dy'.
  int columns(double t, double alpha, const double* y, const double* ydot, const double* F, SUNMatrix J) {
    const Eigen::SparseMatrix<double>& pattern = solver_.matrix;
    std::copy_n(pattern.outerIndexPtr(), n_ + 1, SUNSparseMatrix_IndexPointers(J));
    std::copy_n(pattern.innerIndexPtr(), pattern.nonZeros(), SUNSparseMatrix_IndexValues(J));
    double* data = SUNSparseMatrix_Data(J);
    for (int g = 0; g < groups_; ++g) {
      std::copy_n(y, n_, beside_.begin());
      std::copy_n(ydot, n_, beside_rate_.begin());
      for (int j = 0; j < n_; ++j) {
        if (group_[at(j)] != g) continue;
        const double h = std::sqrt(std::numeric_limits<double>::epsilon()) * std::max(1.0, std::abs(y[j]));
        beside_[at(j)] += h;
        step_[at(j)] = beside_[at(j)] - y[j];
        beside_rate_[at(j)] += alpha * step_[at(j)];
      }
      if (const int flag = evaluate(t, beside_.data(), beside_rate_.data(), F_.data()); flag != 0) return flag;
      for (int j = 0; j < n_; ++j)
        for (int e = pattern.outerIndexPtr()[j]; group_[at(j)] == g && e < pattern.outerIndexPtr()[j + 1]; ++e) {
          const int i = pattern.innerIndexPtr()[e];
          data[e] = (F_[at(i)] - F[i]) / step_[at(j)];
        }
    }
    return 0;
  }

  // --- steps -------------------------------------------------------------------------------------------------------

  void begin() {
    if (!form_.enter(t_, x_.data(), y_.data(), ydot_.data()) || !all_finite(y_.data(), n_) || !all_finite(ydot_.data(), n_))
      fail_integration(Code::integrator_failed, t_, "the differential-algebraic system cannot be evaluated at its start",
                       "see docs/errors.md");
    check(IDAReInit(memory_.get(), t_, y_vector_.get(), ydot_vector_.get()), "IDAReInit");
    check(IDASetInitStep(memory_.get(), initial_step_), "IDASetInitStep");
    errors_failed_ = unconverged_ = 0;
    entered_ = true;
    add_node(t_internal_);
  }

  StepLimit advance(double t_stop) {
    constexpr double eps = std::numeric_limits<double>::epsilon();
    if (t_stop - t_ <= 8.0 * eps * std::max(std::abs(t_), std::abs(t_stop))) {  // too close for it to start
      nodes_.begin_stretch(t_);
      t_internal_ = t_stop;
      entered_ = false;
      return StepLimit::stop;
    }
    if (!entered_) begin();
    trouble_ = false;
    check(IDASetStopTime(memory_.get(), t_stop), "IDASetStopTime");
    // Its first steps after a start may be shorter than rounding of t: no step yet for events and integrals, which are over time.
    constexpr int kMostStanding = 16;
    int flag = IDA_SUCCESS;
    for (int i = 0; i <= kMostStanding && flag == IDA_SUCCESS && t_internal_ - t_ <= 8.0 * eps * std::abs(t_); ++i)
      flag = IDASolve(memory_.get(), t_stop, &t_internal_, y_vector_.get(), ydot_vector_.get(), IDA_ONE_STEP);
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    const bool shortened = count_rejections();
    if (flag < 0) fail(flag);
    ++statistics_.steps;
    IDAGetLastStep(memory_.get(), &statistics_.last_step);
    IDAGetLastOrder(memory_.get(), &statistics_.last_order);
    if (!form_.leave(t_internal_, y_.data(), x_.data(), true)) fail(IDA_RES_FAIL);
    if (problem_.project) problem_.project(t_internal_, x_.data());
    if (problem_.n_quadrature > 0) statistics_.error_sum += std::min(1.0, N_VWrmsNorm(errors_vector_.get(), weights_vector_.get()));
    if (shortened && worst_ >= 0) return StepLimit::error;
    if (flag == IDA_TSTOP_RETURN) return StepLimit::stop;
    return worst_ < 0 ? StepLimit::given : StepLimit::error;  // of a multiplier there is no state to tell
  }

  /// Whether the error of a trial was too large in this step.
  bool count_rejections() {
    check(IDAGetEstLocalErrors(memory_.get(), errors_vector_.get()), "IDAGetEstLocalErrors");
    check(IDAGetErrWeights(memory_.get(), weights_vector_.get()), "IDAGetErrWeights");
    for (int i = 0; i < n_; ++i) step_[at(i)] = errors_[at(i)] * weights_[at(i)];
    const int worst = largest_of(step_.data(), n_);
    worst_ = worst < 0 ? -1 : form_.state_of(worst);
    long errors = 0, unconverged = 0;
    IDAGetNumErrTestFails(memory_.get(), &errors);
    IDAGetNumNonlinSolvConvFails(memory_.get(), &unconverged);
    const long failed = errors - std::exchange(errors_failed_, errors);
    for (long i = 0; i < failed; ++i) count_rejection(statistics_.rejected, problem_, std::max(worst_, 0));
    (trouble_ ? statistics_.rejected.not_evaluated : statistics_.rejected.not_converged) +=
        unconverged - std::exchange(unconverged_, unconverged);
    return failed > 0;
  }

  /// Rates of the integrals at t: the end of a step, or an event inside of it, beyond which something else may act.
  void add_node(double t) {
    if (problem_.n_quadrature == 0) return;
    const double* x = state_at(t);
    if (!problem_.rhs(t, x, rate_.data()))
      fail_integration(Code::integrator_failed, t, "the right-hand side cannot be evaluated", "a smaller step");
    problem_.integrands(t, x, integrand_.data());
    ++statistics_.integrand_calls;
    nodes_.add(t, integrand_.data());
  }

  [[noreturn]] void fail(int flag) {
    double h = 0.0;
    int order = 0;
    IDAGetCurrentStep(memory_.get(), &h);
    IDAGetCurrentOrder(memory_.get(), &order);
    const bool too_small = flag == IDA_ERR_FAIL || flag == IDA_CONV_FAIL;
    if (flag != IDA_ERR_FAIL) worst_ = -1;
    std::string what = trouble_                   ? "the differential-algebraic system cannot be evaluated"
                       : flag == IDA_ERR_FAIL     ? "the error stays above the tolerance"
                       : flag == IDA_CONV_FAIL    ? "Newton's iteration does not converge"
                       : flag == IDA_TOO_MUCH_ACC ? "the tolerances ask for more digits than a double has"
                       : flag == IDA_LSETUP_FAIL  ? "Newton's matrix is singular"
                                                  : fmt::format("IDA returned {}", flag);
    fail_integration(too_small ? Code::step_too_small : Code::integrator_failed, t_,
                     fmt::format("{}; ida, order {}, step = {:.3g} s", what, order, h),
                     "a discontinuity that is no event, a singular posture, or tolerances that do not fit");
  }

  /// Projected copy of the state inside the last step.
  const double* state_at(double t) {
    if (!entered_ || t == t_internal_) return x_.data();
    check(IDAGetDky(memory_.get(), t, 0, within_vector_.get()), "IDAGetDky");
    if (!form_.leave(t, within_.data(), part_.data(), false)) fail(IDA_RES_FAIL);
    if (problem_.project) problem_.project(t, part_.data());
    return part_.data();
  }

  OdeProblem problem_;
  ImplicitForm& form_;
  double relative_, initial_step_;
  EventFinder events_;
  NodeQuadrature nodes_;
  Owned<SUNContext, sundials::free_context> context_;  // outlives everything made in it
  int n_, groups_ = 0;
  std::vector<double> y_, ydot_, within_, errors_, weights_, F_, beside_, beside_rate_, step_;
  std::vector<double> x_, rate_, part_, integrand_;
  Vector y_vector_, ydot_vector_, within_vector_, errors_vector_, weights_vector_;
  SparseSolver solver_;
  std::vector<int> group_;  // per column
  Owned<SUNMatrix, SUNMatDestroy> matrix_;
  Owned<SUNLinearSolver, SUNLinSolFree> linear_;
  std::unique_ptr<void, sundials::Freed<free_memory>> memory_;
  double t_ = 0.0, t_internal_ = 0.0;  // [s] reported to the caller; reached by IDA, >= t_
  bool entered_ = false;               // y_ is that of x_
  bool trouble_ = false;               // the last evaluation was refused
  int worst_ = -1;
  long errors_failed_ = 0, unconverged_ = 0;  // since the last start
  IntegratorStatistics statistics_;
  std::exception_ptr thrown_;
};

}  // namespace

std::unique_ptr<Integrator> make_ida(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<Ida>(std::move(problem), options);
}

}  // namespace cardan
