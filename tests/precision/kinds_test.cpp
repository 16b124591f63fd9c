// Errors by physical kind, of numbers that are given.
#include "scripts/precision/kinds.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/worse.hpp"

namespace cardan {
namespace {

Column column(const std::string& path, std::vector<std::string> components, const std::string& unit, std::vector<double> values) {
  const std::size_t n = components.size();
  return {path, std::move(components), units_of_components(unit, n), std::move(values)};
}
RunColumns run_of(std::vector<Column> columns, std::vector<double> times = {0, 1}) {
  RunColumns out;
  out.times = std::move(times);
  out.columns = std::move(columns);
  return out;
}
KindError error_in(const KindErrors& all, const char* kind) {
  const auto& one = all.at(index_of_kind(kind));
  EXPECT_TRUE(one.has_value()) << kind;
  return one.value_or(KindError{});
}

TEST(PrecisionKinds, AnAttitudeIsOffByTheAngleOfTheRotationBetween) {
  const std::vector<std::string> wxyz = {"w", "x", "y", "z"};
  // A quarter turn about x, then one about y by 1e-9 in body axes; in the second row the sign of the quaternion is the other one.
  const double c = std::sqrt(0.5), h = 0.5e-9;
  const auto truth = run_of({column("bodies/bus/attitude", wxyz, "1", {c, c, 0, 0, c, c, 0, 0})});
  const auto is = run_of({column("bodies/bus/attitude", wxyz, "1", {c, c, 0, 0, -c, -c, -c * h, -c * h})});
  const KindError e = error_in(errors_of_run(is, truth), "attitude");
  EXPECT_LT(std::abs(e.final / 1e-9 - 1.0), 1e-6) << "round-off of 1e-16 beside 1e-9";
  EXPECT_EQ(e.largest, e.final);
  EXPECT_LT(std::abs(e.l2 / (1e-9 * std::sqrt(0.5)) - 1.0), 1e-6) << "of two instants one is off";
  EXPECT_EQ(e.channel, "bodies/bus/attitude");
}

TEST(PrecisionKinds, APositionIsOffByTheDistanceAndTheWorstChannelIsNamed) {
  const std::vector<std::string> xyz = {"x", "y", "z"};
  const auto truth =
      run_of({column("bodies/a/position", xyz, "m", {1, 2, 3, 1, 2, 3}), column("nodes/a.tip/position", xyz, "m", {0, 0, 0, 0, 0, 0}),
              column("hinges/s/travel", {"travel"}, "m", {1, 1})});
  const auto is =
      run_of({column("bodies/a/position", xyz, "m", {1, 2, 3, 1, 2.5, 3}), column("nodes/a.tip/position", xyz, "m", {3, 0, 4, 0, 0, 0}),
              column("hinges/s/travel", {"travel"}, "m", {1, 1.25})});
  const KindError e = error_in(errors_of_run(is, truth), "position");
  EXPECT_EQ(e.largest, 5.0);
  EXPECT_EQ(e.channel, "nodes/a.tip/position");
  EXPECT_EQ(e.final, 0.5);
  EXPECT_EQ(e.l2, std::sqrt((25.0 + 0.25) / 2));
  EXPECT_EQ(e.size, std::sqrt(14.0));
}

TEST(PrecisionKinds, ModesForcesAndSignalsAreRelativeToTheirLargest) {
  const auto truth =
      run_of({column("modes/w/eta", {"1", "2"}, "1", {3, 4, 0, 0}), column("modes/still/eta", {"1"}, "1", {0, 0}),
              column("reactions/w", {"mx", "my", "mz", "fx", "fy", "fz"}, "N*m N*m N*m N N N", {0, 8, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0}),
              column("pointing/error", {"e"}, "deg", {2, 1})});
  const auto is =
      run_of({column("modes/w/eta", {"1", "2"}, "1", {3, 4, 0, 1}), column("modes/still/eta", {"1"}, "1", {0, 0}),
              column("reactions/w", {"mx", "my", "mz", "fx", "fy", "fz"}, "N*m N*m N*m N N N", {0, 8, 0, 0, 0, 2, 1, 0, 0, 0, 1, 0}),
              column("pointing/error", {"e"}, "deg", {2, 0.5})});
  const KindErrors e = errors_of_run(is, truth);
  EXPECT_EQ(error_in(e, "modes").largest, 1.0 / 5);
  EXPECT_EQ(error_in(e, "forces").largest, 1.0 / 2) << "forces and moments each by their own size";
  EXPECT_EQ(error_in(e, "signals").largest, 0.25);
  EXPECT_FALSE(e[index_of_kind("angle")].has_value()) << "there is no hinge";
}

TEST(PrecisionKinds, ABalanceIsItsOwnError) {
  const auto truth =
      run_of({column("ledger/energy", {"residual"}, "1", {0, 3e-12}), column("ledger/angular_momentum", {"residual"}, "1", {0, 1e-9}),
              column("loops/residual", {"residual"}, "1", {1e-13, 0})});
  const KindErrors e = errors_of_run(truth, truth);
  EXPECT_EQ(error_in(e, "energy").final, 3e-12);
  EXPECT_EQ(error_in(e, "momentum").largest, 1e-9);
  EXPECT_EQ(error_in(e, "constraint").largest, 1e-13);
}

TEST(PrecisionKinds, WhatOneOfTheTwoHasNotIsAnInfiniteError) {
  const auto truth = run_of({column("a/b", {"x"}, "m", {test::kNaN, 1})});
  EXPECT_EQ(error_in(errors_of_run(truth, truth), "signals").largest, 0.0) << "both have none at first";
  const auto is = run_of({column("a/b", {"x"}, "m", {test::kNaN, test::kNaN})});
  EXPECT_EQ(error_in(errors_of_run(is, truth), "signals").largest, test::kInfinity);
  EXPECT_EQ(error_in(errors_of_run(is, truth), "signals").l2, test::kInfinity);
}

TEST(PrecisionKinds, ModesThatAreLeftOutCountAsZero) {
  const auto truth = run_of({column("modes/wing/eta", {"1", "2"}, "1", {3, 4, 0, 1})}, {0, 1});
  const auto fewer = run_of({column("modes/wing/eta", {"1"}, "1", {3, 0.5})}, {0, 1});
  const KindError e = error_in(errors_of_run(fewer, truth), "modes");
  EXPECT_DOUBLE_EQ(e.largest, 0.8);
  EXPECT_DOUBLE_EQ(e.final, std::hypot(0.5, 1.0) / 5.0);
  const auto others = run_of({column("modes/wing/eta", {"2"}, "1", {3, 0.5})}, {0, 1});
  EXPECT_FALSE(errors_of_run(others, truth)[index_of_kind("modes")]) << "not the first of them: another body";
}

TEST(PrecisionKinds, ARunThatEndsEarlierIsComparedWhereBothAre) {
  const auto truth = run_of({column("hinges/a/angle", {"angle"}, "rad", {1, 2, 3})}, {0, 1, 1.75});
  const auto is = run_of({column("hinges/a/angle", {"angle"}, "rad", {1, 2.5, 9})}, {0, 1, 1.5});
  const KindErrors e = errors_of_run(is, truth);
  EXPECT_EQ(error_in(e, "angle").final, 0.5);
  EXPECT_EQ(error_in(e, "end").final, 0.25);
}

}  // namespace
}  // namespace cardan
