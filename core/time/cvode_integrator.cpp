// SUNDIALS CVODES (Hindmarsh et al. 2005): variable-order Adams with fixed-point iteration, BDF with Newton.
#include <cvodes/cvodes.h>

#include "core/time/node_quadrature.hpp"
#include "core/time/sundials.hpp"

namespace cardan {
namespace {

struct Cvodes {
  static constexpr const char* name = "CVODES";
  static constexpr bool multistep = true;
  using Quadrature = NodeQuadrature;

  static NodeQuadrature quadrature(const std::string&, int n) { return NodeQuadrature(n); }

  static sundials::Solution solution(const std::string& method) {
    return {.newton = method == "cvode_bdf", .fixed_point = method == "cvode_adams"};
  }
  static void* create(const std::string& method, const sundials::Rates& f, N_Vector x, SUNContext context) {
    const bool stiff = solution(method).newton;
    void* m = CVodeCreate(stiff ? CV_BDF : CV_ADAMS, context);
    sundials::check(CVodeInit(m, f.all, 0.0, x), "CVodeInit");
    // Orders 3 to 5 are unstable for modes with little damping.
    if (stiff) sundials::check(CVodeSetStabLimDet(m, SUNTRUE), "CVodeSetStabLimDet");
    return m;
  }
  static int restart(void* m, const std::string&, const sundials::Rates&, double t, N_Vector x) { return CVodeReInit(m, t, x); }
  static int step(void* m, double t_stop, N_Vector x, double* t) { return CVode(m, t_stop, x, t, CV_ONE_STEP); }
  static int dense_output(void* m, double t, N_Vector x) { return CVodeGetDky(m, t, 0, x); }
  static int slope(void* m, double t, N_Vector xdot) { return CVodeGetDky(m, t, 1, xdot); }
  static int error_failures(void* m, long* n) { return CVodeGetNumErrTestFails(m, n); }
  static int last_order(void* m, const std::string&) {
    int order = 0;
    CVodeGetLastOrder(m, &order);
    return order;
  }
  /// Of the estimate of the error, over that of the rates, a step long, for rates that are off by white noise. Of Adams and Moulton C_q
  /// times their difference of order q, whose weights are binomial, C_q by the recurrence of Hairer, Norsett, Wanner 1993, III.1. Of the
  /// differentiation formulas 1 / (q + 1) times the root mean square, over all w, of d^(q+1) / (d + d^2 / 2 + ... + d^q / q), d = 1 - e^(-i
  /// w).
  static double noise(void* m, const std::string& method) {
    constexpr std::array<double, 6> kOfDifferentiation = {0.0, 0.71, 0.44, 0.40, 0.41, 0.46};
    constexpr int kMost = 12;
    const int q = std::clamp(last_order(m, method), 1, kMost);
    if (solution(method).newton) return kOfDifferentiation[static_cast<std::size_t>(std::min(q, 5))];
    std::array<double, kMost + 1> adams{1.0};
    for (int j = 1; j <= q; ++j)
      for (int k = 0; k < j; ++k) adams[static_cast<std::size_t>(j)] -= adams[static_cast<std::size_t>(k)] / (j - k + 1);
    double binomial = 1.0;  // of 2 q over q
    for (int i = 1; i <= q; ++i) binomial *= static_cast<double>(q + i) / i;
    return std::abs(adams[static_cast<std::size_t>(q)]) * std::sqrt(binomial);
  }
  static int current_order(void* m, const std::string&) {
    int order = 0;
    CVodeGetCurrentOrder(m, &order);
    return order;
  }
  static void free(void* m) { CVodeFree(&m); }
  static constexpr auto set_error_handler = CVodeSetErrHandlerFn;
  static constexpr auto set_user_data = CVodeSetUserData;
  static constexpr auto set_tolerances = CVodeSVtolerances;
  static constexpr auto set_weights = CVodeWFtolerances;
  static constexpr auto set_max_step = CVodeSetMaxStep;
  static constexpr auto set_initial_step = CVodeSetInitStep;
  static constexpr auto set_stop_time = CVodeSetStopTime;
  static constexpr auto set_nonlinear_solver = CVodeSetNonlinearSolver;
  static constexpr auto set_linear_solver = CVodeSetLinearSolver;
  static constexpr auto set_jacobian = CVodeSetJacFn;
  static constexpr auto set_jacobian_times = CVodeSetJacTimes;
  static constexpr auto set_preconditioner = CVodeSetPreconditioner;
  static constexpr auto user_data = CVodeGetUserData;
  static constexpr auto gamma = CVodeGetCurrentGamma;
  static constexpr auto weights = CVodeGetErrWeights;
  static constexpr auto local_errors = CVodeGetEstLocalErrors;
  static constexpr auto unsolved = CVodeGetNumNonlinSolvConvFails;
  static constexpr auto last_step = CVodeGetLastStep;
  static constexpr auto current_step = CVodeGetCurrentStep;
  static constexpr auto jacobian_products = CVodeGetNumJtimesEvals;
  static constexpr auto linear_iterations = CVodeGetNumLinIters;
};

}  // namespace

std::unique_ptr<Integrator> make_cvode(OdeProblem problem, const IntegratorOptions& options) {
  return std::make_unique<sundials::Sundials<Cvodes>>(std::move(problem), options);
}

}  // namespace cardan
