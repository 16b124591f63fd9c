#pragma once
// The methods behind make_integrator(), and how each of them fails. Options have been checked by the factory.
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
/// cvode_adams or cvode_bdf.
std::unique_ptr<Integrator> make_cvode(OdeProblem problem, const IntegratorOptions& options);

[[noreturn]] inline void fail_integration(Code code, double t, std::string what, std::string hint) {
  RunFailure failure{};
  failure.code = code;
  failure.t = t;
  failure.what = std::move(what);
  failure.hint = std::move(hint);
  throw NumericsError(std::move(failure));
}

}  // namespace cardan
