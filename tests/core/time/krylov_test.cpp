// BDF whose Newton equations are solved by preconditioned GMRES: against closed forms, and what the callables of the
// problem may do.
#include "tests/core/time/problems.hpp"
#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

IntegratorOptions krylov(double relative = 1e-9) {
  IntegratorOptions o = adaptive("cvode_bdf", relative);
  o.linear_solver = "krylov";
  return o;
}

/// Heat in a rod between walls at 0, n points: x_i' = n_1^2 (x_(i-1) - 2 x_i + x_(i+1)), n_1 = n + 1; rates from 10 to
/// 4 n_1^2. Its slowest mode sin(pi i / n_1) decays at 4 n_1^2 sin^2(pi / (2 n_1)).
struct Rod {
  static constexpr int n = 120;
  static constexpr double c = (n + 1.0) * (n + 1.0);
  static void times(const double* x, double* out) {
    for (int i = 0; i < n; ++i) out[i] = c * ((i > 0 ? x[i - 1] : 0.0) - 2.0 * x[i] + (i + 1 < n ? x[i + 1] : 0.0));
  }
  static double shape(int i) { return std::sin(M_PI * (i + 1) / (n + 1)); }
  static double decay() { return 4.0 * c * std::pow(std::sin(0.5 * M_PI / (n + 1)), 2); }
};

/// (1 - gamma J) z = r of the rod, by elimination: exact.
struct RodInverse {
  double gamma = 0.0;
  void solve(const double* r, double* z) const {
    const double a = -gamma * Rod::c, d = 1.0 - 2.0 * a;
    Values p(Rod::n), y(Rod::n);
    for (int i = 0; i < Rod::n; ++i) {
      const double pivot = d - (i > 0 ? a * p[static_cast<std::size_t>(i - 1)] : 0.0);
      p[static_cast<std::size_t>(i)] = a / pivot;
      y[static_cast<std::size_t>(i)] = (r[i] - (i > 0 ? a * y[static_cast<std::size_t>(i - 1)] : 0.0)) / pivot;
    }
    for (int i = Rod::n - 1; i >= 0; --i)
      z[i] = y[static_cast<std::size_t>(i)] - (i + 1 < Rod::n ? p[static_cast<std::size_t>(i)] * z[i + 1] : 0.0);
  }
};

OdeProblem rod() {
  return problem(
      Rod::n,
      [](double, const double* x, double* xdot) {
        Rod::times(x, xdot);
        return true;
      },
      1e-10);
}

double rod_error(Integrator& integrator) {
  Values x(Rod::n);
  for (int i = 0; i < Rod::n; ++i) x[static_cast<std::size_t>(i)] = Rod::shape(i) + 0.5 * (i % 2);  // and what dies out at once
  Values slow(Rod::n);
  double weight = 0.0;  // of the slowest mode in x
  for (int i = 0; i < Rod::n; ++i) weight += x[static_cast<std::size_t>(i)] * Rod::shape(i) * 2.0 / (Rod::n + 1);
  x = integrate(integrator, 0.0, x, 0.5);
  double error = 0.0;
  for (int i = 0; i < Rod::n; ++i)
    error = worse(error, std::abs(x[static_cast<std::size_t>(i)] - weight * std::exp(-0.5 * Rod::decay()) * Rod::shape(i)));
  return error;
}

/// With J v and a preconditioner; with J v alone; with neither, by difference quotients.
TEST(Krylov, SolvesTheHeatEquationWithWhatItIsGiven) {
  auto dense = make_integrator(rod(), adaptive("cvode_bdf", 1e-7));
  EXPECT_LT(rod_error(*dense), 1e-6);
  EXPECT_EQ(dense->statistics().jacobian_products, 0);

  OdeProblem p = rod();
  RodInverse inverse;
  int moved = 0, prepared = 0;
  p.jacobian_times = [](double, const double*, const double* dx, double* out) {
    Rod::times(dx, out);
    return true;
  };
  p.prepare = [&](double, const double*, double gamma, bool anew) {
    inverse.gamma = gamma;
    moved += anew, ++prepared;
    return true;
  };
  p.precondition = [&](const double* r, double* z) {
    inverse.solve(r, z);
    return true;
  };
  auto all = make_integrator(p, krylov(1e-7));
  EXPECT_LT(rod_error(*all), 1e-6);
  const IntegratorStatistics s = all->statistics();
  EXPECT_EQ(s.preconditioner_setups, prepared);
  EXPECT_GT(moved, 0);
  EXPECT_GT(prepared, moved);  // gamma changes more often than J
  EXPECT_GT(s.jacobian_products, 0);
  EXPECT_LT(s.linear_iterations, 3 * s.rhs_calls);  // the preconditioner is exact but for an old gamma
  EXPECT_LT(s.rhs_calls, dense->statistics().rhs_calls / 2);

  p.prepare = nullptr, p.precondition = nullptr;
  auto alone = make_integrator(p, krylov(1e-7));
  EXPECT_LT(rod_error(*alone), 1e-6);
  EXPECT_GT(alone->statistics().linear_iterations, 3 * s.linear_iterations);
  EXPECT_EQ(alone->statistics().preconditioner_setups, 0);
  const long with_product = alone->statistics().rhs_calls;
  p.jacobian_times = nullptr;
  auto differences = make_integrator(p, krylov(1e-7));
  EXPECT_LT(rod_error(*differences), 1e-6);
  EXPECT_GT(differences->statistics().rhs_calls, 2 * with_product);  // one for each product
}

/// The counts go on over restarts.
TEST(Krylov, StatisticsAddUpOverRestarts) {
  auto integrator = make_integrator(oscillator(), krylov());
  integrate(*integrator, 0.0, {1.0, 0.0}, 5.0);
  const IntegratorStatistics one = integrator->statistics();
  integrate(*integrator, 0.0, {1.0, 0.0}, 5.0);
  const IntegratorStatistics two = integrator->statistics();
  EXPECT_GT(one.jacobian_products, 0);
  EXPECT_EQ(two.jacobian_products, 2 * one.jacobian_products);
  EXPECT_EQ(two.linear_iterations, 2 * one.linear_iterations);
  EXPECT_EQ(two.rhs_calls, 2 * one.rhs_calls);
}

TEST(Krylov, NoStatesAreFine) {
  OdeProblem p = problem(0, [](double, const double*, double*) { return true; });
  p.jacobian_times = [](double, const double*, const double*, double*) -> bool { throw std::logic_error("called"); };
  auto integrator = make_integrator(p, krylov());
  EXPECT_TRUE(integrate(*integrator, 0.0, {}, 1.0).empty());
}

OdeProblem decay() {
  OdeProblem p = problem(1, [](double, const double* x, double* xdot) {
    *xdot = -x[0];
    return true;
  });
  p.jacobian_times = [](double, const double*, const double* dx, double* out) {
    *out = -*dx;
    return true;
  };
  p.prepare = [](double, const double*, double, bool) { return true; };
  p.precondition = [](const double* r, double* z) {
    *z = *r;
    return true;
  };
  return p;
}

/// What a callable throws arrives unchanged, though CVODES stands between.
TEST(Krylov, ExceptionsPass) {
  for (const int which : {0, 1, 2}) {
    OdeProblem p = decay();
    if (which == 0) p.jacobian_times = [](double, const double*, const double*, double*) -> bool { throw std::domain_error("thrown"); };
    if (which == 1) p.prepare = [](double, const double*, double, bool) -> bool { throw std::domain_error("thrown"); };
    if (which == 2) p.precondition = [](const double*, double*) -> bool { throw std::domain_error("thrown"); };
    auto integrator = make_integrator(p, krylov());
    EXPECT_THROW(integrate(*integrator, 0.0, {1.0}, 1.0), std::domain_error) << which;
  }
}

/// A refusal, or a value that is no number, is retried with a smaller step.
TEST(Krylov, RefusalsAreRetried) {
  for (const int which : {0, 1, 2}) {
    OdeProblem p = decay();
    int left = 3;
    const auto refuses = [&left] { return left > 0 && left-- > 0; };
    if (which == 0)
      p.jacobian_times = [&](double, const double*, const double* dx, double* out) {
        *out = refuses() ? NAN : -*dx;
        return true;
      };
    if (which == 1) p.prepare = [&](double, const double*, double, bool) { return !refuses(); };
    if (which == 2)
      p.precondition = [&](const double* r, double* z) {
        *z = *r;
        return !refuses();
      };
    auto integrator = make_integrator(p, krylov());
    EXPECT_NEAR(integrate(*integrator, 0.0, {1.0}, 1.0)[0], std::exp(-1.0), 1e-6) << which;
    EXPECT_EQ(left, 0);
    EXPECT_GE(integrator->statistics().rejected.all(), 3);
  }
}

/// Refused for good, the run fails and says what refused.
TEST(Krylov, APreconditionerThatNeverComesFails) {
  OdeProblem p = decay();
  p.prepare = [](double, const double*, double, bool) { return false; };
  auto integrator = make_integrator(p, krylov());
  try {
    integrate(*integrator, 0.0, {1.0}, 1.0);
    ADD_FAILURE();
  } catch (const NumericsError& e) {
    EXPECT_EQ(e.failure().code, Code::step_too_small);
    EXPECT_EQ(e.failure().what.find("the preconditioner cannot be prepared"), 0u) << e.failure().what;
  }
}

}  // namespace
}  // namespace cardan::test
