#pragma once
// The methods behind make_integrator(), and how each of them fails. Options have been checked by the factory.
#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/diagnostic.hpp"
#include "core/base/finite.hpp"
#include "core/time/integrator.hpp"

namespace cardan {

std::unique_ptr<Integrator> make_rk4(OdeProblem problem, const IntegratorOptions& options);
std::unique_ptr<Integrator> make_dop853(OdeProblem problem, const IntegratorOptions& options);
std::unique_ptr<Integrator> make_dopri5(OdeProblem problem, const IntegratorOptions& options);
/// Needs OdeProblem::linear.
std::unique_ptr<Integrator> make_exponential(OdeProblem problem, const IntegratorOptions& options);
/// Steps of IntegratorOptions::give_way_to the first time; twice as many each time, up to kLongestExplicitSteps.
inline constexpr long kExplicitSteps = 2000, kLongestExplicitSteps = 64'000;
/// Needs OdeProblem::linear.
std::unique_ptr<Integrator> make_alternating(OdeProblem problem, const IntegratorOptions& options);
/// Needs OdeProblem::linear.
std::unique_ptr<Integrator> make_multirate(OdeProblem problem, const IntegratorOptions& options);
/// Needs OdeProblem::extended.
std::unique_ptr<Integrator> make_extended(OdeProblem problem, const IntegratorOptions& options);
/// Needs OdeProblem::momenta. variational or variational4.
std::unique_ptr<Integrator> make_variational(OdeProblem problem, const IntegratorOptions& options);
/// Needs OdeProblem::implicit.
std::unique_ptr<Integrator> make_ida(OdeProblem problem, const IntegratorOptions& options);
/// ark_explicit, ark_imex or ark_implicit.
std::unique_ptr<Integrator> make_arkode(OdeProblem problem, const IntegratorOptions& options);
/// cvode_adams or cvode_bdf.
std::unique_ptr<Integrator> make_cvode(OdeProblem problem, const IntegratorOptions& options);

/// One more trial whose error was too large, most of it that of the state `worst`; -1: it could not be evaluated.
inline void count_rejection(Rejections& rejected, const OdeProblem& problem, int worst) {
  if (worst < 0) return void(++rejected.not_evaluated);
  const int group = problem.group.empty() ? 0 : problem.group[static_cast<std::size_t>(worst)];
  ++rejected.by_error[static_cast<std::size_t>(std::min(group, Rejections::kGroups - 1))];
}

/// The place of the largest magnitude of n numbers; -1: all are zero, or one is not a number.
inline int largest_of(const double* x, int n) {
  int at = -1;
  double largest = 0.0;
  for (int i = 0; i < n; ++i) {
    const double size = std::abs(x[i]);
    if (!(size >= 0.0)) return -1;
    if (size > largest) largest = size, at = i;
  }
  return at;
}

[[noreturn]] inline void fail_integration(Code code, double t, std::string what, std::string hint) {
  RunFailure failure{};
  failure.code = code;
  failure.t = t;
  failure.what = std::move(what);
  failure.hint = std::move(hint);
  throw NumericsError(std::move(failure));
}

}  // namespace cardan
