// What published cases are compared by.
#include "tests/cases/published.hpp"

#include <gtest/gtest-spi.h>

#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

TEST(Published, NaNIsWithinNothing) {
  case_at_hand().clear();  // of no case
  EXPECT_NONFATAL_FAILURE(expect_within("an error", kNaN, 1e300), "an error");
  EXPECT_NONFATAL_FAILURE(expect_within("an error", 0.0, kNaN), "an error");
  expect_within("an error", 1.0, 1.0);
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector3d bad(1, 2, 3);
    bad[i] = kNaN;
    EXPECT_TRUE(std::isnan(apart(bad, Eigen::Vector3d(1, 2, 3))));
    EXPECT_TRUE(std::isnan(apart(Eigen::Vector3d(1, 2, 3), bad)));
  }
  EXPECT_EQ(apart(Eigen::VectorXd::Ones(3), Eigen::VectorXd::Ones(2)), HUGE_VAL);
}

}  // namespace
}  // namespace cardan::test
