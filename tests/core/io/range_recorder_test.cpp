#include "core/io/range_recorder.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/worse.hpp"

namespace cardan {
namespace {

struct Nowhere final : Recorder {
  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double, std::span<const double>) override { ++rows; }
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}
  int rows = 0;
};

using test::kInfinity, test::kNaN;

Range range_of(std::initializer_list<double> values) {
  Nowhere nowhere;
  RangeRecorder recorder(nowhere);
  recorder.begin({}, {{"a", {"a"}, "m", "", ""}});
  for (const double x : values) recorder.row(0.0, {&x, 1});
  EXPECT_EQ(nowhere.rows, static_cast<int>(values.size()));
  return recorder.ranges()[0];
}

TEST(RangeRecorder, KeepsTheLeastAndTheLargestOfEachNumber) {
  const Range r = range_of({2.0, -3.0, 1.0});
  EXPECT_EQ(r.least, -3.0);
  EXPECT_EQ(r.largest, 2.0);
  EXPECT_EQ(range_of({1.0, kInfinity}).largest, kInfinity);
}

TEST(RangeRecorder, IsEmptyWithoutRows) {
  const Range r = range_of({});
  EXPECT_GT(r.least, r.largest);
}

TEST(RangeRecorder, KeepsANaNFirstInTheMiddleOrLast) {
  for (const auto& values : {std::initializer_list<double>{kNaN, 1.0, 2.0}, {1.0, kNaN, 2.0}, {1.0, 2.0, kNaN}, {kNaN, kNaN}}) {
    const Range r = range_of(values);
    EXPECT_TRUE(std::isnan(r.least));
    EXPECT_TRUE(std::isnan(r.largest));
  }
}

}  // namespace
}  // namespace cardan
