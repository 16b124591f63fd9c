// SUNDIALS ARKODE (Reynolds, Gardner, Woodward, Chinomona 2023): Runge-Kutta methods of one step. Explicit: Verner 6(5). Implicit: ESDIRK
// 5(4) of eight stages, L-stable (Kennedy, Carpenter 2019), by Newton. Both together (imex): that one for f's linear part at
// some state, its explicit partner for the rest of f. What they know of the past is the length of the next step, which a
// restart keeps.
#include <arkode/arkode_arkstep.h>
#include <cmath>

#include "core/time/stage_quadrature.hpp"
#include "core/time/sundials.hpp"

namespace cardan {
namespace {

constexpr auto kExplicit = ARKODE_VERNER_8_5_6;
constexpr double kNewtonLeaves = 1e-2;  // of the tolerance, at a stage
constexpr auto kImplicit = ARKODE_ARK548L2SAb_DIRK_8_4_5;
constexpr auto kRest = ARKODE_ARK548L2SAb_ERK_8_4_5;  // beside it

struct Arkode {
  static constexpr const char* name = "ARKODE";
  static constexpr bool multistep = false;
  using Quadrature = StageQuadrature;

  static StageQuadrature quadrature(const std::string& method, int n) {
    const auto table = solution(method).newton ? ARKodeButcherTable_LoadDIRK(kImplicit) : ARKodeButcherTable_LoadERK(kExplicit);
    const std::unique_ptr<std::remove_pointer_t<ARKodeButcherTable>, sundials::Freed<ARKodeButcherTable_Free>> owned(table);
    if (!owned) throw std::runtime_error("SUNDIALS: no Butcher table");
    return {n, {table->b, table->b + table->stages}, {table->c, table->c + table->stages}, current_order(nullptr, method)};
  }

  static sundials::Solution solution(const std::string& method) {
    return {.newton = method != "ark_explicit", .split = method == "ark_imex"};
  }
  static void* create(const std::string& method, const sundials::Rates& f, N_Vector x, SUNContext context) {
    const bool implicit = solution(method).newton;
    void* m = ARKStepCreate(explicit_part(method, f), implicit_part(method, f), 0.0, x, context);
    if (m == nullptr) throw std::runtime_error("SUNDIALS: ARKStepCreate failed");
    sundials::check(ARKStepSetTableNum(m, implicit ? kImplicit : ARKODE_DIRK_NONE,
                                       solution(method).split ? kRest
                                       : implicit             ? ARKODE_ERK_NONE
                                                              : kExplicit),
                    "ARKStepSetTableNum");
    // The rate at a stage from its equation: f would multiply what Newton's iteration leaves by the stiffness.
    if (implicit) sundials::check(ARKStepSetDeduceImplicitRhs(m, SUNTRUE), "ARKStepSetDeduceImplicitRhs");
    // Of the tolerance: weights of 2, divided by a diagonal of 0.2, make more of it.
    if (implicit) sundials::check(ARKStepSetNonlinConvCoef(m, kNewtonLeaves), "ARKStepSetNonlinConvCoef");
    if (solution(method).split) sundials::check(ARKStepSetLinear(m, 0), "ARKStepSetLinear");
    sundials::check(ARKStepSetMaxErrTestFails(m, 40), "ARKStepSetMaxErrTestFails");  // the step kept over a restart may be far too long
    sundials::check(ARKStepSetMaxConvFails(m, 30), "ARKStepSetMaxConvFails");        // up to a state that cannot be evaluated, by quarters
    // Theirs is evaluated at each stop time; that of degree 3 needs no more of f.
    sundials::check(ARKStepSetInterpolantDegree(m, 3), "ARKStepSetInterpolantDegree");
    return m;
  }
  static int restart(void* m, const std::string& method, const sundials::Rates& f, double t, N_Vector x) {
    return ARKStepReInit(m, explicit_part(method, f), implicit_part(method, f), t, x);
  }
  static ARKRhsFn explicit_part(const std::string& method, const sundials::Rates& f) {
    return solution(method).split ? f.rest : solution(method).newton ? nullptr : f.all;
  }
  static ARKRhsFn implicit_part(const std::string& method, const sundials::Rates& f) {
    return solution(method).split ? f.linear : solution(method).newton ? f.all : nullptr;
  }
  static int step(void* m, double t_stop, N_Vector x, double* t) { return ARKStepEvolve(m, t_stop, x, t, ARK_ONE_STEP); }
  static int error_failures(void* m, long* n) { return ARKStepGetNumErrTestFails(m, n); }
  static int last_order(void*, const std::string& method) { return current_order(nullptr, method); }
  /// Of the tolerance, in a step: what Newton's iteration leaves of its stages is no part of the estimated error. It is in the rates that
  /// are taken from the stages' equations, over the diagonal. A linear f_I leaves nothing.
  static double left_by_newton(const std::string& method) {
    return solution(method).newton && !solution(method).split ? kNewtonLeaves * weights_over_diagonal() : 0.0;
  }
  static double weights_over_diagonal() {
    static const double sum = [] {
      const std::unique_ptr<ARKodeButcherTableMem, sundials::Freed<ARKodeButcherTable_Free>> table(ARKodeButcherTable_LoadDIRK(kImplicit));
      double over = 0.0;
      for (int i = 0; table && i < table->stages; ++i)
        if (table->A[i][i] != 0.0) over += std::abs(table->b[i]) / table->A[i][i];
      return over;
    }();
    return sum;
  }
  /// Of the estimate of the error, over that of the rates, a step long: b - d of the stages.
  static double noise(void* m, const std::string&) {
    ARKodeButcherTable implicit = nullptr, by = nullptr;
    sundials::check(ARKStepGetCurrentButcherTables(m, &implicit, &by), "ARKStepGetCurrentButcherTables");
    if (!by) by = implicit;
    double squares = 0.0;
    for (int i = 0; by && i < by->stages; ++i) squares += (by->b[i] - by->d[i]) * (by->b[i] - by->d[i]);
    return std::sqrt(squares);
  }
  static int current_order(void*, const std::string& method) { return solution(method).newton ? 5 : 6; }
  static void free(void* m) { ARKStepFree(&m); }
  static constexpr auto set_error_handler = ARKStepSetErrHandlerFn;
  static constexpr auto set_user_data = ARKStepSetUserData;
  static constexpr auto set_tolerances = ARKStepSVtolerances;
  static constexpr auto set_weights = ARKStepWFtolerances;
  static constexpr auto set_max_step = ARKStepSetMaxStep;
  static constexpr auto set_initial_step = ARKStepSetInitStep;
  static constexpr auto set_stop_time = ARKStepSetStopTime;
  static constexpr auto set_nonlinear_solver = ARKStepSetNonlinearSolver;
  static constexpr auto set_linear_solver = ARKStepSetLinearSolver;
  static constexpr auto set_jacobian = ARKStepSetJacFn;
  static constexpr auto set_jacobian_times = ARKStepSetJacTimes;
  static constexpr auto set_preconditioner = ARKStepSetPreconditioner;
  static constexpr auto stage_time = ARKStepGetCurrentTime;
  static constexpr auto user_data = ARKStepGetUserData;
  static constexpr auto gamma = ARKStepGetCurrentGamma;
  static constexpr auto weights = ARKStepGetErrWeights;
  static constexpr auto local_errors = ARKStepGetEstLocalErrors;
  static constexpr auto unsolved = ARKStepGetNumNonlinSolvConvFails;
  static constexpr auto last_step = ARKStepGetLastStep;
  static constexpr auto current_step = ARKStepGetCurrentStep;
  static constexpr auto jacobian_products = ARKStepGetNumJtimesEvals;
  static constexpr auto linear_iterations = ARKStepGetNumLinIters;
};

}  // namespace

std::unique_ptr<Integrator> make_arkode(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<sundials::Sundials<Arkode>>(std::move(problem), options);
}

}  // namespace cardan
