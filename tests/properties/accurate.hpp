#pragma once
// Options by which a simulation is compared with closed forms and derivatives.
#include "core/sim/newton_operators.hpp"
#include "core/sim/simulation.hpp"
#include "core/soa/tangent.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {

inline SimulationOptions accurate(const std::string& method = "dopri5", double relative = 1e-12) {
  SimulationOptions o;
  o.integrator.method = method;
  o.integrator.relative_tolerance = relative;
  return o;
}

inline SimulationOptions krylov() {
  SimulationOptions options;
  options.integrator.method = "cvode_bdf";
  options.integrator.linear_solver = "krylov";
  options.ledger = false;
  return options;
}

/// J dx against differences of eighth order of the right-hand side.
inline double jacobian_error(const std::shared_ptr<const Model>& model) {
  Simulation sim(model, krylov());
  const OdeProblem ode = sim.ode();
  if (ode.n == 0) return 0.0;
  VectorXd x(ode.n), d(ode.n), got(ode.n), truth(ode.n), work(ode.n);
  x << sim.state().q, sim.state().v, sim.state().z;
  for (int i = 0; i < ode.n; ++i) d[i] = std::sin(2.7 * i + 0.3);
  d.tail(sim.state().z.size()) *= 0.02;  // bristles bend by hundredths
  if (!ode.rhs(0.2, x.data(), work.data()) || !ode.jacobian_times(0.2, x.data(), d.data(), got.data())) return HUGE_VAL;
  return by_differences(0.002, [&](double step) {
    bool good = true;
    soa::derivative(
        [&](double h, double* out) {
          const VectorXd at = x + h * d;
          good = good && ode.rhs(0.2, at.data(), out);
        },
        step, ode.n, truth.data(), work.data());
    return good ? apart(got, truth) : HUGE_VAL;
  });
}
inline double jacobian_error(const SystemSpec& spec) { return jacobian_error(compiled(spec)); }

}  // namespace cardan::test
