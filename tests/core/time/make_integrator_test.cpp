#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

std::string refusal(const IntegratorOptions& options, double absolute = 1e-9) {
  try {
    make_integrator(oscillator(absolute), options);
  } catch (const InputError& e) {
    const Diagnostic& d = e.diagnostics().front();
    return std::string(number_of(d.code)) + " | " + d.at.key_path + " | " + d.expected + " | " + d.got + " | " + d.hint;
  }
  return "accepted";
}

TEST(MakeIntegrator, UnknownMethodListsTheMethods) {
  EXPECT_EQ(refusal(adaptive("cvode_adms")),
            "C0401 | integrator.method | a method: ark_explicit, ark_imex, ark_implicit, auto, cvode_adams, cvode_bdf, dop853, dopri5, "
            "exponential, "
            "extended, ida, multirate, rk4, variational, "
            "variational4 | \"cvode_adms\" | "
            "did you mean \"cvode_adams\"?");
}

TEST(MakeIntegrator, Rk4NeedsAStep) {
  EXPECT_EQ(refusal(rk4(0.0)), "C0401 | integrator.step | a step in seconds, which rk4 needs | nothing | ");
}

TEST(MakeIntegrator, AdaptiveMethodsRefuseAFixedStep) {
  for (const std::string method : {"cvode_adams", "cvode_bdf", "dop853", "dopri5"}) {
    IntegratorOptions o = adaptive(method);
    o.fixed_step = 0.01;
    EXPECT_EQ(refusal(o),
              "C0401 | integrator.step | no step: " + method + " chooses its steps | 0.01 s | set relative or max_step, or use rk4");
  }
}

TEST(MakeIntegrator, Rk4RefusesAMaximumStep) {
  IntegratorOptions o = rk4(0.1);
  o.max_step = 1.0;
  EXPECT_EQ(refusal(o), "C0401 | integrator.max_step | no max_step: rk4 takes equal steps | 1 s | set step, or use dopri5");
}

TEST(MakeIntegrator, LinearSolversAreOfBdfAlone) {
  IntegratorOptions o = adaptive("cvode_bdf");
  for (const char* name : {"", "dense", "krylov"}) {
    o.linear_solver = name;
    EXPECT_EQ(refusal(o), "accepted") << name;
  }
  o.linear_solver = "krilov";
  EXPECT_EQ(refusal(o), "C0401 | integrator.linear_solver | a linear solver: dense, krylov | \"krilov\" | did you mean \"krylov\"?");
  for (const std::string method : {"cvode_adams", "dopri5", "rk4"}) {
    o = method == "rk4" ? rk4(0.1) : adaptive(method);
    o.linear_solver = "dense";
    EXPECT_EQ(refusal(o),
              "C0401 | integrator.linear_solver | no linear_solver: " + method + " solves no linear equations | \"dense\" | use cvode_bdf");
  }
}

TEST(MakeIntegrator, NumbersOutOfRangeAreRefused) {
  const auto code = [](const std::string& text) { return text.substr(0, 5); };
  EXPECT_EQ(code(refusal(rk4(-0.1))), "C0301");
  EXPECT_EQ(code(refusal(adaptive("dopri5", 0.0))), "C0301");
  EXPECT_EQ(code(refusal(adaptive("dopri5", std::nan("")))), "C0301");
  EXPECT_EQ(code(refusal(adaptive("dopri5"), 0.0)), "C0301");
  IntegratorOptions o = adaptive("cvode_bdf");
  o.initial_step = -1.0;
  EXPECT_EQ(code(refusal(o)), "C0301");
  EXPECT_EQ(refusal(adaptive("cvode_bdf")), "accepted");
}

}  // namespace
}  // namespace cardan::test
