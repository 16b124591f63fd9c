#pragma once
// Published numbers against ours: what each comparison reaches stays in the report of the tests, out of which `./dev accuracy` makes
// docs/accuracy_record.md.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <string>

#include "tests/support/worse.hpp"

namespace cardan::test {

/// The file of tests/reference/cases that the test at hand reads; set by its readers.
inline std::string& case_at_hand() {
  static std::string id;
  return id;
}

/// published, ours: as shown; empty where nothing is published: of what is conserved.
inline void keep_accuracy(const std::string& what, const std::string& published, const std::string& ours, double difference,
                          double tolerance) {
  ::testing::Test::RecordProperty(fmt::format("accuracy|{}|{}", case_at_hand(), what),
                                  fmt::format("{}|{}|{:.3g}|{:.3g}", published, ours, difference, tolerance));
}

/// |ours / published - 1| within the tolerance.
inline void expect_relative(const std::string& what, double ours, double published, double tolerance) {
  const double difference = std::abs(ours / published - 1.0);
  keep_accuracy(what, fmt::format("{:.12g}", published), fmt::format("{:.12g}", ours), difference, tolerance);
  EXPECT_LE(difference, tolerance) << what << ": " << ours << " in place of " << published;
}

/// |ours - published| within the tolerance.
inline void expect_absolute(const std::string& what, double ours, double published, double tolerance) {
  const double difference = std::abs(ours - published);
  keep_accuracy(what, fmt::format("{:.12g}", published), fmt::format("{:.12g}", ours), difference, tolerance);
  EXPECT_LE(difference, tolerance) << what << ": " << ours << " in place of " << published;
}

/// As expect_absolute, of angles that count up to whole turns; `scale`: what the tolerance is relative to.
inline void expect_angle(const std::string& what, double ours, double published, double tolerance, double scale = 1.0) {
  const double off = std::remainder(ours - published, 2.0 * std::numbers::pi), difference = std::abs(off) / scale;
  keep_accuracy(what, fmt::format("{:.12g}", published), fmt::format("{:.12g}", published + off), difference, tolerance);
  EXPECT_LE(difference, tolerance) << what << ": " << ours << " in place of " << published;
}

/// The difference of two lists within the tolerance.
inline void expect_list(const std::string& what, const Eigen::VectorXd& ours, const Eigen::VectorXd& published, double difference,
                        double tolerance) {
  const auto text = [](const Eigen::VectorXd& x) {
    std::string out;
    for (const double one : x) out += fmt::format("{}{:.12g}", out.empty() ? "" : ", ", one);
    return out;
  };
  keep_accuracy(what, text(published), text(ours), difference, tolerance);
  EXPECT_LE(difference, tolerance) << what;
}

/// The largest difference of the entries, over `scale`, within the tolerance.
template <class A, class B>
void expect_vector(const std::string& what, const Eigen::MatrixBase<A>& ours, const Eigen::MatrixBase<B>& published, double tolerance,
                   double scale = 1.0) {
  expect_list(what, ours, published, distance(ours, published) / scale, tolerance);
}

/// Each entry by itself: |ours / published - 1| within the tolerance.
inline void expect_entries(const std::string& what, const Eigen::VectorXd& ours, const Eigen::VectorXd& published, double tolerance) {
  expect_list(what, ours, published, ours.size() == published.size() ? largest(ours.cwiseQuotient(published).array() - 1.0) : kInfinity,
              tolerance);
}

}  // namespace cardan::test
