#pragma once
// The methods behind make_integrator(), and how each of them fails. Options have been checked by the factory.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
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
/// IntegratorOptions::method and its rivals.
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

// What rounding of the states does to their rates, and these to the estimate of the error of a step: where that is much of what is allowed,
// shorter steps do not make it less, and the steps are as short as rounding asks for.
/// Each state is moved by so many of its last digits, by more or less.
inline double moved_by_digits(double x, int i) {
  constexpr double kDigits = 8.0 * std::numeric_limits<double>::epsilon();
  return x * (1.0 + kDigits * (2.0 * std::fmod(0.5 + i * std::numbers::phi, 1.0) - 1.0));
}
/// Of what that changes: of a stage a third of a digit is lost, root mean square.
inline constexpr double kLostOfMoved = 0.29 / (8.0 * 1.44 / std::numbers::sqrt3);
/// Over the error that is allowed; less is not told.
inline constexpr double kMuchRounding = 0.5;

[[noreturn]] inline void fail_integration(Code code, double t, std::string what, std::string hint) {
  RunFailure failure{};
  failure.code = code;
  failure.t = t;
  failure.what = std::move(what);
  failure.hint = std::move(hint);
  throw NumericsError(std::move(failure));
}

}  // namespace cardan
