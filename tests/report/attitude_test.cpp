#include "scripts/report/attitude.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace cardan {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
using Quaternion = std::vector<double>;  // w, x, y, z

Quaternion about(int axis, double degrees) {
  Quaternion q{std::cos(0.5 * kDegree * degrees), 0, 0, 0};
  q[static_cast<std::size_t>(axis) + 1] = std::sin(0.5 * kDegree * degrees);
  return q;
}
Quaternion operator*(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

AttitudeAngles angles_of(int rows, const std::function<Quaternion(int)>& attitude) {
  std::vector<double> all;
  for (int i = 0; i < rows; ++i) {
    const Quaternion q = attitude(i);
    all.insert(all.end(), q.begin(), q.end());
  }
  return attitude_angles(all, static_cast<std::size_t>(rows));
}
double at(const AttitudeAngles& angles, int row, int column) { return angles.rows[static_cast<std::size_t>(4 * row + column)]; }

// Yaw about z, then pitch about the new y, then roll about the new x, from wherever it began. Rounding of a product of four quaternions.
TEST(AttitudeAngles, AreThoseOfTheThreeRotations) {
  const Quaternion start = about(0, 50) * about(2, -130);
  const auto angles = angles_of(41, [&](int i) { return start * about(2, 2.0 * i) * about(1, 1.5 * i) * about(0, -3.0 * i); });
  for (int i = 0; i <= 40; ++i) {
    EXPECT_NEAR(at(angles, i, 1), 2.0 * i, 1e-11);
    EXPECT_NEAR(at(angles, i, 2), 1.5 * i, 1e-11);
    EXPECT_NEAR(at(angles, i, 3), -3.0 * i, 1e-11);
  }
  EXPECT_EQ(angles.jumps, 0u);
  EXPECT_EQ(at(angles, 0, 0), 0.0);
}

// Several turns about each axis; about y they lead through the attitudes where yaw and roll cannot be told apart.
TEST(AttitudeAngles, GoOnBeyondAWholeTurn) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double step : {5.0, -7.0, 44.9}) {
      const auto angles = angles_of(100, [&](int i) { return about(axis, step * i); });
      EXPECT_EQ(angles.jumps, 0u);
      for (int i = 0; i < 100; ++i) {
        for (int k = 0; k < 3; ++k)
          EXPECT_NEAR(at(angles, i, 1 + k), k == 2 - axis ? step * i : 0.0, 1e-6) << "axis " << axis << " row " << i;
        const double turn = std::abs(std::remainder(step * i, 360.0));
        EXPECT_NEAR(at(angles, i, 0), turn, 1e-6);
      }
    }
}

// The sign of a quaternion, and its length, mean nothing.
TEST(AttitudeAngles, DoNotDependOnTheSignOfTheQuaternion) {
  const auto angles = angles_of(90, [](int i) {
    Quaternion q = about(2, 4.0 * i) * about(0, 10);
    for (double& c : q) c *= i % 3 == 0 ? -2.0 : 1e-3;
    return q;
  });
  EXPECT_EQ(angles.jumps, 0u);
  for (int i = 0; i < 90; ++i)
    EXPECT_NEAR(std::remainder(at(angles, i, 1) - at(angles, 0, 1), 360.0), std::remainder(at(angles, i, 1), 360.0), 1e-9);
}

TEST(AttitudeAngles, BreakWhereNobodyKnowsWhichWayItWent) {
  const auto angles = angles_of(10, [](int i) { return about(2, i < 5 ? 0.0 : 170.0); });
  EXPECT_EQ(angles.jumps, 1u);
  EXPECT_TRUE(std::isnan(at(angles, 5, 1)) && std::isnan(at(angles, 5, 0)));
  EXPECT_NEAR(at(angles, 6, 1), 170.0, 1e-11);
}

// A slew about one axis, followed with a small error about another: 2e-9 rad are rounding of its quaternions.
TEST(AttitudeAngles, FromACommandAreTheErrorRowByRow) {
  std::vector<double> command, attitude;
  for (int i = 0; i < 50; ++i) {
    const Quaternion c = about(2, 20.0 * i) * about(0, 40), q = c * about(1, 0.01 * i);
    command.insert(command.end(), c.begin(), c.end()), attitude.insert(attitude.end(), q.begin(), q.end());
  }
  std::fill_n(command.begin() + 4 * 7, 4, NAN);
  const auto angles = attitude_angles(attitude, 50, command);
  EXPECT_EQ(angles.jumps, 0u);
  for (int i = 0; i < 50; ++i) {
    if (i == 7) {
      EXPECT_TRUE(std::isnan(at(angles, i, 0))) << "nobody knows where it ought to be";
      continue;
    }
    EXPECT_NEAR(at(angles, i, 0), 0.01 * i, 1e-7);
    EXPECT_NEAR(at(angles, i, 2), 0.01 * i, 1e-7);
    EXPECT_NEAR(at(angles, i, 1), 0.0, 1e-7);
  }
}

TEST(AttitudeAngles, OfNoAttitudeAreNone) {
  const auto angles = angles_of(4, [](int i) {
    return i == 0 ? Quaternion{0, 0, 0, 0} : i == 2 ? Quaternion{NAN, 0, 0, 1} : about(2, 30.0 * i);
  });
  EXPECT_TRUE(std::isnan(at(angles, 0, 0)));
  EXPECT_EQ(at(angles, 1, 1), 0.0) << "the first that is one is the reference";
  EXPECT_TRUE(std::isnan(at(angles, 2, 1)));
  EXPECT_NEAR(at(angles, 3, 1), 60.0, 1e-11);
}

}  // namespace
}  // namespace cardan
