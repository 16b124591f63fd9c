// Integrals by the weights of stages, here those of Boole: exact up to degree 5.
#include "core/time/stage_quadrature.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace cardan::test {
namespace {

using Rate = std::function<double(double)>;
constexpr double kStart = 2.0;  // of the integral

StageQuadrature by_boole(int order) {
  StageQuadrature q(1, {7.0 / 90, 32.0 / 90, 12.0 / 90, 32.0 / 90, 7.0 / 90}, {0.0, 0.25, 0.5, 0.75, 1.0}, order);
  const double error = 0.0;
  q.set(&kStart, &error);
  return q;
}
/// From 0 to h, where its stages are evaluated at once, and before that elsewhere.
void step(StageQuadrature& q, double h, const Rate& rate) {
  *q.start() = rate(0.0);
  for (const double c : {0.25, 0.5, 0.75, 1.0})
    for (const double off : {7.0, 0.0}) *q.stage(c * h) = rate(c * h) + off;  // of two at one time the last counts
  *q.end() = rate(h);
  q.step(h);
  *q.third() = rate(h / 3), *q.two_thirds() = rate(2 * h / 3);
}
double inside(const StageQuadrature& q, double s) {
  double y = 0.0;
  q.inside(s, &y);
  return y;
}

TEST(StageQuadrature, IsExactInsideOfAStepForRatesOfDegreeThree) {
  const double h = 1.3;
  StageQuadrature q = by_boole(6);
  step(q, h, [](double t) { return 1 + t * (2 + t * (-3 + 4 * t)); });
  for (const double s : {0.0, 0.2, 0.5, 0.9, 1.0}) {
    const double t = s * h;
    EXPECT_NEAR(inside(q, s), kStart + t * (1 + t * (1 + t * (-1 + t))), 1e-14) << s;
  }
  EXPECT_LT(q.error()[0], 1e-14);
}

/// Beyond that degree a step still ends where its stages say, and rates that are not known inside are taken for a straight line.
TEST(StageQuadrature, EndsAStepWhereItsStagesSay) {
  StageQuadrature q = by_boole(6);
  step(q, 1.0, [](double t) { return std::pow(t, 5); });
  EXPECT_NEAR(q.sum()[0], kStart + 1.0 / 6, 1e-15);
  EXPECT_NEAR(inside(q, 1.0), q.sum()[0], 1e-15);
  EXPECT_EQ(inside(q, 0.0), kStart);
  StageQuadrature line = by_boole(6);
  step(line, 1.0, [](double t) { return 1 + t; });
  *line.third() = *line.two_thirds() = 7.0;
  line.guess_inside();
  EXPECT_NEAR(inside(line, 0.3), kStart + 0.3 + 0.5 * 0.09, 1e-15);
}

/// Of t^4 over 1 Simpson's rule is off by 1/120, the trapezium adds 1/2: what two orders gain is 1/60, one its root.
TEST(StageQuadrature, TellsItsErrorByWhatOrdersGain) {
  for (const int order : {5, 6}) {
    StageQuadrature q = by_boole(order);
    step(q, 1.0, [](double t) { return std::pow(t, 4); });
    const double error = order == 6 ? 1.0 / 7200 : std::sqrt(1.0 / 60) / 120;
    EXPECT_NEAR(q.error()[0], error, 1e-15) << order;
    step(q, 1.0, [](double t) { return std::pow(t, 4); });
    EXPECT_NEAR(q.error()[0], 2 * error, 1e-15) << order;
    q.take_back();
    EXPECT_NEAR(q.error()[0], error, 1e-15) << order;
    EXPECT_NEAR(q.sum()[0], kStart + 0.2, 1e-15) << order;
  }
}

}  // namespace
}  // namespace cardan::test
