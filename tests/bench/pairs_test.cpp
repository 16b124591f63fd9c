// The judgement of `./dev bench --against`, on times that are made up.
#include "bench/pairs.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace cardan::bench {
namespace {

std::vector<double> times(double factor, std::vector<double> noise = {1.0, 1.01, 0.99, 1.005, 0.995}) {
  for (double& x : noise) x *= 100.0 * factor;
  return noise;
}

TEST(Pairs, OfOneProgramAreNotSlower) {
  const Verdict v = judge(times(1.0), times(1.0));
  EXPECT_EQ(v.ratio, 1.0);
  EXPECT_EQ(v.spread, 0.0);
  EXPECT_FALSE(v.slower);
}

TEST(Pairs, FourPerCentInEveryPairIsSlower) { EXPECT_TRUE(judge(times(1.0), times(1.04)).slower); }

TEST(Pairs, TwoPerCentInEveryPairIsAllowed) { EXPECT_FALSE(judge(times(1.0), times(1.02)).slower); }

TEST(Pairs, FasterIsNeverSlower) { EXPECT_FALSE(judge(times(1.0), times(0.5)).slower); }

TEST(Pairs, ADriftOfTheMachineIsInBothOfAPairAndDoesNotCount) {
  const std::vector<double> drift{1.0, 1.2, 1.5, 1.9, 2.4};
  EXPECT_FALSE(judge(times(1.0, drift), times(1.01, drift)).slower);
  EXPECT_TRUE(judge(times(1.0, drift), times(1.05, drift)).slower);
}

TEST(Pairs, OneDisturbedPairDecidesNothing) {
  std::vector<double> after = times(1.0);
  after[2] *= 10.0;
  EXPECT_FALSE(judge(times(1.0), after).slower);
}

TEST(Pairs, WhatSpreadsMoreThanItGrowsIsNotJudgedSlower) {
  // quartiles at 0.96 and 1.12: the median 1.05 is less than 3 % beyond half of their distance
  const Verdict v = judge({100, 100, 100, 100, 100}, {90, 96, 105, 112, 120});
  EXPECT_NEAR(v.spread, 0.08, 1e-12);
  EXPECT_FALSE(v.slower);
}

TEST(Pairs, WhatIsNoTimeFails) {
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_TRUE(judge({100.0, 100.0}, {100.0, bad}).slower) << bad;
    EXPECT_TRUE(judge({bad, 100.0}, {100.0, 100.0}).slower) << bad;
  }
  EXPECT_THROW(judge({1.0}, {}), std::invalid_argument);
  EXPECT_THROW(judge({}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace cardan::bench
