#include "core/io/bounded_child.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>

#include "core/base/diagnostic.hpp"

namespace cardan {
namespace {

std::string answer(const std::function<std::string()>& work, const ChildLimits& limits = {}) {
  try {
    return in_bounded_child("results.h5", work, limits);
  } catch (const InputError& e) {
    return std::string(number_of(e.diagnostics().at(0).code)) + ": " + e.diagnostics().at(0).got;
  }
}

TEST(BoundedChild, AnswersWithWhatItComputed) {
  const std::string long_text(5'000'000, 'x');  // more than a pipe holds
  EXPECT_EQ(answer([&] { return long_text; }), long_text);
  EXPECT_EQ(answer([] { return std::string(); }), "");
  EXPECT_EQ(answer([] { return std::string("a\0b", 3); }), std::string("a\0b", 3));
}

TEST(BoundedChild, LeavesThisProcessAsItIs) {
  int here = 1;
  answer([&] { return std::to_string(++here); });
  EXPECT_EQ(here, 1);
}

TEST(BoundedChild, HandsOverWhatWasThrown) {
  const Diagnostic d{Code::wrong_unit, {"bodies.a", {"v.yaml", 3, 4}}, "a mass", "12 m", "kg?", "stack", "about", 5};
  try {
    in_bounded_child("results.h5", [&]() -> std::string { throw InputError({d, d}); }, {});
    FAIL();
  } catch (const InputError& e) {
    ASSERT_EQ(e.diagnostics().size(), 2u);
    EXPECT_EQ(render(e.diagnostics()[1]), render(d));
    EXPECT_EQ(e.diagnostics()[1].at.mark.column, 4);
    EXPECT_EQ(e.diagnostics()[1].span, 5);
  }
  const RunFailure f{Code::not_finite, 2.5, "b", "h", "x = nan", "smaller", "run.h5"};
  try {
    in_bounded_child("results.h5", [&]() -> std::string { throw NumericsError(f); }, {});
    FAIL();
  } catch (const NumericsError& e) {
    EXPECT_EQ(render(e.failure()), render(f));
  }
  EXPECT_EQ(answer([]() -> std::string { throw std::runtime_error("odd"); }), "C0702: odd");
}

TEST(BoundedChild, ThatDiesIsAnError) {
  EXPECT_EQ(answer([]() -> std::string {
              std::raise(SIGKILL);
              return "";
            }),
            "C0702: the library that reads it crashed (Killed)");
  EXPECT_EQ(answer([]() -> std::string { std::_Exit(3); }), "C0702: the library that reads it gave up");
  EXPECT_EQ(answer([]() -> std::string { std::_Exit(0); }), "C0702: the process that reads it gave half an answer");
}

TEST(BoundedChild, ThatComputesForEverIsEnded) {
  volatile bool on = true;
  EXPECT_EQ(answer(
                [&]() -> std::string {
                  while (on) {
                  }
                  return "";
                },
                {.cpu_s = 1.0}),
            "C0702: reading it takes more than 1 s of processor time");
}

#ifndef CARDAN_ADDRESS_CHECKS  // limits of addresses and the checks of addresses exclude each other
TEST(BoundedChild, ThatAsksForTooMuchMemoryIsEnded) {
  // The second one computes its answer and has no room left to hand it over.
  for (const std::size_t bytes : {std::size_t{1} << 31, std::size_t{150} << 20})
    EXPECT_EQ(answer([=]() -> std::string { return std::string(bytes, 'x'); }, {.memory = std::size_t{256} << 20}),
              "C0702: it takes more than 256 MiB of memory to read");
}
#endif

}  // namespace
}  // namespace cardan
