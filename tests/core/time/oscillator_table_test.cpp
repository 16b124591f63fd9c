// The closed form of one oscillator against the solution of its equation by other means.
#include "core/time/oscillator_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

using Complex = std::complex<double>;
constexpr int kTerms = kDegrees;

/// integral of e^{mu (t - s)} F(s) ds from 0 to t by panels of Gauss, 5 points each.
template <class Force>
Complex convolution(Complex mu, double t, const Force& F) {
  constexpr double at[] = {-0.9061798459386640, -0.5384693101056831, 0.0, 0.5384693101056831, 0.9061798459386640};
  constexpr double weight[] = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
  const int panels = 40 + static_cast<int>(4.0 * std::abs(mu) * t);
  Complex sum = 0.0;
  for (int p = 0; p < panels; ++p)
    for (int g = 0; g < 5; ++g) {
      const double s = t * (p + 0.5 + 0.5 * at[g]) / panels;
      sum += 0.5 * weight[g] * t / panels * std::exp(mu * (t - s)) * F(s);
    }
  return sum;
}

struct Case {
  double hertz, damping, h;
};
const Case kCases[] = {{0.1, 0.005, 0.1},   {0.1, 0.0, 0.01},    {13.3, 0.005, 0.1}, {13.3, 0.5, 0.1},
                       {100.0, 0.005, 0.1}, {1000.0, 0.01, 0.1}, {2.0, 0.9, 1.0}};

using Causes = OscillatorTable::Causes;

Causes causes_of(std::initializer_list<double> all) {
  Causes c = Causes::Zero();
  std::ranges::copy(all, c.data());
  return c;
}

Complex inside(const OscillatorTable& table, const Oscillator& o, double s, const Causes& causes) {
  const auto [eta, rate] = table.inside(s, causes);
  return o.alpha(eta, rate);
}

TEST(OscillatorTable, FollowsPolynomialForces) {
  for (const Case& c : kCases) {
    const Oscillator o{2.0 * std::numbers::pi * c.hertz, c.damping};
    const OscillatorTable table(o, c.h);
    const Complex alpha_0 = o.alpha(0.3, -1.1);
    EXPECT_NEAR(o.eta(alpha_0), 0.3, 1e-13);
    EXPECT_NEAR(o.rate(alpha_0), -1.1, 1e-11);
    for (const double s : {0.0, 0.37, 1.0})
      for (std::size_t j = 0; j < 3; ++j) {
        Causes causes = causes_of({0.3, -1.1});
        causes[static_cast<int>(2 + j)] = 2.5;
        const Complex alpha = inside(table, o, s, causes);
        const auto P = [&](double t) { return 2.5 * legendre(t / c.h)[j]; };
        const Complex wanted = std::exp(o.mu() * (s * c.h)) * alpha_0 + convolution(o.mu(), s * c.h, P);
        EXPECT_LT(std::abs(alpha - wanted), 1e-12 * (1.0 + std::abs(wanted))) << c.hertz << " Hz, P_" << j << " at " << s;
        if (s != 1.0) continue;
        const Eigen::Vector2d end = table.end * causes;
        EXPECT_LT(std::abs(o.alpha(end[0], end[1]) - alpha), 1e-12 * (1.0 + std::abs(alpha))) << c.hertz;
      }
  }
}

/// alpha' = mu alpha + F on the inside, by differences: also for what is carried along, which follows a velocity without its last degree.
TEST(OscillatorTable, FulfilsItsEquationInside) {
  for (const Case& c : kCases) {
    const Oscillator o{2.0 * std::numbers::pi * c.hertz, c.damping};
    const OscillatorTable table(o, c.h);
    const Causes causes = causes_of({0.0, 1.0, 0.4, -1.0, 0.7, 1.0, 0.3, -0.8, 0.2, 0.5, 1.7});
    const double last = causes[OscillatorTable::kCauses - 1], lag = c.h / (2.0 * (2 * kTerms - 1));
    for (const double s : {0.2, 0.5, 0.83}) {
      const double e = 2e-3 / std::max(1.0, std::abs(o.mu()) * c.h / 4);  // of a difference of fourth order, as a part of the step
      // Without what its rate is beyond that of the part it follows.
      const auto at = [&](double x) { return inside(table, o, s + x, causes) - lag * legendre(s + x)[kTerms] * last; };
      const Complex slope = (8.0 * (at(e) - at(-e)) - (at(2 * e) - at(-2 * e))) / (12.0 * e * c.h);
      const Legendre P = legendre(s);
      double F = 0.0;
      for (std::size_t j = 0; j < 3; ++j) F += causes[static_cast<int>(2 + j)] * P[j];
      for (std::size_t j = 0; j + 1 < kTerms; ++j) F += causes[static_cast<int>(5 + j)] * P[j];
      for (int k = kTerms - 3; k >= 0; k -= 2) F -= last * (2.0 * k + 1.0) / (2.0 * kTerms - 1.0) * P[static_cast<std::size_t>(k)];
      const Complex wanted = o.mu() * at(0.0) + F;
      EXPECT_LT(std::abs(slope - wanted), 1e-6 * (std::abs(o.mu()) + std::abs(wanted))) << c.hertz << " Hz at " << s;
    }
  }
}

/// The coefficients of omega^2 eta + 2 zeta omega eta' - F are those of what inside() gives, by a fine quadrature.
TEST(OscillatorTable, TellsItsForceByLegendreCoefficients) {
  constexpr int kPanels = 4000;
  for (const Case& c : kCases) {
    if (c.hertz * c.h > 50.0) continue;  // too many swings for it
    const Oscillator o{2.0 * std::numbers::pi * c.hertz, c.damping};
    const OscillatorTable table(o, c.h);
    const Causes causes = causes_of({0.2, 0.9, 0.3, 0.2, -0.5, 0.4, 0.1, 0.2, -0.3, 0.6, 0.8});
    const double lag = c.h / (2.0 * (2 * kTerms - 1));
    double largest_force = 0.0;
    std::array<double, kTerms> wanted{};
    for (int p = 0; p < kPanels; ++p)
      for (const double g : {-0.57735026918962576, 0.57735026918962576}) {
        const double s = (p + 0.5 + 0.5 * g) / kPanels;
        const Legendre P = legendre(s);
        const auto [eta, rate] = table.inside(s, causes);
        const double followed = rate - lag * P[kTerms] * causes[OscillatorTable::kCauses - 1];
        double force = o.frequency * (o.frequency * eta + 2.0 * o.damping * followed);
        for (std::size_t j = 0; j < 3; ++j) force -= causes[static_cast<int>(2 + j)] * P[j];
        largest_force = worse(largest_force, std::abs(force));
        for (std::size_t i = 0; i < kTerms; ++i) wanted[i] += (2.0 * static_cast<double>(i) + 1.0) * 0.5 / kPanels * force * P[i];
      }
    const Eigen::Matrix<double, kTerms, 1> told = table.force * causes.head<5>() + table.force_of_carrier * causes.tail<kTerms>();
    for (std::size_t i = 0; i < kTerms; ++i) {
      const double sum = told[static_cast<int>(i)];
      EXPECT_NEAR(sum, wanted[i], 1e-9 * largest_force) << c.hertz << " Hz, coefficient " << i;
    }
  }
}

}  // namespace
}  // namespace cardan::test
