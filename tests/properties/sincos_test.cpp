// Sines and cosines as the sweeps form them, in the instruction set that runs: the kernels' own loop (core/soa/sincos.hpp), one
// state at a time and in lanes, against 50 digits.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <numbers>
#include <random>

#include "core/dynamics/forward.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

using Exact = boost::multiprecision::cpp_bin_float_50;
constexpr int kAngles = 64;

/// Bodies on the world, each on a revolute hinge about y: their angles are q.
std::shared_ptr<const Model> star() {
  static const auto model = [] {
    std::vector<BodySpec> bodies;
    for (int i = 0; i < kAngles; ++i)
      bodies.push_back(on(rigid("b" + std::to_string(i), 1.0, {0.1, 0.2, 0.3}, diagonal({1, 1.2, 1.3})), "", "revolute", {{0, 1, 0}}));
    return compiled(system(std::move(bodies)));
  }();
  return model;
}

/// Distance from sine and cosine of x in units of the last place of the exact value.
double ulps(double computed, const Exact& exact) {
  const double nearest = std::abs(static_cast<double>(exact)), place = std::nextafter(nearest, INFINITY) - nearest;
  const double e = static_cast<double>(abs(Exact(computed) - exact)) / place;
  return std::isfinite(e) ? e : HUGE_VAL;
}

/// The sweeps' sines and cosines of x, W of them side by side where T holds W numbers.
template <class T>
void with(const soa::Sweeps<T>& S, const std::vector<double>& x, std::vector<double>& s, std::vector<double>& c) {
  constexpr std::size_t W = sizeof(T) / sizeof(double), n = kAngles * W;
  const auto model = star();
  soa::Workspace<T> ws(*model);
  struct alignas(64) Numbers {
    double x[n];
  };
  const auto q = std::make_unique<Numbers>();
  s.resize(x.size()), c.resize(x.size());
  for (std::size_t first = 0; first < x.size(); first += n) {
    const std::size_t count = std::min(n, x.size() - first);
    for (std::size_t i = 0; i < n; ++i) q->x[i] = i < count ? x[first + i] : 0.0;
    soa::Inputs<T> in;
    in.q = reinterpret_cast<const T*>(q->x);
    S.hinge_records(*model, ws, in);
    std::copy_n(reinterpret_cast<const double*>(ws.sines.data()), count, s.begin() + static_cast<std::ptrdiff_t>(first));
    std::copy_n(reinterpret_cast<const double*>(ws.cosines.data()), count, c.begin() + static_cast<std::ptrdiff_t>(first));
  }
}

/// Angles that are hard to reduce: the doubles next to multiples of pi/4, where a sine or cosine is as small as it gets or polynomials
/// change; next to the limit of the fast path and far beyond (the C library); tiny ones; and some at random in every magnitude.
std::vector<double> angles() {
  std::vector<double> all{0.0, -0.0, 5e-324, 1e-310, 1e-20, 1e-8, 99999.99999999999, 1e5, 100000.00000000001, 1e10, 1e22};
  const Exact quarter = boost::math::constants::pi<Exact>() / 4;
  std::mt19937_64 rng(1);
  const auto next_to = [&](long k) {
    const double x = static_cast<double>(quarter * k);
    all.insert(all.end(), {x, std::nextafter(x, 0.0), std::nextafter(x, INFINITY)});
  };
  for (long k = 1; k <= 200; ++k) next_to(k);
  for (int i = 0; i < 600; ++i) next_to(static_cast<long>(rng() % 127323));  // up to 1e5
  for (int i = 0; i < 3000; ++i)
    all.push_back(std::ldexp(1.0 + static_cast<double>(rng() >> 12) * 0x1p-52, static_cast<int>(rng() % 47) - 30));
  const std::size_t n = all.size();
  for (std::size_t i = 0; i < n; ++i) all.push_back(-all[i]);
  return all;
}

double worst(const std::vector<double>& x, const std::vector<double>& s, const std::vector<double>& c) {
  double most = 0.0, at = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Exact exact = x[i];
    const double e = std::max(ulps(s[i], sin(exact)), ulps(c[i], cos(exact)));
    if (e > most) most = e, at = x[i];
  }
  ::testing::Test::RecordProperty("worst", fmt::format("{:.3f} ulp at {}", most, at));
  return most;
}

TEST(SinesOfTheSweeps, AreWithinOneUnitInTheLastPlace) {
  const std::vector<double> x = angles();
  std::vector<double> s, c;
  with(soa::sweeps<double>(), x, s, c);
  EXPECT_LT(worst(x, s, c), 1.0);
}

TEST(SinesOfTheSweeps, HaveTheSameBitsInLanes) {
  const std::vector<double> x = angles();
  std::vector<double> s, c, s_lanes, c_lanes;
  with(soa::sweeps<double>(), x, s, c);
  const auto same = [&] {
    for (std::size_t i = 0; i < x.size(); ++i) {
      ASSERT_EQ(s[i], s_lanes[i]) << x[i];
      ASSERT_EQ(c[i], c_lanes[i]) << x[i];
    }
  };
  if (soa::instruction_set().four.hinge_records) with(soa::instruction_set().four, x, s_lanes, c_lanes), same();
  if (soa::instruction_set().eight.hinge_records) with(soa::instruction_set().eight, x, s_lanes, c_lanes), same();
}

TEST(SinesOfTheSweeps, OfWhatIsNoNumberAreNone) {
  std::vector<double> s, c;
  with(soa::sweeps<double>(), {0.0, INFINITY, -INFINITY, NAN, 3.0}, s, c);
  EXPECT_EQ(s[0], 0.0);
  EXPECT_EQ(c[0], 1.0);
  for (const std::size_t i : {1u, 2u, 3u}) EXPECT_TRUE(std::isnan(s[i]) && std::isnan(c[i])) << i;
  EXPECT_NEAR(s[4], std::sin(3.0), 3e-17) << "what stands beside such an angle keeps its sine";
}

}  // namespace
}  // namespace cardan::test
