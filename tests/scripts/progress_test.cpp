#include "scripts/commands/progress.hpp"

#include <gtest/gtest.h>

namespace cardan {
namespace {

TEST(Progress, ShowsBothTimesWithTheSameDecimals) {
  EXPECT_EQ(progress_text(12.345678, 400.0, 1.0, 0.1), "t = 12.3 of 400.0 s   12.3 times real time   0:31 left");
  EXPECT_EQ(progress_text(328044.2, 1.1354e8, 100.0, 0.1),
            "t = 328044 of 113540000 s   3.28e+03 times real time   9:35:11 left, steps of 1.0e-01 s");
  EXPECT_EQ(progress_text(14300.0, 1e300, 1.0, 0.1),
            "t = 1.430e+04 of 1e+300 s   1.43e+04 times real time   more than 1000 years left, steps of 1.0e-01 s");
  EXPECT_EQ(progress_text(0.25, 0.5, 1.0, 0.1), "t = 0.2500 of 0.5000 s   0.25 times real time   0:01 left");
}

TEST(Progress, MovesWhereARunHardlyDoes) {
  const std::string a = progress_text(1.5e-6, 2.0, 10.0, 3e-12), b = progress_text(1.6e-6, 2.0, 11.0, 3e-12);
  EXPECT_NE(a, b);
  EXPECT_EQ(a, "t = 1.500e-06 of 2.000 s   1.5e-07 times real time   154 days left, steps of 3.0e-12 s");
  EXPECT_EQ(progress_text(1e-15, 1e9, 10.0, 1e-16),
            "t = 1.000e-15 of 1000000000 s   1e-16 times real time   more than 1000 years left, steps of 1.0e-16 s");
  EXPECT_EQ(progress_text(0.0, 2.0, 10.0, 0.0), "t = 0.000 of 2.000 s   0 times real time   ? left");
}

}  // namespace
}  // namespace cardan
