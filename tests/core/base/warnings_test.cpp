#include "core/base/warnings.hpp"

#include <gtest/gtest.h>

namespace cardan {
namespace {

Located place(const char* key, int line) { return {key, {"no_such_file.yaml", line, 1}}; }

TEST(Warnings, AreToldOnceAndCounted) {
  Warnings all;
  all.add(Code::beyond_the_model, place("bodies.wing", 3), "turns at 2 rad/s, its first mode has 1 rad/s", "level 2", 4.5);
  all.add(Code::beyond_the_model, place("bodies.wing", 3), "turns at 3 rad/s, its first mode has 1 rad/s", "level 2", 5.5);
  all.add(Code::beyond_the_model, place("bodies.boom", 9), "other");
  ASSERT_EQ(all.all().size(), 2u);
  EXPECT_EQ(all.all()[0].count, 2);
  EXPECT_EQ(all.all()[0].t, 4.5);
  const std::string text = render(all);
  EXPECT_NE(text.find("warning[W0301]: turns at 2 rad/s"), std::string::npos) << text;
  EXPECT_NE(text.find("2 times, first at t = 4.5 s"), std::string::npos) << text;
  EXPECT_NE(text.find("\n2 warnings.\n"), std::string::npos) << text;
  EXPECT_EQ(render(Warnings{}), "");
}

TEST(Warnings, OfOthersKeepTheirCounts) {
  Warnings a, b;
  b.add(Code::beyond_the_model, place("x", 1), "first", {}, 1.0);
  b.add(Code::beyond_the_model, place("x", 1), "second", {}, 2.0);
  a.add(b);
  ASSERT_EQ(a.all().size(), 1u);
  EXPECT_EQ(a.all()[0].count, 2);
}

TEST(Warnings, BeyondTheLimitAreCountedOnly) {
  Warnings all;
  for (int i = 0; i < 250; ++i) all.add(Code::mission_doubt, place("k", i), "one more");
  EXPECT_EQ(all.all().size(), Warnings::kLimit);
  EXPECT_EQ(all.left_out(), 50);
  EXPECT_NE(render(all).find("250 warnings, 50 of them not shown.\n"), std::string::npos);
}

}  // namespace
}  // namespace cardan
