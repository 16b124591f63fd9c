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
  quadrature.begin_stretch_at(&zero);
  add();
  for (int i = 1; i <= 800; ++i) {
    t += step, add();
    if (i % 10 == 0) t += sliver, add();
  }
  double y = 0.0;
  quadrature.at(t, &y);
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

}  // namespace
}  // namespace cardan
