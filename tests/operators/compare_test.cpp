// The comparators of the tests themselves: NaN equals nothing, wherever it stands.
#include "tests/operators/compare.hpp"

namespace cardan::test {
namespace {

/// The vector and the matrix 1, 2, 3, ... with x at one place, for every place and length up to what lanes hold twice.
template <class F>
void with_one(double x, F&& f) {
  for (Eigen::Index n = 1; n <= 17; ++n)
    for (Eigen::Index at = 0; at < n; ++at) {
      VectorXd good = VectorXd::LinSpaced(n, 1.0, static_cast<double>(n)), bad = good;
      bad[at] = x;
      f(MatrixXd(good), MatrixXd(bad));
      f(MatrixXd(good.transpose().replicate(3, 1)), MatrixXd(bad.transpose().replicate(3, 1)));
    }
}

TEST(Worse, IsNaNWhereAnyIs) {
  EXPECT_EQ(worse(1.0, 2.0), 2.0);
  EXPECT_EQ(worse(2.0, 1.0), 2.0);
  EXPECT_EQ(worse({-3.0, -2.0, -4.0}), -2.0);
  EXPECT_EQ(worse(1.0, kInfinity), kInfinity);
  EXPECT_TRUE(std::isnan(worse(kNaN, 1.0)));
  EXPECT_TRUE(std::isnan(worse(1.0, kNaN)));
  EXPECT_TRUE(std::isnan(worse({kNaN, kInfinity, 1.0})));
  EXPECT_TRUE(std::isnan(worse({1.0, kNaN, kInfinity})));
  EXPECT_TRUE(std::isnan(worse({1.0, kInfinity, kNaN})));
  EXPECT_TRUE(std::isnan(worse(kNaN, kNaN)));
}

TEST(Largest, IsNaNWhereAnEntryIs) {
  EXPECT_EQ(largest(MatrixXd(0, 3)), 0.0);
  EXPECT_EQ(largest(Vector3d(1.0, -5.0, 2.0)), 5.0);
  EXPECT_EQ(largest(Vector3d(1.0, -5.0, 2.0).array() + 1.0), 4.0);
  with_one(kNaN, [](const MatrixXd&, const MatrixXd& bad) { EXPECT_TRUE(std::isnan(largest(bad))) << bad; });
  with_one(-kInfinity, [](const MatrixXd&, const MatrixXd& bad) { EXPECT_EQ(largest(bad), kInfinity) << bad; });
}

TEST(Relative, IsSmallBesideNothingInfinite) {
  EXPECT_EQ(relative(0.0, 0.0), 0.0);
  EXPECT_EQ(relative(1.0, 0.0), kInfinity);
  EXPECT_EQ(relative(1.0, 4.0), 0.25);
  for (const double size : {kNaN, kInfinity, -kInfinity}) EXPECT_TRUE(std::isnan(relative(1.0, size)));
  EXPECT_TRUE(std::isnan(relative(kNaN, 1.0)));
  EXPECT_TRUE(std::isnan(relative(kNaN, 0.0)));
}

/// What every comparator of two things owes: no limit lets NaN or infinity pass, on either side or on both.
template <class F>
void refuses(F&& error) {
  for (const double x : {kNaN, kInfinity, -kInfinity})
    with_one(x, [&](const MatrixXd& good, const MatrixXd& bad) {
      EXPECT_LE(error(good, good), 0.0);
      EXPECT_FALSE(error(bad, good) <= 1e300) << bad;
      EXPECT_FALSE(error(good, bad) <= 1e300) << bad;
      EXPECT_FALSE(error(bad, bad) <= 1e300) << bad;
    });
  EXPECT_FALSE(error(VectorXd::Constant(5, kNaN), VectorXd::Ones(5)) <= 1e300);
  EXPECT_FALSE(error(VectorXd::Ones(5), VectorXd::Constant(5, kNaN)) <= 1e300);
  EXPECT_EQ(error(VectorXd(0), VectorXd(0)), 0.0);
  EXPECT_EQ(error(VectorXd::Zero(3), VectorXd::Zero(3)), 0.0);
  EXPECT_FALSE(error(VectorXd::Ones(3), VectorXd::Ones(4)) <= 1e300);
  EXPECT_FALSE(error(VectorXd(0), VectorXd::Ones(4)) <= 1e300);
  EXPECT_FALSE(error(VectorXd::Ones(4), VectorXd(0)) <= 1e300);
  EXPECT_NEAR(error(Vector3d(1.0, 2.0, 4.0), Vector3d(1.0, 2.5, 4.0)), 0.125, 1e-15);
}

TEST(Comparators, LetNothingPassThatIsNoNumber) {
  refuses([](const MatrixXd& a, const MatrixXd& b) { return differ(a, b); });
  refuses([](const MatrixXd& a, const MatrixXd& b) { return apart(a, b); });
  refuses([](const MatrixXd& a, const MatrixXd& b) { return 0.25 * distance(a, b); });
  const auto flat = [](const MatrixXd& a) { return VectorXd(a.reshaped()); };
  refuses([&](const MatrixXd& a, const MatrixXd& b) {
    return apart(ByBody{{"other", Vector3d::Ones()}, {"this", flat(a)}}, ByBody{{"other", Vector3d::Ones()}, {"this", flat(b)}});
  });
  for (const double scale : {kNaN, kInfinity}) {
    EXPECT_FALSE(differ(Vector3d::Ones(), Vector3d::Zero(), scale) <= 1e300);
    EXPECT_FALSE(apart(Vector3d::Ones(), Vector3d::Zero(), scale) <= 1e300);
  }
  EXPECT_FALSE(apart(ByBody{}, ByBody{{"this", Vector3d::Ones()}}) <= 1e300);
}

TEST(Comparators, OfNodesLetNothingPassThatIsNoNumber) {
  using Nodes = std::map<std::string, Vector6d>;
  const Nodes good{{"a", Vector6d::Ones()}, {"b", 2.0 * Vector6d::Ones()}};
  EXPECT_EQ(apart(good, good), 0.0);
  for (const double x : {kNaN, kInfinity})
    for (int i = 0; i < 6; ++i)
      for (const char* name : {"a", "b"}) {
        Nodes bad = good;
        bad[name][i] = x;
        EXPECT_FALSE(apart(bad, good) <= 1e300);
        EXPECT_FALSE(apart(good, bad) <= 1e300);
        EXPECT_FALSE(apart(bad, bad) <= 1e300);
      }
}

TEST(Comparators, ConditionOfAMatrixWithNaNIsNaN) {
  with_one(kNaN, [](const MatrixXd&, const MatrixXd& bad) { EXPECT_TRUE(std::isnan(scaled_condition(bad * bad.transpose()))); });
}

TEST(Property, FailsWhereItsErrorIsNoNumberOrItThrows) {
  const RandomTree tree = random_tree(1, {.bodies = 2});
  EXPECT_EQ(error_of([](const RandomTree&) { return kNaN; }, tree), HUGE_VAL);
  EXPECT_EQ(error_of([](const RandomTree&) -> double { throw std::runtime_error("no"); }, tree), HUGE_VAL);
}

}  // namespace
}  // namespace cardan::test
