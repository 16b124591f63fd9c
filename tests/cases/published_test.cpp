// What published cases are compared by.
#include "tests/cases/published.hpp"

#include <gtest/gtest-spi.h>

#include "tests/support/worse.hpp"

namespace cardan::test {
namespace {

TEST(Published, NaNAndOtherSizesAreWithinNothing) {
  case_at_hand().clear();  // of no case
  EXPECT_NONFATAL_FAILURE(expect_within("an error", kNaN, 1e300), "an error");
  EXPECT_NONFATAL_FAILURE(expect_within("an error", 0.0, kNaN), "an error");
  expect_within("an error", 1.0, 1.0);
  const Eigen::Vector3d good(1, 2, 3);
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector3d bad = good;
    bad[i] = kNaN;
    for (const auto& [ours, published] : {std::pair{bad, good}, {good, bad}}) {
      EXPECT_NONFATAL_FAILURE(expect_vector("an error", ours, published, 1e300), "an error");
      EXPECT_NONFATAL_FAILURE(expect_entries("an error", ours, published, 1e300), "an error");
    }
  }
  EXPECT_NONFATAL_FAILURE(expect_angle("an error", kNaN, 1.0, 1e300), "an error");
  const Eigen::VectorXd longer = Eigen::VectorXd::Ones(3), shorter = Eigen::VectorXd::Ones(2);
  EXPECT_NONFATAL_FAILURE(expect_vector("an error", longer, shorter, 1e300), "an error");
  EXPECT_NONFATAL_FAILURE(expect_entries("an error", longer, shorter, 1e300), "an error");
}

}  // namespace
}  // namespace cardan::test
