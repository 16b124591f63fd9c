#include "core/base/child_process.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "core/base/poll.hpp"

namespace cardan {
namespace {

using How = ChildEnd::How;

TEST(ChildProcess, WhatItSaidIsThereHoweverItEnded) {
  const ChildEnd well = run_in_child([](const Say& say) { say("one"), say("two"); }, {});
  EXPECT_EQ(well.how, How::ended);
  EXPECT_EQ(well.status, 0);
  EXPECT_EQ(well.said, "onetwo");
  const ChildEnd crash = run_in_child([](const Say& say) { say("one"), std::raise(SIGFPE); }, {});
  EXPECT_EQ(crash.how, How::killed);
  EXPECT_EQ(crash.status, SIGFPE);
  EXPECT_EQ(crash.said, "one");
  const ChildEnd thrown = run_in_child([](const Say& say) { say("one"), throw 1; }, {});
  EXPECT_EQ(thrown.how, How::ended);
  EXPECT_NE(thrown.status, 0);
  EXPECT_EQ(thrown.said, "one");
}

TEST(ChildProcess, EndsThatWaitsForEverAlsoWithItsPipeClosed) {
  for (const bool closes : {false, true}) {
    const ChildEnd late = run_in_child(
        [&](const Say&) {
          for (int fd = 3; closes && fd < 64; ++fd) ::close(fd);
          ::pause();
        },
        {.cpu_s = 5.0, .wall_s = 0.2});
    EXPECT_EQ(late.how, How::late) << closes;
  }
}

TEST(ChildProcess, EndsThatComputesForEverAlsoIfItIgnoresTheSignal) {
  const auto compute = [] {
    while (std::clock() >= 0) {
    }
  };
  EXPECT_EQ(run_in_child([&](const Say&) { compute(); }, {.cpu_s = 1.0}).status, SIGXCPU);
  const ChildEnd stubborn = run_in_child([&](const Say&) { std::signal(SIGXCPU, SIG_IGN), compute(); }, {.cpu_s = 1.0});
  EXPECT_EQ(stubborn.how, How::killed);
  EXPECT_EQ(stubborn.status, SIGKILL);
}

/// Ctrl-C goes to both. It is no crash of the work: the child goes on until its parent has looked whether to end it.
TEST(ChildProcess, LeavesInterruptsToItsParent) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const ChildEnd end = run_in_child([&](const Say& say) { std::raise(signal), say("went on"); }, {});
    EXPECT_EQ(end.how, How::ended) << signal;
    EXPECT_EQ(end.said, "went on") << signal;
  }
  struct Stop {};
  int looked = 0;
  pid_t child = 0;
  const std::string path = testing::TempDir() + "cardan_child_of_" + std::to_string(::getpid());
  const Poll poll([&] {
    std::FILE* file = std::fopen(path.c_str(), "r");
    if (!file || std::fscanf(file, "%d", &child) != 1) child = 0;
    if (file) std::fclose(file);
    if (child > 0 && ++looked > 2) throw Stop();
  });
  const auto wait = [&](const Say&) {
    std::FILE* file = std::fopen(path.c_str(), "w");
    std::fprintf(file, "%d ", ::getpid());
    std::fclose(file);
    ::pause();
  };
  EXPECT_THROW(run_in_child(wait, {}), Stop);
  EXPECT_EQ(::kill(child, 0), -1) << "the child is gone";
  std::remove(path.c_str());
}

/// A command of the shell, run to its end.
ChildEnd shell(const std::string& command, const ChildLimits& limits = {}) {
  RunningProgram program({.command = {"/bin/sh", "-c", command}, .limits = limits});
  while (!program.has_ended()) ::usleep(2000);
  return program.end();
}

TEST(RunningProgram, EndsAsItEndsOrByItsLimits) {
  EXPECT_EQ(shell("exit 3").how, How::ended);
  EXPECT_EQ(shell("exit 3").status, 3);
  EXPECT_EQ(shell("kill -SEGV $$").how, How::killed);
  EXPECT_EQ(shell("kill -SEGV $$").status, SIGSEGV);
  EXPECT_EQ(shell("while :; do :; done", {.cpu_s = 1.0}).status, SIGXCPU);
  EXPECT_EQ(shell("exec sleep 1000", {.wall_s = 0.2}).how, How::late);
  const std::string path = testing::TempDir() + "cardan_grows_" + std::to_string(::getpid());
  EXPECT_EQ(shell("while :; do echo more; done > " + path, {.file_size = 1000}).status, SIGXFSZ);
  std::remove(path.c_str());
}

TEST(ChildProcess, TakesNoMoreMemoryThanItMay) {
#ifdef CARDAN_ADDRESS_CHECKS
  GTEST_SKIP() << "memory is not limited beside the checks of addresses";
#endif
  const auto take = [](std::size_t bytes) {
    return run_in_child(
               [&](const Say& say) {
                 try {
                   std::vector<char> all(bytes, 'x');
                   say(all.back() == 'x' ? "taken" : "");
                 } catch (const std::bad_alloc&) {
                   say("refused");
                 }
               },
               {.memory = std::size_t{64} << 20})
        .said;
  };
  EXPECT_EQ(take(std::size_t{16} << 20), "taken");
  EXPECT_EQ(take(std::size_t{65} << 20), "refused");
}

TEST(ChildProcess, FlushesNothingOfItsParent) {
  const std::string path = testing::TempDir() + "cardan_child_process.txt";
  std::FILE* file = std::fopen(path.c_str(), "w");
  ASSERT_NE(file, nullptr);
  std::fputs("once\n", file);
  const ChildEnd end = run_in_child([](const Say&) { std::exit(3); }, {});
  EXPECT_EQ(end.how, How::ended);
  std::fclose(file);
  file = std::fopen(path.c_str(), "r");
  char text[64] = {};
  const std::size_t n = std::fread(text, 1, sizeof text, file);
  std::fclose(file);
  std::remove(path.c_str());
  EXPECT_EQ(std::string(text, n), "once\n");
}

}  // namespace
}  // namespace cardan
