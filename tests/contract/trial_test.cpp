#include "core/abi/trial.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <stdexcept>

namespace cardan {
namespace {

TEST(Trial, OfWhatReturnsOrThrowsTellsNothing) {
  EXPECT_EQ(end_in_child([](const TellPhase&) {}), std::nullopt);
  EXPECT_EQ(end_in_child([](const TellPhase&) { throw std::runtime_error("told by the parent"); }), std::nullopt);
}

TEST(Trial, TellsHowAChildEndedAndWhere) {
  EXPECT_EQ(end_in_child([](const TellPhase& phase) {
              phase("the first part");
              phase("the second part");
              std::raise(SIGSEGV);
            }),
            "Segmentation fault, in the second part");
  EXPECT_EQ(end_in_child([](const TellPhase&) { std::exit(0); }), "the process was ended (exit)");
  EXPECT_EQ(end_in_child([](const TellPhase&) { _exit(0); }), "the process was ended (exit)");
  EXPECT_EQ(end_in_child([](const TellPhase&) { throw 42; }), "an exception that is no std::exception");
  EXPECT_EQ(end_in_child([](const TellPhase& phase) { phase("a wait"), pause(); }, {.cpu_s = 5, .wall_s = 0.2}),
            "no answer within 0.2 s, in a wait");
}

TEST(Trial, ChangesNothingHere) {
  int seen = 1;
  end_in_child([&](const TellPhase&) { seen = 2; });
  EXPECT_EQ(seen, 1);
}

}  // namespace
}  // namespace cardan
