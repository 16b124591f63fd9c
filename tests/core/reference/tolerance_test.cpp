// The scales of the reference vectors: tests/reference/oracle/README.md, section Tolerances.
#include "tests/support/tolerance.hpp"

#include <gtest/gtest.h>

namespace cardan::oracle {
namespace {

const nlohmann::json kFile = nlohmann::json::parse(R"({
  "state": {"v": ["3"]},
  "input": {"tau": ["-8", "1"]},
  "expected": {
    "M": [["4", "1"], ["1", "2"]], "bias": ["0", "1e-35"], "gravity_force": ["0.5", "-2"], "elastic_force": ["0", "0"],
    "external_force": ["0", "0"], "vdot": ["-2", "0"],
    "kinetic_energy": "50", "gravity_potential": "-2e8", "elastic_energy": "0", "total_mass": "4", "log_det_M": "0.2",
    "linear_momentum": ["0", "1e-6", "0"], "angular_momentum_about_ground_origin": ["0", "0", "0"],
    "hinge_wrench_on_body_at_pnode": [["1"], ["-20"]], "dM_dtheta": [["0"]], "dtau_dv": ["0.1"],
    "nodes": [{"velocity": ["0"], "classical_acceleration": ["5"]}], "qdot": ["0"]}})");

TEST(OracleScale, FollowsTheRulesOfTheReadme) {
  const Comparator c(kFile);
  EXPECT_EQ(c.scale("M"), 4.0);  // own largest entry
  EXPECT_EQ(c.scale("gravity_force"), 2.0);
  EXPECT_EQ(c.scale("bias"), 8.0);              // zero: the largest force of the file, input.tau
  EXPECT_EQ(c.scale("nodes/0/velocity"), 3.0);  // zero: the largest velocity, state.v
  EXPECT_EQ(c.scale("qdot"), 1.0);              // zero without a group: absolute
  EXPECT_EQ(c.scale("log_det_M"), 1.0);
  EXPECT_EQ(c.scale("dtau_dv"), 1.0);
  EXPECT_EQ(c.scale("dM_dtheta/0"), 4.0);
  EXPECT_EQ(c.scale("hinge_wrench_on_body_at_pnode/0"), 20.0);
  EXPECT_DOUBLE_EQ(c.scale("linear_momentum"), 1e-3 * 20.0);
  EXPECT_EQ(c.scale("kinetic_energy"), 200.0);  // 1e-6 of the largest energy
}

TEST(OracleScale, MeasuresTheLargestDifference) {
  const Comparator c(kFile);
  EXPECT_DOUBLE_EQ(c.error("gravity_force", Eigen::Vector2d(0.5, -1.5)), 0.25);
  EXPECT_DOUBLE_EQ(c.scalar_error("kinetic_energy", 48.0), 0.01);
  EXPECT_EQ(c.error("gravity_force", Eigen::Vector3d::Zero()), HUGE_VAL);
  EXPECT_EQ(c.error("gravity_force", Eigen::Vector2d(NAN, -2.0)), HUGE_VAL);
}

TEST(OracleScale, ResidualWeighsAgainstForcesAndInertia) {
  const Comparator c(kFile);
  // r = M vdot - (tau + gravity): [-8 - 0 - (-7.5), -2 - (-1)] = [-0.5, -1]; scale = max(8, |M_ii vdot_i|) = 8
  EXPECT_DOUBLE_EQ(c.residual(Eigen::Vector2d(-2.0, 0.0)), 1.0 / 8.0);
  EXPECT_DOUBLE_EQ(c.residual(Eigen::Vector2d(-2.0, 0.0), {true, false}), 0.5 / 8.0);
  EXPECT_EQ(c.residual(Eigen::Vector2d(NAN, 0.0)), HUGE_VAL);
}

}  // namespace
}  // namespace cardan::oracle
