// The laws of the hinge concept over everything in the registry: built-in and loaded from a plugin.
#include <gtest/gtest.h>

#include <set>

#include "core/abi/family.hpp"
#include "core/abi/laws.hpp"
#include "hinges/register.hpp"
#include "tests/support/random_tree.hpp"

namespace cardan {
namespace {

const Registry& registry() {
  static const Registry r = [] {
    Registry all;
    register_hinges(all);
    load_plugin(CARDAN_BINARY_DIR "/plugins/custom_cam.so", all);
    return all;
  }();
  return r;
}

/// The same by names: each case is a process, and the trials of a plugin as it is loaded take as long as most cases.
std::vector<std::string> types() {
  Registry built_in;
  register_hinges(built_in);
  std::vector<std::string> all = built_in.hinges.types();
  all.push_back("custom_cam");
  return all;
}

class HingeContract : public testing::TestWithParam<std::string> {};

TEST_P(HingeContract, ObeysEveryLaw) {
  const auto violations = hinge_law_violations(*registry().hinge(GetParam()), 40, 7);
  for (const auto& v : violations) ADD_FAILURE() << GetParam() << ": " << v;
}
INSTANTIATE_TEST_SUITE_P(Registry, HingeContract, testing::ValuesIn(types()), [](const auto& tested) { return tested.param; });

TEST(HingeLaws, AreAskedOfEveryTypeOfTheRegistry) {
  const std::vector<std::string> tried = types(), all = registry().hinges.types();
  EXPECT_EQ(std::set(tried.begin(), tried.end()), std::set(all.begin(), all.end()));
}

TEST(RandomTrees, AreMadeOfEveryBuiltInHinge) {
  Registry built_in;
  register_hinges(built_in);
  const std::vector<std::string> types = built_in.hinges.types();
  EXPECT_EQ(std::set<std::string>(types.begin(), types.end()), std::set<std::string>(test::kAllHinges.begin(), test::kAllHinges.end()));
}

// A hinge whose map has the wrong sign must be caught: the laws are only worth what they refuse.
struct WrongSign {
  static constexpr const char* type = "test/wrong_sign";
  static constexpr const char* summary = "";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {};
  static constexpr const char* q_names[] = {"s"};
  static constexpr const char* q_units[] = {"m"};
  static constexpr const char* v_names[] = {"rate"};
  static constexpr const char* v_units[] = {"m/s"};
  static bool pack(const Params&, Packed&) { return true; }
  static void kinematics(const Packed&, const double* q, const double*, HingeOut<1>& out) noexcept {
    out.p_OP = Eigen::Vector3d(q[0], 0, 0);
    out.Ht[3] = -1;
  }
};

// Singular at 0.5 m, where no difference tells the slope; one part in `wrong` is wrong beside it.
template <int wrong>
struct Singular : WrongSign {
  static constexpr const char* type = "test/singular";
  static void kinematics(const Packed&, const double* q, const double* v, HingeOut<1>& out) noexcept {
    const double x = q[0] - 0.5;
    out.p_OP = Eigen::Vector3d(std::log(std::abs(x)), 0, 0);
    out.Ht[3] = (wrong ? 1.0 + 1.0 / wrong : 1.0) / x;
    out.Hdot_v[3] = -v[0] * v[0] / (x * x);
  }
};

TEST(HingeLaws, TellASingularPointFromAWrongHinge) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const auto none = hinge_law_violations(hinge_table<Singular<0>>(), 1000, seed);
    EXPECT_TRUE(none.empty()) << none.front();
    EXPECT_GT(hinge_law_violations(hinge_table<Singular<1000000>>(), 1000, seed).size(), 990u);
  }
  EXPECT_TRUE(hinge_law_violations(hinge_table<WrongSign>(), 1, 1).front().ends_with("(limit 1e-09, sample 0, q = [0])"));
}

TEST(HingeLaws, RefuseAMapOfTheWrongSign) { EXPECT_FALSE(hinge_law_violations(hinge_table<WrongSign>()).empty()); }

}  // namespace
}  // namespace cardan
