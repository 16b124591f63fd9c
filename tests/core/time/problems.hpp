#pragma once
// Problems with a known solution, and a loop that integrates them.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/base/diagnostic.hpp"
#include "core/time/integrator.hpp"

namespace cardan::test {

using Values = std::vector<double>;

inline OdeProblem problem(int n, std::function<bool(double, const double*, double*)> rhs, double absolute = 1e-12) {
  OdeProblem p;
  p.n = n;
  p.rhs = std::move(rhs);
  p.absolute_tolerance.assign(static_cast<std::size_t>(n), absolute);
  return p;
}

/// x = cos t, v = -sin t from (1, 0).
inline OdeProblem oscillator(double absolute = 1e-12) {
  return problem(
      2,
      [](double, const double* x, double* xdot) {
        xdot[0] = x[1];
        xdot[1] = -x[0];
        return true;
      },
      absolute);
}

/// x = exp(sin t) from 1: nonlinear in t, so that the times of the stages matter.
inline OdeProblem exp_sin(double absolute = 1e-12) {
  return problem(
      1,
      [](double t, const double* x, double* xdot) {
        xdot[0] = x[0] * std::cos(t);
        return true;
      },
      absolute);
}

/// y2' is 3e7 times faster than the solution; reference: Mazzia, Magherini 2008, Test Set for IVP Solvers, problem ROBER.
inline void expect_robertsons_kinetics(const IntegratorOptions& options, long most_steps) {
  OdeProblem p = problem(3, [](double, const double* x, double* xdot) {
    const double slow = 0.04 * x[0], middle = 1e4 * x[1] * x[2], fast = 3e7 * x[1] * x[1];
    xdot[0] = -slow + middle;
    xdot[1] = slow - middle - fast;
    xdot[2] = fast;
    return true;
  });
  p.absolute_tolerance = {1e-14, 1e-20, 1e-14};
  auto integrator = make_integrator(p, options);
  Values x = {1.0, 0.0, 0.0};
  integrator->restart(0.0, x.data());
  for (double t = 0.0; t < 1e11;) t = integrator->step(1e11, x.data()).t;
  EXPECT_NEAR(x[0] / 0.2083340149701255e-07, 1.0, 1e-5);
  EXPECT_NEAR(x[1] / 0.8333360770334713e-13, 1.0, 1e-5);
  EXPECT_NEAR(x[2], 0.9999999791665050, 1e-10);
  EXPECT_LT(integrator->statistics().steps, most_steps);
}

inline IntegratorOptions adaptive(const std::string& method, double relative = 1e-10) {
  IntegratorOptions o;
  o.method = method;
  o.relative_tolerance = relative;
  return o;
}

inline IntegratorOptions rk4(double h) {
  IntegratorOptions o;
  o.method = "rk4";
  o.fixed_step = h;
  return o;
}

/// Each method at settings that give about nine digits on the smooth problems here.
inline IntegratorOptions accurate(const std::string& method) {
  return method == "rk4" ? rk4(2e-3) : adaptive(method, method == "exponential" ? 1e-12 : 1e-11);
}

/// From (t0, x0) to t_end; events are passed over. Returns x, then the integrals (from zero).
inline Values integrate(Integrator& integrator, double t0, Values x, double t_end, int n_quadrature = 0) {
  integrator.restart(t0, x.data());
  for (double t = t0; t < t_end;) t = integrator.step(t_end, x.data()).t;
  Values y(static_cast<std::size_t>(n_quadrature));
  if (n_quadrature > 0) integrator.integrals(t_end, y.data());
  x.insert(x.end(), y.begin(), y.end());
  return x;
}

/// x' = r: nothing is linear, and `exponential`, `multirate` are explicit ones of order 3 and 4.
class NoLinearPart final : public LinearPart {
 public:
  explicit NoLinearPart(int n) : x_(static_cast<std::size_t>(n)) {}
  int size() const override { return static_cast<int>(x_.size()); }
  void centre(double, const double* x, const double*) override { std::copy_n(x, x_.size(), x_.begin()); }
  void residual(const double*, const double* xdot, double* r) const override { std::copy_n(xdot, x_.size(), r); }
  void advance(double h, const std::array<const double*, 3>& r, double* x) override {
    h_ = h;
    for (std::size_t k = 0; k < 3; ++k) r_[k].assign(r[k], r[k] + size());
    inside(1.0, x);
  }
  void effect(double h, const std::array<const double*, 3>& r, double* e) override {
    for (int i = 0; i < size(); ++i) e[i] = h * (r[0][i] + r[1][i] / 2 + r[2][i] / 3);
  }
  void leave_out(double, double*) const override {}
  void divide(int) override {}
  void inside(double s, double* x) override {
    for (std::size_t i = 0; i < x_.size(); ++i) x[i] = x_[i] + h_ * s * (r_[0][i] + s * (r_[1][i] / 2 + s * r_[2][i] / 3));
  }
  void sizes(const double* x, double* size) const override {
    for (std::size_t i = 0; i < x_.size(); ++i) size[i] = std::abs(x[i]);
  }
  double longest_step() const override { return std::numeric_limits<double>::infinity(); }
  void remember(Archive&) override {}

 private:
  Values x_;
  double h_ = 0.0;
  std::array<Values, 3> r_;
};

inline std::unique_ptr<Integrator> make_by(OdeProblem p, const IntegratorOptions& options) {
  p.linear = [n = p.n](const std::string&) { return std::make_shared<NoLinearPart>(n); };
  return make_integrator(std::move(p), options);
}

/// For claims that hold for every method.
class EveryMethod : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<Integrator> make(OdeProblem p) { return make_by(std::move(p), accurate(GetParam())); }
};

inline std::string parameter_name(const testing::TestParamInfo<std::string>& info) { return info.param; }

}  // namespace cardan::test
