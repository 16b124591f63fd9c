// What becomes of the results of a run: whatever happens to it, to the folder or to its output, none is lost and none is false.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <thread>
#include <tuple>

#include "core/base/diagnostic.hpp"
#include "core/io/bounded_child.hpp"
#include "core/io/hdf5_file.hpp"
#include "core/io/result_folder.hpp"
#include "tests/scripts/run_program.hpp"
#include "tests/support/sanitized.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kLong = "mission.duration=1000 day";  // ended by the test

/// Rows of results; fails unless all channels have as many.
std::size_t rows_of(const std::string& out) {
  const Hdf5File file = Hdf5File::open(out + "/run.h5");
  const std::size_t rows = file.shape("/time").at(0);
  for (const std::string& path : file.datasets("/channels")) EXPECT_EQ(file.shape(path).at(0), rows) << path;
  return rows;
}

/// A run that has written its header and goes on.
void expect_under_way(const std::string& out) {
  ASSERT_TRUE(wait_until([&] { return fs::exists(out + "/run.h5"); }));
}

TEST(Results, OfARunSurviveASecondOneIntoTheSameFolder) {
  const TemporaryFolder dir;
  Started first({"run", "pendulum", "--out", dir.path(), "--set", kLong, "--quiet"}, kMissions);
  expect_under_way(dir.path());
  const Finished second = run_program({"run", "pendulum", "--out", dir.path()}, kMissions);
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_EQ(replaced(second.err, dir.path(), "DIR"),
            "error[C0701]: result cannot be written\n"
            "  --> DIR\n"
            "  expected: a folder that no other run writes to\n"
            "  got:      a run that is going on\n"
            "  hint:     wait for its end, or choose another folder by --out DIR\n\n"
            "1 error. Nothing was run.\n");
  first.send(SIGTERM);
  EXPECT_EQ(first.wait().exit_code, 143);
  EXPECT_GT(rows_of(dir.path()), 0u);
  EXPECT_EQ(summary_of(dir.path())["verdict"], "interrupted");
  EXPECT_EQ(content_of(dir.path()).size(), 3u) << "nothing of the second is left";
  EXPECT_EQ(run_program({"run", "pendulum", "--out", dir.path()}, kMissions).exit_code, 0) << "the folder is free again";
}

TEST(Results, ThatAReaderHasOpenStayWhatTheyAre) {
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path()}, kMissions).exit_code, 0);
  const Hdf5File open = Hdf5File::open(dir / "run.h5");
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path(), "--until", "3.9"}, kMissions).exit_code, 1) << "one tick is missing";
  EXPECT_EQ(open.read_doubles("/time").values.back(), 4.0);
  EXPECT_EQ(Hdf5File::open(dir / "run.h5").read_doubles("/time").values.back(), 3.9);
}

TEST(Results, AreNotTouchedByARunThatIsRefused) {
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path()}, kMissions).exit_code, 0);
  const auto before = content_of(dir.path());
  using Arguments = std::vector<std::string>;
  for (const Arguments& wrong : {Arguments{"--until", "-3"},
                                 {"--until", "0"},
                                 {"--until", "nan"},
                                 {"--until", "inf"},
                                 {"--until", "1e400"},
                                 {"--seed", "-1"},
                                 {"--seed", "1e23"},
                                 {"--seed", "99999999999999999999"},
                                 {"--seed", "18446744073709551616"},
                                 {"--seed", "0x1"},
                                 {"--set", "no.such.thing=1"},
                                 {"--again", dir / "run.h5"}}) {
    Arguments all{"run", "pendulum", "--out", dir.path()};
    all.insert(all.end(), wrong.begin(), wrong.end());
    const Finished run = run_program(all, kMissions);
    EXPECT_EQ(run.exit_code, 2) << wrong[1];
    EXPECT_NE(run.err.find("Nothing was run."), std::string::npos) << run.err;
    EXPECT_EQ(content_of(dir.path()), before) << wrong[1];
  }
  // What is noticed only when the header is written: a signal where there is a channel already.
  const TemporaryFolder scene;
  make_scenario(scene, "vehicle 'vehicle.yaml' mission { duration = 1 } signals { a = {}, ['a/b'] = {} }");
  EXPECT_EQ(run_program({"run", ".", "--out", dir.path()}, scene.path()).exit_code, 2);
  EXPECT_EQ(content_of(dir.path()), before);
}

TEST(Results, OfAnEarlierRunAreGoneWhenARunBegins) {
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path()}, kMissions).exit_code, 0);
  const auto earlier = file_text(dir / "run.h5");
  Started run({"run", "pendulum", "--out", dir.path(), "--set", kLong, "--quiet"}, kMissions);
  ASSERT_TRUE(wait_until([&] { return file_text(dir / "run.h5") != earlier; }));
  run.send(SIGKILL);
  run.wait();
  EXPECT_FALSE(fs::exists(dir / "summary.json")) << "a verdict about another run";
  EXPECT_FALSE(fs::exists(dir / "report.html"));
  rows_of(dir.path());
}

class Interrupted : public testing::TestWithParam<int> {};

TEST_P(Interrupted, RunsEndInOrder) {
  const TemporaryFolder dir;
  Started run({"run", "pendulum", "--out", dir.path(), "--set", kLong}, kMissions, [] { signal(GetParam(), SIG_DFL); });
  ASSERT_TRUE(wait_until([&] { return fs::exists(dir / "run.h5") && fs::file_size(dir / "run.h5") > 200'000; })) << "rows are on disk";
  run.send(GetParam());
  const Finished end = run.wait();
  EXPECT_EQ(end.exit_code, 128 + GetParam());
  EXPECT_NE(end.err.find("interrupted by SIG"), std::string::npos) << end.err;
  const json summary = summary_of(dir.path());
  EXPECT_EQ(summary["verdict"], "interrupted");
  EXPECT_TRUE(summary["checks"].empty()) << "they are about the end, which was not reached";
  EXPECT_LT(summary["simulated_s"], summary["planned_s"]);
  EXPECT_TRUE(fs::exists(dir / "report.html"));
  rows_of(dir.path());
  const Hdf5File file = Hdf5File::open(dir / "run.h5");
  EXPECT_EQ(file.read_doubles("/time").values.back(), summary["simulated_s"]) << "every row is there";
  EXPECT_EQ(file.read_doubles("/restart/t").values.at(0), summary["simulated_s"]);
  EXPECT_EQ(file.text_attribute("/run", "verdict"), "interrupted");
  EXPECT_EQ(json::parse(file.read_text("/attachments/summary")), summary);
}
INSTANTIATE_TEST_SUITE_P(By, Interrupted, testing::Values(SIGINT, SIGTERM, SIGHUP),
                         [](const auto& p) { return std::string(sigabbrev_np(p.param)); });

TEST(Results, OfAScriptThatIsInterruptedAtWorkAreInOrder) {
  const TemporaryFolder dir;
  make_scenario(dir,
                "vehicle 'vehicle.yaml' mission { duration = 1000 }\n"
                "controller { name = 'slow', rate = '10 Hz', step = function() for i = 1, 4000000 do end end }");
  Started run({"run", ".", "--out", "out"}, dir.path());
  expect_under_way(dir / "out");
  run.send(SIGTERM);
  EXPECT_EQ(run.wait().exit_code, 143) << "not a fault of the script";
  EXPECT_EQ(summary_of(dir / "out")["verdict"], "interrupted");
}

TEST(Results, SignalsThatTheStarterIgnoresStayIgnored) {
  const TemporaryFolder dir;
  Started run({"run", "pendulum", "--out", dir.path(), "--set", kLong, "--quiet"}, kMissions,
              [] { signal(SIGHUP, SIG_IGN); });  // as nohup does
  expect_under_way(dir.path());
  run.send(SIGHUP);
  run.send(SIGTERM);
  EXPECT_EQ(run.wait().exit_code, 143);
}

const std::string kTalking =
    "vehicle 'vehicle.yaml' mission { duration = 20 }\n"
    "controller { name = 'talk', rate = '100 Hz', step = function() print(('x'):rep(1000)) end }";

TEST(Results, AreCompleteWhenNobodyReadsTheOutput) {
  const TemporaryFolder dir;
  make_scenario(dir, kTalking);
  const Finished run = run_program({"run", ".", "--out", "out"}, dir.path(), [] {
    int ends[2];
    if (pipe(ends) != 0 || dup2(ends[1], STDOUT_FILENO) < 0) _exit(98);
    close(ends[0]), close(ends[1]);
  });
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(summary_of(dir / "out")["simulated_s"], 20.0);
  EXPECT_EQ(rows_of(dir / "out"), 201u);
}

TEST(Results, AreCompleteWhenTheStandardStreamsAreClosed) {
  const TemporaryFolder dir;
  make_scenario(dir, kTalking);
  const Finished run = run_program({"run", ".", "--out", "out"}, dir.path(), [] { close(0), close(1), close(2); });
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(rows_of(dir / "out"), 201u);
  EXPECT_EQ(run_program({"report", "out/run.h5"}, dir.path()).exit_code, 0) << "no line of text went into it";
}

/// A run that waits at its first tick until somebody reads what it prints: its folder can be changed under it meanwhile.
class Waiting {
 public:
  Waiting(const std::vector<std::string>& arguments, const std::string& folder, const std::function<void()>& in_child = {}) {
    if (pipe(ends_) != 0) throw std::runtime_error("no pipe");
    run_.emplace(arguments, folder, [this, &in_child] {
      dup2(ends_[1], STDOUT_FILENO), close(ends_[0]), close(ends_[1]);
      if (in_child) in_child();
    });
    close(ends_[1]);
  }
  Finished go_on() {
    char buffer[65536];
    std::string out;
    for (ssize_t n; (n = read(ends_[0], buffer, sizeof buffer)) > 0;) out.append(buffer, static_cast<std::size_t>(n));
    close(ends_[0]);
    Finished end = run_->wait();
    end.out = out;
    return end;
  }

 private:
  int ends_[2];
  std::optional<Started> run_;
};
const std::string kFillsThePipe =
    "controller { name = 'fill', rate = '1 Hz', step = function(t) if t == 0 then print(('x'):rep(200000)) end end }\n";

TEST(Results, ThatCouldNotBeWrittenAreNamedAndTheOthersKept) {
  for (const std::string lost : {"summary.json", "report.html"}) {
    const TemporaryFolder dir;
    make_scenario(dir, "vehicle 'vehicle.yaml' mission { duration = 3 }\n" + kFillsThePipe +
                           "check { name = 'good', value = function() return 1 end, below = 2 }");
    Waiting run({"run", ".", "--out", "out", "--quiet"}, dir.path());
    expect_under_way(dir / "out");
    fs::create_directory(dir / ("out/" + lost));
    const Finished end = run.go_on();
    EXPECT_EQ(end.exit_code, 4);
    const std::string kept = lost == "summary.json" ? "out/run.h5, out/report.html" : "out/summary.json, out/run.h5";
    EXPECT_EQ(end.err, "error[C0701]: result cannot be written\n  --> out/" + lost +
                           "\n  expected: a file that can be written\n  got:      Is a directory\n"
                           "  hint:     is the folder there, and is there space?\n\n1 result not written. Kept: " +
                           kept + "\n");
    EXPECT_NE(end.out.find("  pass  good"), std::string::npos) << "the verdicts are on the screen, with --quiet as well";
    EXPECT_EQ(rows_of(dir / "out"), 31u);
    EXPECT_EQ(fs::is_regular_file(dir / "out/summary.json"), lost != "summary.json");
    EXPECT_EQ(fs::is_regular_file(dir / "out/report.html"), lost != "report.html");
    EXPECT_EQ(Hdf5File::open(dir / "out/run.h5").text_attribute("/run", "verdict"), "passed");
  }
}

TEST(Results, AFullDiskIsToldFirstAndWhatElseIsLost) {
  const TemporaryFolder dir;
  make_scenario(dir, "vehicle 'vehicle.yaml' mission { duration = '1 day', output = { rate = '1000 Hz' } }\n" + kFillsThePipe);
  Waiting run({"run", ".", "--out", "out"}, dir.path(), [] {
    const rlimit limit{400'000, 400'000};  // [B] of one file
    setrlimit(RLIMIT_FSIZE, &limit);
  });
  expect_under_way(dir / "out");
  fs::create_directory(dir / "out/summary.json");
  const Finished end = run.go_on();
  EXPECT_EQ(end.exit_code, 3);
  EXPECT_EQ(end.err.find("failure[N0204]: the results cannot be written any more\n"), end.err.find("failure["));
  EXPECT_LT(end.err.find("failure[N0204]"), end.err.find("error[C0701]")) << end.err;
  EXPECT_NE(end.err.find("1 result not written. Kept: out/run.h5\n"), std::string::npos) << end.err;
  EXPECT_EQ(end.err.find("Nothing was run"), std::string::npos);
  EXPECT_GT(rows_of(dir / "out"), 0u);
}

TEST(Results, AreNotSentIntoPipesAndDevices) {
  for (const std::string name : {"run.h5", "summary.json", "report.html"}) {
    const TemporaryFolder dir;
    ASSERT_EQ(mkfifo((dir / name).c_str(), 0600), 0);
    const Finished run = run_program({"run", "pendulum", "--out", dir.path()}, kMissions);
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_NE(run.err.find("got:      a pipe of this name"), std::string::npos) << run.err;
    EXPECT_EQ(content_of(dir.path()).size(), 1u);
  }
  const TemporaryFolder dir;
  fs::create_directory(dir / "report.html");
  EXPECT_EQ(run_program({"run", "pendulum", "--out", dir.path()}, kMissions).exit_code, 2) << "before the run, not after it";
}

TEST(Results, CanBeReadWhileTheRunGoesOn) {
  const TemporaryFolder dir;
  Started run({"run", "pendulum", "--out", dir.path(), "--set", kLong, "--quiet"}, kMissions);
  expect_under_way(dir.path());
  read_between_flushes(dir / "run.h5", [&] {
    const auto read = [&] { return Hdf5File::open(dir / "run.h5").text_attribute("/run", "scenario"); };
    EXPECT_NE(in_bounded_child(dir / "run.h5", read, {}), "");  // whose structure may be that of no flush
  });
  EXPECT_THROW(Hdf5File::update(dir / "run.h5"), InputError) << "who wants to write is refused";
  EXPECT_EQ(run_program({"report", dir / "run.h5", "--out", dir / "so_far.html"}, dir.path()).exit_code, 0);
  run.send(SIGTERM);
  EXPECT_EQ(run.wait().exit_code, 143);
}

/// A reader that meets a file in the middle of a flush, whose structure is that of neither before nor after.
TEST(Results, OfWhichAFlushIsHalfDoneAreReadAfterIt) {
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path()}, kMissions).exit_code, 0);
  const std::string good = file_text(dir / "run.h5");
  std::string half = good;
  std::fill(half.begin(), half.begin() + 100, '\0');
  write(dir / "run.h5", half);
  EXPECT_EQ(run_program({"report", "."}, dir.path()).exit_code, 2) << "of a damaged file nobody waits";
  const int writer = open((dir / "run.h5").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(flock(writer, LOCK_SH), 0);  // as a run that goes on
  for (const std::vector<std::string>& command : {std::vector<std::string>{"report", "."}, {"run", "--again", ".", "--out", "new"}}) {
    write(dir / "run.h5", half);
    fs::last_write_time(dir / "run.h5", fs::file_time_type::clock::now() - std::chrono::hours(1));
    Started reader(command, dir.path());
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // it has met the half-done flush by then, or will meet none
    write(dir / "run.h5", good);
    const Finished end = reader.wait();
    EXPECT_EQ(end.exit_code, 0) << end.err;
  }
  close(writer);
}

TEST(Results, HoldWhatHappened) {
  const TemporaryFolder dir;
  const Finished run = run_program({"run", "phases", "--out", dir.path()}, kMissions);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const Hdf5File file = Hdf5File::open(dir / "run.h5");
  EXPECT_EQ(file.read_texts("/run/phases/text"), (std::vector<std::string>{"push", "coast", "empty", "brake"}));
  EXPECT_EQ(file.read_doubles("/run/phases/t").values, (std::vector<double>{0.0, 0.3, 3.5, 3.5}));
  EXPECT_EQ(file.read_texts("/run/events/text"), (std::vector<std::string>{"rest", "falling"}));
  EXPECT_NEAR(file.read_doubles("/run/events/t").values.at(0), 3.8, 1e-9);
  EXPECT_EQ(summary_of(dir.path())["ended_by"], "stop() in event \"rest\"");
  EXPECT_NE(run.out.find("ended at t = 3.8 of 100 s by stop() in event \"rest\""), std::string::npos) << run.out;
}

/// The column `k` of a list of what happened.
std::vector<std::string> noted(const Hdf5File& file, const std::string& list, std::size_t k) {
  const std::vector<std::string> all = file.read_texts("/run/" + list + "/text");
  std::vector<std::string> out;
  for (std::size_t i = k, columns = file.shape("/run/" + list + "/text").at(1); i < all.size(); i += columns) out.push_back(all[i]);
  return out;
}

constexpr const char* kTalks = R"(
local sat = vehicle 'vehicle.yaml'
print 'before'
mission { duration = 2 }
local log = signals { x = {} }
phase { name = 'first', duration = 1, enter = function() print('enters', 1) end }
controller { name = 'c', rate = '1 Hz', step = function(t) log.x(0/0) if t == 1 then print 'tick <b>\0' end end }
event { name = 'half', when = function(t) return t - 0.5 end, action = function() print 'action' end }
event { name = 'looks', when = function(t) if t == 0 then print 'trial' end return 1 end, action = function() end }
figure { name = 'f', value = function() print 'at the end' return 1 end }
)";

// An event without an action is there to be located. It is looked at in the midst of nothing: t = 0.55 is no row and no tick.
TEST(Results, HoldTheTimesOfEventsWithoutAnAction) {
  const TemporaryFolder dir;
  make_scenario(dir,
                "vehicle 'vehicle.yaml'\nmission { duration = 1, output = { rate = '2 Hz' } }\n"
                "event { name = 'there', direction = 'rising', once = true, when = function(t) return t - 0.55 end }\n");
  ASSERT_EQ(run_program({"run", ".", "--out", "out", "--quiet"}, dir.path()).exit_code, 0);
  const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
  EXPECT_EQ(noted(file, "events", 0), (std::vector<std::string>{"there"}));
  EXPECT_EQ(noted(file, "events", 1), (std::vector<std::string>{"rising"}));
  const auto t = file.read_doubles("/run/events/t").values;
  ASSERT_EQ(t.size(), 1u);
  EXPECT_NEAR(t[0], 0.55, 1e-12);
}

TEST(Results, HoldPrintedLinesAndWarningsWithTheirTimes) {
  const TemporaryFolder dir;
  make_scenario(dir, kTalks);
  ASSERT_EQ(run_program({"run", ".", "--out", "out", "--quiet"}, dir.path()).exit_code, 0);
  const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
  const auto lines = noted(file, "printed", 0), by = noted(file, "printed", 1);
  const auto t = file.read_doubles("/run/printed/t").values;
  const auto at = [&](const std::string& line) {
    return static_cast<std::size_t>(std::find(lines.begin(), lines.end(), line) - lines.begin());
  };
  ASSERT_EQ(lines.size(), t.size());
  for (const auto& [line, who, when] : {std::tuple<std::string, std::string, double>{"enters\t1", "phase \"first\"", 0.0},
                                        {"action", "event \"half\"", 0.5},
                                        {"at the end", "figure \"f\"", 2.0}}) {
    ASSERT_LT(at(line), lines.size()) << line;
    EXPECT_EQ(by[at(line)], who);
    EXPECT_NEAR(t[at(line)], when, 1e-9) << line;
  }
  ASSERT_LT(at("before"), lines.size());
  EXPECT_TRUE(std::isnan(t[at("before")]));
  ASSERT_LT(at("trial"), lines.size());
  EXPECT_EQ(by[at("trial")], "event \"looks\"");
  const auto codes = noted(file, "warnings", 0);
  EXPECT_EQ(std::count(codes.begin(), codes.end(), "W0501"), 1) << "of each kind the first";
  EXPECT_EQ(noted(file, "phases", 0), (std::vector<std::string>{"first", ""}));
  EXPECT_EQ(summary_of(dir / "out")["ended_by"], "the planned end");
}

TEST(Results, OfAKilledRunHoldWhatHappened) {
  const TemporaryFolder dir;
  make_scenario(dir,
                std::string(kTalks) +
                    "controller { name = 'busy', rate = '10 Hz', step = function(t) local x = 0 for i = 1, 1e5 do x = x + i end end }");
  Started run({"run", ".", "--out", "out", "--quiet", "--set", kLong}, dir.path());
  expect_under_way(dir / "out");
  ASSERT_TRUE(wait_until([&] {
    try {
      const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
      return noted(file, "phases", 0).size() == 2 && !noted(file, "events", 0).empty() && noted(file, "printed", 0).size() >= 3;
    } catch (const InputError&) {  // in the middle of a flush; the next one is two seconds off
      return false;
    }
  }));
  run.send(SIGKILL);
  run.wait();
  const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
  const auto warnings = noted(file, "warnings", 1);
  EXPECT_EQ(std::count(warnings.begin(), warnings.end(), "signal x is nan"), 1);
  EXPECT_EQ(noted(file, "events", 0), std::vector<std::string>{"half"});
  EXPECT_GE(noted(file, "printed", 0).size(), 3u);
  EXPECT_EQ(run_program({"report", "out"}, dir.path()).exit_code, 0);
}

TEST(Results, ThatWereTakenAwayAreNotToldToBeKept) {
  const TemporaryFolder dir;
  Started run({"run", "pendulum", "--out", dir.path(), "--set", kLong, "--no-report"}, kMissions);
  expect_under_way(dir.path());
  fs::remove(dir / "run.h5");
  run.send(SIGTERM);
  const Finished end = run.wait();
  EXPECT_EQ(end.exit_code, 143);
  EXPECT_TRUE(has(end.err, "error[C0701]: result cannot be written\n  --> " + dir / "run.h5")) << end.err;
  EXPECT_TRUE(has(end.err, "1 result not written. Kept: " + dir / "summary.json\n")) << end.err;
}

TEST(Results, TellWhatEndedARun) {
  const TemporaryFolder dir;
  Started run({"run", "pendulum", "--out", dir.path(), "--set", kLong, "--quiet"}, kMissions);
  expect_under_way(dir.path());
  run.send(SIGTERM);
  run.wait();
  EXPECT_EQ(summary_of(dir.path())["ended_by"], "SIGTERM");
  make_scenario(dir,
                "vehicle 'vehicle.yaml' mission { duration = 1 }\n"
                "controller { name = 'c', rate = '10 Hz', step = function(t) if t > 0.5 then error 'oh' end end }");
  EXPECT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 3);
  EXPECT_TRUE(summary_of(dir / "out")["ended_by"].get<std::string>().starts_with("N0303: "));
}

TEST(Results, HoldTheShapesOfModes) {
  const TemporaryFolder dir;
  run_program({"run", "flexible", "--out", dir.path(), "--until", "0.1"}, kMissions);  // its checks are for the whole of it
  const Hdf5File file = Hdf5File::open(dir / "run.h5");
  ASSERT_FALSE(file.members("/mode_shapes").empty());
  const auto shape = file.shape("/mode_shapes/0/shapes"), points = file.shape("/mode_shapes/0/points");
  EXPECT_EQ(shape, (std::vector<std::size_t>{file.shape("/mode_shapes/0/frequency").at(0), points.at(0), 3}));
  EXPECT_GT(file.shape("/mode_shapes/0/lines").at(0), 0u);
  const std::vector<double> hz = file.read_doubles("/mode_shapes/0/frequency").values;  // of a cantilever of 4 m, 2 cm x 4 cm
  const double flat = 3.51601526850015 / (2 * std::numbers::pi * 16) * 0.02 * std::sqrt(70e9 / 2700 / 12);
  EXPECT_NEAR(hz[0], flat, 1e-5 * flat);
  EXPECT_NEAR(hz[1], 2 * flat, 2e-5 * flat);
}

TEST(Results, ACheckThatIsNoNumberIsAFailureAndAllIsKept) {
  const TemporaryFolder dir;
  make_scenario(dir,
                "vehicle 'vehicle.yaml' mission { duration = 1 }\n"
                "check { name = 'lost', value = function() return 0/0 end, below = 2 }\n"
                "check { name = 'kept', value = function() return 1 end, below = 2 }\n"
                "figure { name = 'lost', value = function() return missing.value end }\n"
                "figure { name = 'kept', value = function() return 3 end }");
  const Finished run = run_program({"run", ".", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_NE(run.err.find("failure[N0303]"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("check \"lost\""), std::string::npos) << "the first that failed: " << run.err;
  const json summary = summary_of(dir / "out");
  EXPECT_EQ(summary["verdict"], "aborted");
  EXPECT_EQ(summary["failure"]["code"], "N0303");
  ASSERT_EQ(summary["checks"].size(), 1u);
  EXPECT_EQ(summary["checks"][0]["name"], "kept");
  ASSERT_EQ(summary["figures"].size(), 1u);
  EXPECT_EQ(summary["figures"][0]["value"], 3.0);
  EXPECT_TRUE(fs::exists(dir / "out/report.html"));
}

TEST(Program, TextThatDoesNotReachStandardOutputIsAnExitCode) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  for (const char* command : {"describe", "check"}) {
    const Finished run = run_program({command, "pendulum"}, kMissions, [] { dup2(open("/dev/full", O_WRONLY), STDOUT_FILENO); });
    EXPECT_EQ(run.exit_code, 4);
    EXPECT_NE(run.err.find("error[C0701]: result cannot be written\n  --> standard output\n  got:      No space left on device\n"),
              std::string::npos)
        << run.err;
  }
}

/// What a command was to write is there, and the disk is full: neither is its input wrong, nor its verdict another one.
TEST(Program, AFileThatADiskDoesNotTakeIsAnExitCode) {
  const TemporaryFolder dir;
  for (const char* angle : {"30 deg", "31 deg"})
    run_program({"run", "pendulum", "--quiet", "--set", std::string("start=") + angle, "--out", dir / angle}, kMissions);
  const std::string a = dir / "30 deg", b = dir / "31 deg";
  fs::copy(kScripts + "/errors/boom.yaml", dir / "boom.yaml");
  for (const auto& [code, line] : {std::pair{4, std::vector<std::string>{"report", a, "--out", "p"}},
                                   {4, {"report", a, "--plot", "hinges/rod/angle", "--out", "p"}},
                                   {1, {"report", a, b, "--out", "p"}},
                                   {4, {"diff", a, a, "--page", "p"}},
                                   {1, {"diff", a, b, "--json", "p"}},
                                   {4, {"modes", "boom.yaml", "boom", "--out", "p"}}}) {
    write(dir / "p", "before");
    const Finished full = run_program(line, dir.path(), [] {
      const rlimit most{2000, 2000};  // [bytes] of a file
      setrlimit(RLIMIT_FSIZE, &most);
    });
    EXPECT_EQ(full.exit_code, code) << line[0];
    EXPECT_TRUE(has(full.err, "error[C0701]: result cannot be written\n  --> p\n") && !has(full.err, "Nothing was run")) << full.err;
    EXPECT_EQ(file_text(dir / "p"), "before") << line[0];
    std::vector<std::string> data = line;
    data.push_back("--json-errors");
    EXPECT_EQ(nlohmann::json::parse(run_program(data, dir.path(),
                                                [] {
                                                  const rlimit most{2000, 2000};  // [bytes] of a file
                                                  setrlimit(RLIMIT_FSIZE, &most);
                                                })
                                        .err)["exit_code"],
              code);
  }
}

TEST(Program, EndsWithItsCodeWhereStandardErrorTakesNothing) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  const TemporaryFolder dir;
  make_scenario(dir,
                "vehicle 'vehicle.yaml' mission { duration = 1 } check { name = 'lost', value = function() return 0/0 end, below = 2 }");
  const auto ends = [&](const std::vector<std::string>& arguments) {
    return run_program(arguments, dir.path(), [] { dup2(open("/dev/full", O_WRONLY), STDERR_FILENO); }).exit_code;
  };
  EXPECT_EQ(ends({"check", "nowhere"}), 2);
  EXPECT_EQ(ends({"check", "nowhere", "--json-errors"}), 2);
  EXPECT_EQ(ends({"run", ".", "--out", "out"}), 3);
  EXPECT_EQ(ends({"what"}), 2);
}

std::string value_of(const std::vector<std::string>& pairs, const std::string& key) {
  for (std::size_t i = 0; i + 1 < pairs.size(); i += 2)
    if (pairs[i] == key) return pairs[i + 1];
  return "none";
}

TEST(Program, TakesModesFromTheCacheFromItsSecondStartAndResultsAreTheSame) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n  wing:\n    type: modal_flexible\n    hinge: {type: free, to: world, initial: {wx: 0.1}}\n    modal:\n"
        "      plate: {length: 8 m, width: 2 m, solid: {material: {E: 70 GPa, nu: 0.3, rho: 2700}, thickness: 1 cm}, elements_x: 8, "
        "elements_y: 4}\n"
        "      modes: {count: 3}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }");
  const auto run = [&](const std::string& out, const std::string& cache, bool quiet = false) {
    std::vector<std::string> arguments = {"run", ".", "--out", out};
    if (quiet) arguments.push_back("--quiet");
    const Finished done = run_program(arguments, dir.path(), [&] { setenv("CARDAN_CACHE", cache.c_str(), 1); });
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return done.out;
  };
  const std::string line = "modes of wing: from the cache\n";
  EXPECT_EQ(run("first", dir / "cache").find(line), std::string::npos);
  EXPECT_NE(run("second", dir / "cache").find(line), std::string::npos);
  EXPECT_EQ(run("quiet", dir / "cache", true).find(line), std::string::npos);
  EXPECT_EQ(run("off", "off").find(line), std::string::npos);
  EXPECT_EQ(run("nowhere", "/proc/cardan").find(line), std::string::npos);
  const Hdf5File first = Hdf5File::open(dir / "first/run.h5");
  const std::string content = value_of(first.read_texts("/spec/parameters"), "bodies.wing.modal_content");
  EXPECT_EQ(content.size(), 16u);
  for (const char* other : {"second", "quiet", "off", "nowhere"}) {
    const Hdf5File file = Hdf5File::open(dir / other + "/run.h5");
    EXPECT_EQ(file.read_texts("/spec/parameters"), first.read_texts("/spec/parameters"));
    EXPECT_EQ(channels_of(dir / other), channels_of(dir / "first")) << other;
  }
}

// From limits at which the program hardly starts to one that is enough: what is short of memory says so.
TEST(Program, SaysWhenMemoryIsShort) {
  if (test::sanitized) GTEST_SKIP() << "the checks of addresses take more than the limit themselves";
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n  wing:\n    type: modal_flexible\n    hinge: {type: free, to: world}\n    modal:\n"
        "      plate: {length: 8 m, width: 2 m, solid: {material: {E: 70 GPa, nu: 0.3, rho: 2700}, thickness: 1 cm}, elements_x: 40, "
        "elements_y: 20}\n"
        "      modes: {count: 10}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }");
  bool told = false;
  for (rlim_t megabytes = 60; megabytes < 400; megabytes += 10) {
    const Finished run = run_program({"run", ".", "--out", "out", "--quiet"}, dir.path(), [&] {
      setenv("CARDAN_CACHE", "off", 1);
      alarm(120);  // so that a program that hangs fails here
      const rlimit limit{megabytes << 20, megabytes << 20};
      setrlimit(RLIMIT_AS, &limit);
    });
    EXPECT_NE(run.exit_code, -1) << run.err;
    EXPECT_NE(run.exit_code, 70) << run.err;
    told = told || (run.exit_code == 2 && run.err.find("error[C0802]: not enough memory\n  got:      no memory for ") == 0);
    if (run.exit_code == 0) break;
  }
  EXPECT_TRUE(told);
}

/// The machine gives less than the 256 MiB that a script may have: that is what is said, and what was recorded is kept.
TEST(Program, SaysWhenMemoryIsShortInTheRun) {
  if (test::sanitized) GTEST_SKIP() << "the checks of addresses take more than the limit themselves";
  const TemporaryFolder dir;
  make_scenario(
      dir,
      "vehicle 'vehicle.yaml' mission { duration = 10 } local all = {} "
      "controller { rate = '1 Hz', name = 'hoard', step = function(t) if t > 2 then for i = 1, 1e7 do all[#all + 1] = i end end end }");
  bool told = false;
  for (rlim_t megabytes = 56; megabytes < 400 && !told; ++megabytes) {
    const Finished run = run_program({"run", ".", "--out", "out", "--quiet"}, dir.path(), [&] {
      alarm(20);
      const rlimit limit{megabytes << 20, megabytes << 20};
      setrlimit(RLIMIT_AS, &limit);
    });
    EXPECT_EQ(run.err.find("bad_alloc"), std::string::npos) << run.err;
    if (run.exit_code != 3 || run.err.find("C0701") != std::string::npos)
      continue;  // too little to begin with, or for HDF5 beside the script
    told = true;
    EXPECT_EQ(run.err.find("failure[N0205]: not enough memory during the run\n  t = 3 s\n  controller \"hoard\": not enough memory\n  --> "
                           "./scenario.lua:1\n"),
              0u)
        << run.err;
    EXPECT_NE(run.err.find("no more memory for a script that holds"), std::string::npos) << run.err;
    EXPECT_EQ(Hdf5File::open(dir / "out/run.h5").read_doubles("/time").values.back(), 2.9) << "the last row before the tick";
    EXPECT_EQ(summary_of(dir / "out").at("verdict"), "aborted");
  }
  EXPECT_TRUE(told);
}

// ---- provenance and repetition ----

TEST(Provenance, HasWhatTheCommandLineAsksForAndWhatCameOfIt) {
  const TemporaryFolder dir;
  make_scenario(dir,
                "local p = parameters { kp = '6 N m/rad', name = 'x', on = true }\nvehicle 'vehicle.yaml' mission { duration = 1 }\n"
                "initial { rod = { rate = 0.25 } }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out", "--set", "mission.output.rate=5 Hz", "--set",
                         "vehicle.bodies.rod.hinge.initial.angle=30 deg", "--until", "0.7", "--seed", "18446744073709551615"},
                        dir.path())
                .exit_code,
            0);
  const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
  const auto command = file.read_texts("/run/command");
  EXPECT_EQ(command.at(1), "run");
  EXPECT_EQ(command.back(), "18446744073709551615");
  const auto settings = file.read_texts("/run/settings");
  EXPECT_EQ(value_of(settings, "mission.output.rate"), "5 Hz");
  EXPECT_EQ(value_of(settings, "vehicle.bodies.rod.hinge.initial.angle"), "30 deg");
  EXPECT_EQ(file.text_attribute("/run", "until"), "0.7");
  EXPECT_EQ(file.text_attribute("/run", "seed"), "18446744073709551615");
  EXPECT_EQ(fs::canonical(file.text_attribute("/run", "folder")), fs::canonical(dir.path()));
  const auto parameters = file.read_texts("/spec/parameters");
  EXPECT_EQ(value_of(parameters, "initial.rod.angle"), "0.5235987755982988 rad");
  EXPECT_EQ(value_of(parameters, "initial.rod.rate"), "0.25 rad/s");
  EXPECT_EQ(value_of(parameters, "mission.output.period"), "1/5 s");
  EXPECT_EQ(value_of(parameters, "mission.duration"), "1 s");
  EXPECT_EQ(value_of(parameters, "parameters.kp"), "6 N m/rad");
  EXPECT_EQ(value_of(parameters, "parameters.on"), "true");
  const auto files = file.read_texts("/spec/files");
  EXPECT_EQ(value_of(files, "vehicle.yaml"), file_text(dir / "vehicle.yaml"));
  EXPECT_EQ(value_of(files, "scenario.lua"), file_text(dir / "scenario.lua"));
  // The sweeps contract (`fast` by gcc, `on` by clang), whatever the rest does: results name the flags of both, of which the last one
  // counts.
  const std::string sweep_flags = file.text_attribute("/run", "sweep_flags"),
                    contract = sweep_flags.substr(sweep_flags.rfind("-ffp-contract="));
  EXPECT_NE(file.text_attribute("/run", "flags").find("-ffp-contract=off"), std::string::npos);
  EXPECT_TRUE(contract.starts_with("-ffp-contract=fast") || contract.starts_with("-ffp-contract=on")) << sweep_flags;
  EXPECT_TRUE(file.text_attribute("/run", "sweeps").starts_with("x86-64-v"));
}

TEST(Provenance, HasHowHingesAreTurnedAndWhenDevicesSample) {  // places and the first tick alone stood there
  const TemporaryFolder dir;
  write(
      dir / "vehicle.yaml",
      "cardan: 1\nbodies:\n  rod:\n    mass: 1\n    inertia: [1, 1, 1]\n    hinge: {type: revolute, axis: [0, 0, 1], to: {body: world, "
      "orientation: {quaternion_wxyz: [0.6, 0.8, 0, 0]}}}\ndevices:\n  reads: {type: encoder, at: rod.angle, rate: 20 Hz, step: 1 mrad}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  const auto parameters = Hdf5File::open(dir / "out/run.h5").read_texts("/spec/parameters");
  EXPECT_EQ(value_of(parameters, "bodies.rod.hinge.onode.orientation"), "rows [[1, 0, 0], [0, -0.28, -0.96], [0, 0.96, -0.28]]");
  EXPECT_EQ(value_of(parameters, "devices.reads.rate"), "20 Hz");
}

TEST(Again, RepeatsARunBitForBitFromItsResultsAlone) {
  const TemporaryFolder dir;
  fs::copy(kMissions + "/drive", dir / "scene", fs::copy_options::recursive);
  ASSERT_NE(run_program({"run", "scene", "--out", "out", "--set", "mission.output.rate=7 Hz", "--set", "mission.integrator.relative=1e-7",
                         "--until", "1.5", "--seed", "42", "--check-against-reference"},
                        dir.path())
                .exit_code,
            2);
  fs::remove_all(dir / "scene");  // the texts are inside
  const Finished again = run_program({"run", "--again", "out/run.h5"}, dir.path());
  EXPECT_LE(again.exit_code, 1) << again.err;
  EXPECT_EQ(again.err.find("warning"), std::string::npos) << again.err;
  EXPECT_EQ(channels_of(dir / "out"), channels_of(dir / "out/again"));
  json a = summary_of(dir / "out"), b = summary_of(dir / "out/again");
  for (const char* key : {"wall_s", "cpu_s"}) a.erase(key), b.erase(key);
  EXPECT_EQ(a, b);
  const Hdf5File first = Hdf5File::open(dir / "out/run.h5"), second = Hdf5File::open(dir / "out/again/run.h5");
  for (const char* path : {"/run/settings", "/run/inputs", "/spec/files", "/spec/parameters", "/spec/defaults"})
    EXPECT_EQ(first.read_texts(path), second.read_texts(path)) << path;
  for (const char* key : {"seed", "until", "check_against_reference", "integrator", "sweeps"})
    EXPECT_EQ(first.text_attribute("/run", key), second.text_attribute("/run", key)) << key;
  ASSERT_LE(run_program({"run", "--again", "out/again", "--out", "third"}, dir.path()).exit_code, 1) << "a repetition can be repeated";
  EXPECT_EQ(channels_of(dir / "out"), channels_of(dir / "third"));
}

// By the command of docs/results.md. Empty lists, as that of settings, cannot be packed: without -m it packed nothing.
TEST(Again, RepeatsARunThatIsPacked) {
  if (std::system("command -v h5repack > /dev/null") != 0) GTEST_SKIP() << "h5repack is not installed";
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", kMissions + "/pendulum", "--out", "out"}, dir.path()).exit_code, 0);
  const std::string pack = "cd '" + dir.path() + "' && h5repack -m 1024 -f SHUF -f GZIP=4 out/run.h5 packed.h5";
  ASSERT_EQ(std::system(pack.c_str()), 0);
  EXPECT_LT(fs::file_size(dir / "packed.h5"), fs::file_size(dir / "out/run.h5"));
  EXPECT_EQ(run_program({"diff", "out/run.h5", "packed.h5"}, dir.path()).exit_code, 0);
  ASSERT_EQ(run_program({"run", "--again", "packed.h5", "--out", "again"}, dir.path()).exit_code, 0);
  EXPECT_EQ(run_program({"diff", "out", "again"}, dir.path()).exit_code, 0);
}

TEST(Again, WithRequiredModulesNeedsNoFiles) {
  const TemporaryFolder dir;
  make_scenario(dir, "local gains = require 'lib.gains'\nvehicle 'vehicle.yaml' mission { duration = gains.duration }");
  fs::create_directory(dir / "lib");
  write(dir / "lib/gains.lua", "return { duration = 0.5 }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  write(dir / "lib/gains.lua", "return { duration = 0.7 }");
  EXPECT_EQ(run_program({"run", "--again", "out/run.h5"}, dir.path()).exit_code, 0);
  EXPECT_EQ(summary_of(dir / "out/again")["simulated_s"], 0.5);
}

/// The run in out/ is not repeated with another file of that name, nor without one, and the repetition that was there stays.
void expect_refused_without(const TemporaryFolder& dir, const std::string& file) {
  const auto before = content_of(dir / "out/again");
  const Finished changed = run_program({"run", "--again", "out/run.h5"}, dir.path());
  EXPECT_EQ(changed.exit_code, 2);
  EXPECT_NE(changed.err.find("error[C0703]: a file of the run to be repeated has changed"), std::string::npos) << changed.err;
  EXPECT_NE(changed.err.find(file), std::string::npos) << changed.err;
  fs::remove(dir / file);
  const Finished gone = run_program({"run", "--again", "out/run.h5"}, dir.path());
  EXPECT_EQ(gone.exit_code, 2);
  EXPECT_NE(gone.err.find("error[C0703]"), std::string::npos) << gone.err;
  EXPECT_EQ(content_of(dir / "out/again"), before);
}

TEST(Again, RefusesAPluginThatIsAnother) {
  const TemporaryFolder dir;
  fs::copy(CARDAN_BINARY_DIR "/plugins/custom_cam.so", dir / "cam.so");
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n  slider: {mass: 1, inertia: [1, 1, 1], hinge: {type: custom_cam, to: world, axis: [0, 0, 1], a: 0.1, b: 0.2, "
        "c: 0.3}}\n");
  write(dir / "scenario.lua", "plugin 'cam.so' vehicle 'vehicle.yaml' mission { duration = 1 } initial { slider = { rate = 1 } }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  ASSERT_EQ(run_program({"run", "--again", "out/run.h5"}, dir.path()).exit_code, 0);
  EXPECT_EQ(channels_of(dir / "out"), channels_of(dir / "out/again"));
  write(dir / "cam.so", "another");
  expect_refused_without(dir, "cam.so");
}

TEST(Again, RefusesAModalFileThatIsAnother) {
  const TemporaryFolder dir;
  const auto wing = [](const char* thickness) {
    return std::string(
               "cardan: 1\nbodies:\n  wing:\n    type: modal_flexible\n    hinge: {type: free, to: world, initial: {angular_velocity: "
               "[0.1, 0, 0]}}\n    modal:\n"
               "      beam: {length: 2 m, material: {E: 70 GPa, nu: 0.3, rho: 2700}, section: {rectangle: {width: 20 mm, height: ") +
           thickness + "}}, elements: 4}\n      modes: {count: 2}\n";
  };
  const auto write_modes = [&](const char* thickness) {
    write(dir / "source.yaml", wing(thickness));
    const Finished modes = run_program({"modes", "source.yaml", "wing", "--out", "wing.h5"}, dir.path());
    ASSERT_EQ(modes.exit_code, 0) << modes.err;
  };
  write_modes("10 mm");
  EXPECT_EQ(run_program({"modes", "source.yaml", "wing", "--out", "./source.yaml"}, dir.path()).exit_code, 2);
  EXPECT_EQ(file_text(dir / "source.yaml"), wing("10 mm")) << "modes do not go where they come from";
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n  wing:\n    type: modal_flexible\n    modal: {file: wing.h5}\n    hinge: {type: free, to: world, initial: "
        "{angular_velocity: [0.1, 0, 0]}}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  ASSERT_EQ(run_program({"run", "--again", "out/run.h5"}, dir.path()).exit_code, 0);
  EXPECT_EQ(channels_of(dir / "out"), channels_of(dir / "out/again"));
  const std::string same = file_text(dir / "wing.h5");
  write_modes("11 mm");
  expect_refused_without(dir, "wing.h5");
  write(dir / "wing.h5", same);
  EXPECT_EQ(run_program({"run", "--again", "out/run.h5"}, dir.path()).exit_code, 0) << "the same bytes are the same file";
}

TEST(Again, RefusesAMeshThatIsAnother) {  // its hash was not recorded, and the run was that of another body
  const TemporaryFolder dir;
  const auto write_mesh = [&](const char* density) {
    std::string mesh = "PSOLID,1,1\nMAT1,1,7.+10,,.3," + std::string(density) + "\n";
    for (int x = 0; x < 3; ++x)
      for (int i = 0; i < 4; ++i) mesh += fmt::format("GRID,{},,{}.,{}.,{}.\n", 4 * x + i + 1, x, int{i == 1 || i == 2}, int{i > 1});
    write(dir / "arm.bdf", mesh + "CHEXA,1,1,1,2,3,4,5,6,+\n+,7,8\nCHEXA,2,1,5,6,7,8,9,10,+\n+,11,12\n");
  };
  write_mesh("2700.");
  write(
      dir / "vehicle.yaml",
      "cardan: 1\nbodies:\n  arm:\n    type: modal_flexible\n    hinge: {type: free, to: world, initial: {angular_velocity: [0.1, 0, 0]}}\n"
      "    modal: {solid: {mesh: arm.bdf, root: {position: [0, 0, 0], normal: [1, 0, 0]}}, modes: {count: 2}}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 0.01 }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  ASSERT_EQ(run_program({"run", "--again", "out/run.h5"}, dir.path()).exit_code, 0);
  write_mesh("2800.");
  expect_refused_without(dir, "arm.bdf");
}

TEST(Again, DoesNotOverwriteWhatItRepeats) {
  const TemporaryFolder dir;
  make_scenario(dir, "vehicle 'vehicle.yaml' mission { duration = 1 }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  const auto before = content_of(dir / "out");
  const Finished run = run_program({"run", "--again", "out/run.h5", "--out", "./out/../out"}, dir.path());
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find("error[C0801]"), std::string::npos) << run.err;
  for (const char* option : {"--until", "--seed"})
    EXPECT_EQ(run_program({"run", "--again", "out/run.h5", option, "1"}, dir.path()).exit_code, 2);
  EXPECT_EQ(run_program({"run", "--again", "scenario.lua"}, dir.path()).exit_code, 2);
  EXPECT_EQ(content_of(dir / "out"), before);
}

TEST(Again, WarnsWhereTheSweepsAreOthers) {
  const TemporaryFolder dir;
  make_scenario(dir, "vehicle 'vehicle.yaml' mission { duration = 1 }");
  const auto with_v2 = [] { setenv("CARDAN_KERNELS", "v2", 1); };
  if (run_program({"version"}, dir.path(), with_v2).exit_code != 0) GTEST_SKIP() << "no sweeps for v2";
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path(), with_v2).exit_code, 0);
  const Finished run = run_program({"run", "--again", "out/run.h5"}, dir.path());
  if (Hdf5File::open(dir / "out/again/run.h5").text_attribute("/run", "sweeps") == "x86-64-v2") GTEST_SKIP() << "no other sweeps";
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_NE(run.err.find("warning[W0601]: the run was made by another program: then x86-64-v2, now x86-64-v"), std::string::npos)
      << run.err;
  EXPECT_EQ(summary_of(dir / "out/again")["warnings"][0]["code"], "W0601");
  const Finished quiet = run_program({"run", "--again", "out/run.h5", "--quiet"}, dir.path());
  EXPECT_EQ(quiet.err, "warnings: W0601; see out/again/summary.json\n");
  const json data = json::parse(run_program({"run", "--again", "out/run.h5", "--quiet", "--json-errors"}, dir.path()).err);
  EXPECT_EQ(data["warnings"][0]["path"], "sweeps");
  EXPECT_EQ(data["exit_code"], 0);
}

}  // namespace
}  // namespace cardan
