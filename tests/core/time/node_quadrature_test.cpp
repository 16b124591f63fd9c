#include "core/time/node_quadrature.hpp"

#include <gtest/gtest.h>

namespace cardan {
namespace {

/// |integral of cos| over nodes that are `step` apart, with one more `sliver` after each tenth, and rates that are wrong by
/// up to `noise` in a fixed pattern; less what the noise itself can be worth.
double error_beyond_noise(double step, double sliver, double noise) {
  NodeQuadrature quadrature(1);
  double t = 0.0;
  int n = 0;
  const auto add = [&] {
    const double rate = std::cos(t) + noise * ((n++ * 7 % 11) / 5.0 - 1.0);
    quadrature.add(t, &rate);
  };
  const double zero = 0.0;
  quadrature.begin_stretch_at(&zero, &zero);
  add();
  for (int i = 1; i <= 800; ++i) {
    t += step, add();
    if (i % 10 == 0) t += sliver, add();
  }
  double y = 0.0;
  quadrature.at(t, &y, nullptr);
  return std::abs(y - std::sin(t)) - noise * t;
}

// Steps that end at an instant of the schedule may be a sliver of the others. A difference over one divides the error of the rates by it.
TEST(NodeQuadrature, SliversBetweenStepsDoNotMagnifyErrorsOfRates) {
  for (const double share : {0.5, 0.1, 1e-2, 1e-3, 1e-4, 2e-5})
    EXPECT_LT(error_beyond_noise(2.5e-3, 2.5e-3 * share, 1e-8), 0.0) << "sliver of " << share;
}

TEST(NodeQuadrature, OfExactRatesIsExactToRoundOffAtSmallSteps) {
  for (const double share : {0.5, 0.1, 1e-2, 1e-3}) EXPECT_LT(error_beyond_noise(2.5e-3, 2.5e-3 * share, 0.0), 1e-13) << share;
}

/// Error and estimate of the integral of f from 0 to 2 over steps that grow and shrink by a half.
std::pair<double, double> error_and_estimate(double (*f)(double), double step, double truth) {
  NodeQuadrature quadrature(1);
  const double zero = 0.0;
  quadrature.begin_stretch_at(&zero, &zero);
  double t = 0.0, y = 0.0, estimate = 0.0;
  for (int i = 0;; ++i) {
    const double rate = f(t);
    quadrature.add(t, &rate);
    if (t == 2.0) break;
    t = std::min(2.0, t + step * (1.0 + 0.5 * std::sin(static_cast<double>(i))));
  }
  quadrature.at(2.0, &y, &estimate);
  return {std::abs(y - truth), estimate};
}

TEST(NodeQuadrature, TellsWhatItIsOffByWhereRatesAreSmooth) {
  double before = 1.0;
  for (const double step : {0.2, 0.1, 0.05, 0.025}) {
    const auto [error, estimate] = error_and_estimate([](double t) { return std::cos(5.0 * t); }, step, std::sin(10.0) / 5.0);
    EXPECT_LT(error, estimate) << step;
    EXPECT_LT(estimate, before / 64.0) << step << ": of order 6 at least";  // the last term that is kept, of an error of order 8
    before = estimate;
  }
}

/// Steps of a run whose friction turns round at the end of the last ones. Terms over these grow and then fall again, which tells nothing:
/// they stay out.
TEST(NodeQuadrature, KeepsNoTermAfterOneThatGrew) {
  const double times[] = {-21.45e-3, -18.91e-3, -16.36e-3, -12.27e-3, -8.182e-3, -4.091e-3, 0.0,     4.091e-4,
                          4.196e-4,  4.225e-4,  4.236e-4,  4.246e-4,  4.247e-4,  4.248e-4,  4.249e-4};
  const double turned[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.0014, 0.0028, 0.0055, 0.0177};
  NodeQuadrature quadrature(1);
  double y = 0.0, error = 0.0;
  quadrature.begin_stretch_at(&y, &error);
  for (std::size_t i = 0; i < std::size(times); ++i) {
    const double rate = -0.18 - 6.0 * times[i] + turned[i];
    quadrature.add(times[i], &rate);
  }
  const double a = times[0], b = 4.249e-4;
  quadrature.at(b, &y, &error);
  EXPECT_NEAR(y, -0.18 * (b - a) - 3.0 * (b * b - a * a), 1e-8);  // turned is worth 2e-9; 9e-5 off with terms that came back
  EXPECT_LT(error, 1e-8);
}

/// Kinks and jumps between nodes: no polynomial knows of them.
TEST(NodeQuadrature, TellsWhatItIsOffByWhereRatesAreNot) {
  for (const double step : {0.1, 0.03, 0.01, 0.003}) {
    const auto [kink, of_kink] =
        error_and_estimate([](double t) { return std::abs(t - 0.7123); }, step, (std::pow(0.7123, 2) + std::pow(2.0 - 0.7123, 2)) / 2.0);
    EXPECT_LT(kink, 10.0 * of_kink) << step;
    EXPECT_LT(of_kink, 4.0 * step * step) << step;
    const auto [jump, of_jump] = error_and_estimate([](double t) { return t < 0.7123 ? 1.0 : -2.0; }, step, 0.7123 - 2.0 * (2.0 - 0.7123));
    EXPECT_LT(jump, 10.0 * of_jump) << step;
    EXPECT_LT(of_jump, 30.0 * step) << step;
  }
}

}  // namespace
}  // namespace cardan
