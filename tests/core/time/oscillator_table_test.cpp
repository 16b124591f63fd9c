// The closed form of one oscillator against the solution of its equation by other means.
#include "core/time/oscillator_table.hpp"

#include <gtest/gtest.h>

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

TEST(OscillatorTable, FollowsPolynomialForces) {
  for (const Case& c : kCases) {
    const Oscillator o{2.0 * std::numbers::pi * c.hertz, c.damping};
    const OscillatorTable table(o, c.h);
    const Complex alpha_0 = o.alpha(0.3, -1.1);
    for (const double s : {0.0, 0.37, 1.0})
      for (int j = 0; j < 3; ++j) {
        double drive[3] = {}, none[kTerms] = {};
        drive[j] = 2.5;
        const Complex alpha = table.inside(s, alpha_0, drive, none);
        const auto P = [&](double t) { return 2.5 * legendre(t / c.h)[static_cast<std::size_t>(j)]; };
        const Complex wanted = std::exp(o.mu() * (s * c.h)) * alpha_0 + convolution(o.mu(), s * c.h, P);
        EXPECT_LT(std::abs(alpha - wanted), 1e-12 * (1.0 + std::abs(wanted))) << c.hertz << " Hz, P_" << j << " at " << s;
        if (s == 1.0) {
          const Complex end = table.decay * alpha_0 + 2.5 * table.driven[static_cast<std::size_t>(j)];
          EXPECT_LT(std::abs(end - alpha), 1e-12 * (1.0 + std::abs(alpha))) << c.hertz;
        }
      }
    // eta and eta' are read back.
    EXPECT_NEAR(o.eta(alpha_0), 0.3, 1e-13);
    EXPECT_NEAR(o.rate(alpha_0), -1.1, 1e-11);
  }
}

/// alpha' = mu alpha + F on the inside, by differences: also for what is coupled, where F is the acceleration without the last degree.
TEST(OscillatorTable, FulfilsItsEquationInside) {
  for (const Case& c : kCases) {
    const Oscillator o{2.0 * std::numbers::pi * c.hertz, c.damping};
    const OscillatorTable table(o, c.h);
    double drive[3] = {0.4, -1.0, 0.7}, coupling[kTerms] = {1.0, 0.3, -0.8, 0.2, 0.5, 1.7};
    for (const double s : {0.2, 0.5, 0.83}) {
      const double e = 2e-3 / std::max(1.0, std::abs(o.mu()) * c.h / 4);  // of a difference of fourth order, as a part of the step
      const auto at = [&](double x) { return table.inside(s + x, o.alpha(0.0, 1.0), drive, coupling); };
      const Complex slope = (8.0 * (at(e) - at(-e)) - (at(2 * e) - at(-2 * e))) / (12.0 * e * c.h);
      const Legendre P = legendre(s);
      double F = 0.0;
      for (std::size_t j = 0; j < 3; ++j) F += drive[j] * P[j];
      for (std::size_t j = 0; j + 1 < kTerms; ++j) F += coupling[j] * P[j];
      for (int k = kTerms - 3; k >= 0; k -= 2)
        F -= coupling[kTerms - 1] * (2.0 * k + 1.0) / (2.0 * kTerms - 1.0) * P[static_cast<std::size_t>(k)];
      const Complex wanted = o.mu() * at(0.0) + F;
      EXPECT_LT(std::abs(slope - wanted), 1e-6 * (std::abs(o.mu()) + std::abs(wanted))) << c.hertz << " Hz at " << s;
    }
  }
}

/// The coefficients of omega^2 eta + 2 zeta omega eta' are those of what inside() gives, by a quadrature that is exact for what is there.
TEST(OscillatorTable, TellsItsForceByLegendreCoefficients) {
  constexpr int kPoints = 4000;
  for (const Case& c : kCases) {
    if (c.hertz * c.h > 50.0) continue;  // too many swings for the quadrature
    const Oscillator o{2.0 * std::numbers::pi * c.hertz, c.damping};
    const OscillatorTable table(o, c.h);
    const Complex alpha_0 = o.alpha(0.2, 0.9);
    double largest_force = 0.0;
    std::array<double, kTerms> wanted{};
    double drive[3] = {0.3, 0.2, -0.5}, coupling[kTerms] = {0.4, 0.1, 0.2, -0.3, 0.6, 0.8};
    for (int p = 0; p < kPoints; ++p) {  // Simpson's rule would need the ends; the middle rule with its first correction is enough here
      for (const double g : {-0.57735026918962576, 0.57735026918962576}) {
        const double s = (p + 0.5 + 0.5 * g) / kPoints;
        const Complex alpha = table.inside(s, alpha_0, drive, coupling);
        const double force = o.frequency * (o.frequency * o.eta(alpha) + 2.0 * o.damping * o.rate(alpha));
        largest_force = worse(largest_force, std::abs(force));
        const Legendre P = legendre(s);
        for (std::size_t i = 0; i < kTerms; ++i) wanted[i] += (2.0 * static_cast<double>(i) + 1.0) * 0.5 / kPoints * force * P[i];
      }
    }
    for (std::size_t i = 0; i < kTerms; ++i) {
      double sum = (table.free_force[i] * alpha_0).imag();
      for (int j = 0; j < 3; ++j) sum += table.force_of_drive[i][j] * drive[j];
      for (int j = 0; j < kTerms; ++j) sum += table.force_of_coupling[i][j] * coupling[j];
      EXPECT_NEAR(sum, wanted[i], 1e-9 * largest_force) << c.hertz << " Hz, coefficient " << i;
    }
  }
}

}  // namespace
}  // namespace cardan::test
