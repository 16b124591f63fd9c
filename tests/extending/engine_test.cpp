// docs/extending: the pages on the engine. Their code is compiled beside this file and does what they say.
#include <gtest/gtest.h>

#include <cmath>

#include "bodies/register.hpp"
#include "core/abi/device_laws.hpp"
#include "core/abi/field_laws.hpp"
#include "core/dynamics/forward.hpp"
#include "core/soa/program.hpp"
#include "core/time/integrator.hpp"
#include "hinges/register.hpp"

namespace cardan {
std::unique_ptr<Integrator> make_midpoint(OdeProblem problem, const IntegratorOptions& options);
const cardan_device_family& eddy_brake_family();
const cardan_field_family& turning_dipole_family();
void check_duty(double duty, const Located& at, DiagnosticSink& sink);
namespace soa {
void spin_drag_of_one_state(const SweepModel& model, Workspace<double>& ws, const Inputs<double>& in);
}

namespace {

/// x'' = -x from (1, 0), with the integral of x and an event where x falls through zero.
std::unique_ptr<Integrator> oscillator(double step) {
  OdeProblem p;
  p.n = 2, p.n_quadrature = 1, p.n_roots = 1;
  p.absolute_tolerance = {1e-12, 1e-12};
  p.rhs = [](double, const double* x, double* xdot) {
    xdot[0] = x[1], xdot[1] = -x[0];
    return true;
  };
  p.integrands = [](double, const double* x, double* ydot) { ydot[0] = x[0]; };
  p.roots = [](double, const double* x, double* g) { g[0] = x[0]; };
  IntegratorOptions options;
  options.fixed_step = step;
  return make_midpoint(std::move(p), options);
}

/// Error of x at the event, which is at pi/2, and of the integral of x up to there, which is 1.
std::pair<double, double> errors(double step) {
  const auto it = oscillator(step);
  double x[] = {1.0, 0.0}, y = 0.0;
  it->restart(0.0, x);
  StepReport report;
  while (!(report = it->step(10.0, x)).event) {
  }
  EXPECT_EQ(report.crossed[0], -1);
  it->integrals(report.t, &y);
  return {std::abs(report.t - 2.0 * std::atan(1.0)), std::abs(y - 1.0)};
}

TEST(ExtendingTheEngine, TheIntegratorIsOfOrderTwo) {
  const auto [t_coarse, y_coarse] = errors(0.02);
  const auto [t_fine, y_fine] = errors(0.01);
  EXPECT_LT(t_fine, 1e-4);                   // h^2/6 over a time of 1.6
  EXPECT_NEAR(t_coarse / t_fine, 4.0, 0.4);  // half the step, a quarter of the error, but for terms of the next order
  EXPECT_NEAR(y_coarse / y_fine, 4.0, 0.4);
}

/// By which the balances of a run are judged: over the steps to the event the sum of what each is off by, h^3/6 of the amplitude.
TEST(ExtendingTheEngine, TheIntegratorTellsTheErrorsOfItsSteps) {
  const double h = 0.01, allowed = 1e-12 + IntegratorOptions{}.relative_tolerance;  // of the amplitude, which is 1
  const auto it = oscillator(h);
  double x[] = {1.0, 0.0};
  it->restart(0.0, x);
  StepReport report;
  while (!(report = it->step(10.0, x)).event) {
  }
  EXPECT_EQ(report.order, 2);
  const double lost = report.t * h * h / 6.0, told = it->statistics().error_sum * allowed;
  EXPECT_GT(told, 0.3 * lost);  // half of it, where the rate hangs on the state alone
  EXPECT_LT(told, 3.0 * lost);
}

TEST(ExtendingTheEngine, TheFieldObeysTheLaws) {
  for (const std::string& v : field_law_violations(turning_dipole_family())) ADD_FAILURE() << v;
}

TEST(ExtendingTheEngine, TheDeviceObeysTheLaws) {
  for (const std::string& v : device_law_violations(eddy_brake_family())) ADD_FAILURE() << v;
}

TEST(ExtendingTheEngine, TheOpSlowsASpinningBody) {
  Registry registry;
  register_bodies(registry), register_hinges(registry);
  SystemSpec spec;
  spec.name = "top";
  spec.gravity.kind = GravitySpec::Kind::none;
  BodySpec& b = spec.bodies.emplace_back();
  b.name = "top", b.type = "rigid", b.mass = 2.0;
  b.inertia_com = Eigen::Vector3d(0.5, 0.8, 1.0).asDiagonal();
  b.hinge.type = "ball";
  const auto m = compile(spec, registry);
  Workspace ws(*m);
  const double q[] = {1.0, 0.0, 0.0, 0.0}, v[] = {0.0, 0.0, 3.0};  // about a principal axis
  double vdot[3] = {};
  const Inputs in{.q = q, .v = v};
  const auto& S = soa::sweeps<double>();
  S.ground(*m, ws, in);
  for (const Op& op : m->program) {
    if (op.code == OpCode::inward) soa::spin_drag_of_one_state(*m, ws, in);
    soa::run_op(*m, op, S, ws, in, vdot);
  }
  EXPECT_NEAR(vdot[2], -0.25 * 3.0 / 1.0, 1e-15);
  EXPECT_EQ(vdot[0], 0.0);
}

TEST(ExtendingTheEngine, TheCheckAnswers) {
  for (const double good : {0.0, 0.5, 1.0}) {
    DiagnosticSink sink;
    check_duty(good, {"heater.duty", {}}, sink);
    EXPECT_TRUE(sink.empty()) << good;
  }
  for (const double bad : {-0.1, 40.0, std::nan("")}) {
    DiagnosticSink sink;
    check_duty(bad, {"heater.duty", {}}, sink);
    ASSERT_FALSE(sink.empty()) << bad;
    EXPECT_EQ(number_of(sink.all()[0].code), "C0301");
    EXPECT_EQ(sink.all()[0].hint.empty(), bad != 40.0) << bad;
  }
}

}  // namespace
}  // namespace cardan
