// The method `multirate` on a linear part that is found by pieces of a known order.
#include "tests/core/time/problems.hpp"

namespace cardan::test {
namespace {

/// x'' = -omega^2 x + r as a linear part, each piece of it by one step of the classic Runge-Kutta method: of order 4, and wrong where a
/// piece is long beside 1/omega. `digits`: what the end of a step is known to.
class CoarseOscillator final : public LinearPart {
 public:
  explicit CoarseOscillator(double omega, double digits = 0.0) : omega_(omega), digits_(digits) {}
  int size() const override { return 2; }
  void centre(double, const double* x, const double*) override { start_ = {x[0], x[1]}; }
  void residual(const double* x, const double* xdot, double* r) const override {
    r[0] = xdot[0] - x[1], r[1] = xdot[1] + omega_ * omega_ * x[0];
  }
  void divide(int pieces) override { pieces_ = pieces; }
  void advance(double h, const std::array<const double*, 3>& r, double* x) override {
    h_ = h;
    for (std::size_t k = 0; k < 3; ++k) r_[k] = {r[k][0], r[k][1]};
    inside(1.0, x);
    x[0] += digits_ * std::sin(1e3 * pieces_ + 1e9 * x[1]), x[1] += omega_ * digits_ * std::cos(1e3 * pieces_ + 1e9 * x[0]);
  }
  void effect(double, const std::array<const double*, 3>&, double*) override {}
  void leave_out(double, double*) const override {}
  void inside(double s, double* x) override {
    State at = start_;
    for (int k = 0; k < pieces_; ++k) {
      const double begin = static_cast<double>(k) / pieces_, share = std::min(1.0 / pieces_, s - begin);
      if (share > 0.0) at = piece(at, begin, share);
    }
    x[0] = at[0], x[1] = at[1];
  }
  void sizes(const double* x, double* size) const override { size[0] = std::abs(x[0]), size[1] = std::abs(x[1]); }
  double longest_step() const override { return std::numeric_limits<double>::infinity(); }
  void remember(Archive&) override {}

 private:
  using State = std::array<double, 2>;
  State piece(const State& x, double s, double share) const {
    const double h = share * h_;
    const auto rate = [&](const State& k, double along, double at) {
      const State y = {x[0] + along * k[0], x[1] + along * k[1]};
      const auto r = [&](std::size_t i) { return r_[0][i] + at * (r_[1][i] + at * r_[2][i]); };
      return State{y[1] + r(0), -omega_ * omega_ * y[0] + r(1)};
    };
    const State k1 = rate({}, 0.0, s), k2 = rate(k1, h / 2, s + share / 2), k3 = rate(k2, h / 2, s + share / 2),
                k4 = rate(k3, h, s + share);
    return {x[0] + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]), x[1] + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])};
  }
  double omega_, digits_, h_ = 0.0;
  int pieces_ = 1;
  State start_{};
  std::array<State, 3> r_{};
};

/// A fast oscillator in a slow wind: x'' = -omega^2 x + cos t - x x'/5.
OdeProblem in_the_wind(double omega, double absolute) {
  return problem(
      2,
      [omega](double t, const double* x, double* xdot) {
        xdot[0] = x[1];
        xdot[1] = -omega * omega * x[0] + std::cos(t) - 0.2 * x[0] * x[1];
        return true;
      },
      absolute);
}

TEST(Multirate, IsOfOrderFour) {
  const auto error = [](double h) {
    IntegratorOptions o = adaptive("multirate", 0.9);
    o.max_step = o.initial_step = h;
    auto integrator = make_by(exp_sin(1e3), o);
    return integrate(*integrator, 0.0, {1.0}, 2.0)[0] - std::exp(std::sin(2.0));
  };
  const double coarse = error(0.125), fine = error(0.0625);
  EXPECT_NEAR(std::log2(std::abs(coarse / fine)), 4.0, 0.4) << coarse << " " << fine;
}

/// Pieces are as many as the linear part asks for, evaluations follow what is left: errors follow the tolerance, both of them.
TEST(Multirate, KeepsTheErrorsOfStepsAndOfPiecesApart) {
  std::vector<long> calls;
  for (const double omega : {3.0, 30.0, 300.0})
    for (const double tolerance : {1e-4, 1e-6, 1e-8}) {
      const auto exact = make_integrator(in_the_wind(omega, 1e-14), adaptive("dop853", 1e-13));
      const Values start = {0.01, 0.0}, wanted = integrate(*exact, 0.0, start, 2.0);
      OdeProblem p = in_the_wind(omega, 0.01 * tolerance);
      p.linear = [=](const std::string&) { return std::make_shared<CoarseOscillator>(omega); };
      const auto integrator = make_integrator(p, adaptive("multirate", tolerance));
      const Values x = integrate(*integrator, 0.0, start, 2.0);
      const IntegratorStatistics s = integrator->statistics();
      EXPECT_LT(std::abs(x[1] - wanted[1]), 100.0 * tolerance * 0.01 * omega) << omega << " " << tolerance;
      EXPECT_LT(std::abs(x[0] - wanted[0]), 100.0 * tolerance * 0.01) << omega << " " << tolerance;
      if (tolerance == 1e-6) calls.push_back(s.rhs_calls);
      if (tolerance == 1e-6 && omega == 300.0) {
        EXPECT_GT(s.inner_steps, 20 * s.rhs_calls);
        EXPECT_LT(10 * s.rhs_calls, exact->statistics().rhs_calls);
      }
    }
  EXPECT_LT(calls[2], 20 * calls[0]);  // a hundred times as fast; what of the wind swings with it sets the steps
}

/// Where pieces are known to a tenth of the tolerance alone, shorter ones tell no more, and are not taken.
TEST(Multirate, TakesNoShorterPiecesForTheirRounding) {
  const double tolerance = 1e-8, omega = 30.0;
  std::vector<long> inner;
  for (const double digits : {0.0, 1e-11}) {
    const auto exact = make_integrator(in_the_wind(omega, 1e-14), adaptive("dop853", 1e-13));
    const Values start = {0.01, 0.0}, wanted = integrate(*exact, 0.0, start, 2.0);
    OdeProblem p = in_the_wind(omega, 0.01 * tolerance);
    p.linear = [=](const std::string&) { return std::make_shared<CoarseOscillator>(omega, digits); };
    const auto integrator = make_integrator(p, adaptive("multirate", tolerance));
    const Values x = integrate(*integrator, 0.0, start, 2.0);
    EXPECT_LT(std::abs(x[0] - wanted[0]), 100.0 * tolerance * 0.01) << digits;
    inner.push_back(integrator->statistics().inner_steps);
  }
  EXPECT_LT(inner[1], 2 * inner[0]) << inner[0];
}

/// A linear part that no number of pieces resolves ends the run.
TEST(Multirate, SaysWhereNoNumberOfPiecesIsEnough) {
  OdeProblem p = in_the_wind(1e9, 1e-10);
  p.linear = [](const std::string&) { return std::make_shared<CoarseOscillator>(1e9); };
  IntegratorOptions o = adaptive("multirate", 1e-8);
  o.initial_step = 1.0;
  auto integrator = make_integrator(p, o);
  double x[2] = {1.0, 0.0};
  integrator->restart(1e3, x);
  integrator->step(1e3 + 1.0, x);
  EXPECT_LT(integrator->statistics().last_step, 1e-4);
  EXPECT_GT(integrator->statistics().rejected.all(), 5);
}

}  // namespace
}  // namespace cardan::test
