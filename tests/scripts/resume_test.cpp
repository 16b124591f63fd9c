// cardan run --resume: a run that stopped goes on from its last checkpoint, and nobody can tell from the results.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>

#include "core/io/hdf5_file.hpp"
#include "core/io/recorder.hpp"
#include "tests/scripts/run_program.hpp"
#include "tests/support/sanitized.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Of a run by this method, "dopri5" or "dopri5 between steps".
std::vector<std::string> options_of(const std::string& method) {
  std::vector<std::string> options{"--set", "mission.integrator.method=" + method.substr(0, method.find(' ')), "--seed", "5"};
  if (method.ends_with("between steps")) options.insert(options.end(), {"--set", "mission.output.between_steps=true"});
  if (method == "rk4" || method == "variational") options.insert(options.end(), {"--set", "mission.integrator.step=0.01 s"});
  return options;
}
/// `cardan run` with these after the others.
Finished run_with(const std::vector<std::string>& options, std::vector<std::string> arguments, const TemporaryFolder& dir) {
  arguments.insert(arguments.begin(), "run");
  arguments.insert(arguments.end(), options.begin(), options.end());
  return run_program(arguments, dir.path());
}

/// A pendulum on a controller that remembers, draws and records; phases, events, a line, a warning.
const char* kMission = R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 6, output = { rate = "10 Hz" }, checkpoint = { period = "0.5 s" } }
local rod = sat:hinge "rod"
local m = persist { integral = 0, draws = {}, filter = vector { 0, 0 }, crossings = 0 }
local log = signals { ["own/numbers"] = { components = { "integral", "draw", "filter", "phase" } }, ["own/odd"] = {} }
controller { name = "c", rate = "20 Hz", step = function(t)
  m.integral = m.integral + 0.05 * rod:angle()
  m.draws[#m.draws % 5 + 1] = math.random()
  m.filter[1] = 0.9 * m.filter[1] + 0.1 * rod:rate()
  rod:torque(-0.3 * m.integral - 0.2 * m.filter[1] + 0.01 * (m.draws[1] - 0.5) + (mission.phase() == "push" and 0.5 or 0))
  log["own/numbers"](m.integral, m.draws[1], m.filter[1], mission.phase_time())
  if t == 1.25 then log["own/odd"](0 / 0) print "odd" end
end }
phase { name = "swing", duration = 1.7 }
phase { name = "push", until_ = function(t) return m.crossings >= 3 end, enter = function() print("pushes") end }
phase { name = "rest" }
event { name = "passes", when = function() return rod:angle() - 0.05 end, action = function()
  m.crossings = m.crossings + 1
  if m.crossings == 5 then mission.enter "swing" end
end }
check { name = "crossings", value = function() return m.crossings end, above = 2 }
figure { name = "integral", value = function() return m.integral end }
)lua";

/// Equal but for the time that it took.
void expect_same_results(const std::string& a, const std::string& b) {
  EXPECT_EQ(json(channels_of(a)).dump(), json(channels_of(b)).dump());  // NaN too
  json x = summary_of(a), y = summary_of(b);
  double starts = 0.0;  // by their reasons: with a checkpoint at the end as well
  for (const auto& [key, n] : x["integration"].items())
    if (key.starts_with("restarts_")) starts += n.get<double>();
  EXPECT_EQ(x["restarts"], starts);
  for (const char* key : {"wall_s", "cpu_s"}) x.erase(key), y.erase(key);
  EXPECT_EQ(x, y);
  const Hdf5File first = Hdf5File::open(a + "/run.h5"), second = Hdf5File::open(b + "/run.h5");
  for (const NoteKind& kind : note_kinds()) {
    const std::string path = std::string("/run/") + kind.name;
    EXPECT_EQ(first.read_texts(path + "/text"), second.read_texts(path + "/text")) << path;
    EXPECT_EQ(json(first.read_doubles(path + "/t").values).dump(), json(second.read_doubles(path + "/t").values).dump()) << path;
    EXPECT_EQ(first.read_doubles(path + "/left_out").values, second.read_doubles(path + "/left_out").values) << path;
  }
  EXPECT_EQ(first.read_doubles("/run/steps/numbers").values, second.read_doubles("/run/steps/numbers").values);
  EXPECT_EQ(first.read_texts("/run/steps/worst"), second.read_texts("/run/steps/worst"));
  EXPECT_TRUE(first.read_texts("/restart/checkpoints/text") == second.read_texts("/restart/checkpoints/text"));
}

TEST(Resume, GoesOnAsIfTheRunHadNeverStopped) {
  for (const std::string method : {"dopri5", "dop853", "exponential", "multirate", "rk4", "ark_explicit", "ark_imex", "ark_implicit",
                                   "cvode_adams", "cvode_bdf", "variational", "dop853 between steps"}) {
    const TemporaryFolder dir;
    make_scenario(dir, kMission);
    std::vector<std::string> options = options_of(method);
    if (method.ends_with("between steps")) options.insert(options.end(), {"--set", "mission.output.rate=30 Hz"});
    const auto run = [&](const std::vector<std::string>& arguments) { return run_with(options, arguments, dir); };
    const Finished whole = run({dir.path(), "--out", "whole"});
    ASSERT_LE(whole.exit_code, 1) << whole.err;
    EXPECT_EQ(whole.out.find("cannot be resumed"), std::string::npos) << whole.out;
    EXPECT_EQ(std::ranges::count(Hdf5File::open(dir / "whole/run.h5").read_texts("/run/phases/text"), "swing"), 2) << "back by an event";
    ASSERT_LE(run({dir.path(), "--out", "part", "--until", "2.83"}).exit_code, 1);
    fs::remove(dir / "scenario.lua");  // the texts are in the results
    fs::remove(dir / "vehicle.yaml");
    const Finished rest = run_program({"run", "--resume", "part", "--until", "4.1"}, dir.path());
    ASSERT_LE(rest.exit_code, 1) << rest.err;
    const Finished end = run_program({"run", "--resume", "part/resumed", "--until", "6", "--out", "end"}, dir.path());
    ASSERT_LE(end.exit_code, 1) << end.err;
    expect_same_results(dir / "whole", dir / "end");
    EXPECT_EQ(Hdf5File::open(dir / "end/run.h5").text_attribute("/run", "resumed"), "2.5, 4");
    const Finished early = run_program({"run", "--resume", "part", "--at", "1.4", "--until", "6", "--out", "early"}, dir.path());
    ASSERT_LE(early.exit_code, 1) << early.err;
    expect_same_results(dir / "whole", dir / "early");
  }
}

// Also where the run was stopped in the instant of its last checkpoint, at 2.5 s.
TEST(Resume, GoesOnToTheEndOfTheMissionFromWhatUntilStopped) {
  const TemporaryFolder dir;
  make_scenario(dir, kMission);
  ASSERT_LE(run_program({"run", dir.path(), "--out", "whole"}, dir.path()).exit_code, 1);
  for (const char* until : {"2.5", "2.83"}) {
    ASSERT_LE(run_program({"run", dir.path(), "--out", "part", "--until", until}, dir.path()).exit_code, 1);
    const Finished rest = run_program({"run", "--resume", "part", "--out", "rest"}, dir.path());
    ASSERT_LE(rest.exit_code, 1) << rest.err;
    expect_same_results(dir / "whole", dir / "rest");
  }
  ASSERT_LE(run_program({"run", dir.path(), "--out", "longer", "--until", "7"}, dir.path()).exit_code, 1);
  const Finished again = run_program({"run", "--resume", "longer", "--out", "again"}, dir.path());
  ASSERT_LE(again.exit_code, 1) << again.err;
  expect_same_results(dir / "longer", dir / "again");
}

// A check of what was still to come aborted the run there.
TEST(Resume, GoesOnWhereAFailingCheckMetTheEndThatUntilGave) {
  const TemporaryFolder dir;
  make_scenario(
      dir, std::string(kMission) + "check { name = 'end', value = function() return mission.time() == 6 and 1 or nil end, above = 0 }");
  ASSERT_LE(run_program({"run", dir.path(), "--out", "whole"}, dir.path()).exit_code, 1);
  for (const char* until : {"2.5", "2.83"}) {
    ASSERT_EQ(run_program({"run", dir.path(), "--out", "part", "--until", until}, dir.path()).exit_code, 3);
    const Finished rest = run_program({"run", "--resume", "part", "--out", "rest"}, dir.path());
    ASSERT_LE(rest.exit_code, 1) << rest.err;
    expect_same_results(dir / "whole", dir / "rest");
  }
}

TEST(Resume, GoesOnFromWhatASignalOrAKillLeft) {
  for (const int signal : {SIGTERM, SIGKILL}) {
    const TemporaryFolder dir;
    make_scenario(dir, kMission);
    Started run({"run", ".", "--set", "mission.duration=1000 day", "--out", "out"}, dir.path());
    const std::string results = dir / "out/run.h5";
    // What a killed run has is what was flushed last.
    ASSERT_TRUE(wait_until([&] {
      if (!fs::exists(results) || fs::file_size(results) < 1'000'000) return false;
      try {
        return !Hdf5File::open(results).read_texts("/restart/checkpoints/text").empty();
      } catch (const InputError&) {  // in the middle of a flush; the next one is some way off
        return false;
      }
    }));
    run.send(signal);
    run.wait();
    const double t = Hdf5File::open(results).read_doubles("/restart/checkpoints/t").values.back();
    const std::string until = std::to_string(t + 20);
    const Finished rest = run_program({"run", "--resume", "out/run.h5", "--until", until, "--out", "rest"}, dir.path());
    ASSERT_LE(rest.exit_code, 1) << rest.err;
    const auto resumed = channels_of(dir / "rest"), before = channels_of(dir / "out");
    for (const auto& [path, values] : before) {  // what was recorded before stands
      const std::size_t rows = before.at("/time").size(), width = values.size() / rows;
      const std::size_t kept = static_cast<std::size_t>(std::lround(10 * t)) + 1;
      ASSERT_GE(values.size(), kept * width) << path;
      for (std::size_t i = 0; i < kept * width; ++i)
        ASSERT_TRUE(values[i] == resumed.at(path)[i] || (std::isnan(values[i]) && std::isnan(resumed.at(path)[i]))) << path;
    }
    EXPECT_NEAR(resumed.at("/time").back(), t + 20, 1e-6);
  }
}

/// A plan that draws, remembers, asks the vehicle and branches by it; what it was given comes again, whatever the vehicle is by then.
const char* kPlan = R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 6, output = { rate = "10 Hz" }, checkpoint = { period = "0.5 s" } }
local m = persist { n = 0, kept = { sum = 0 }, draws = {} }
local log = signals { ["own/plan"] = { components = { "n", "sum", "draw", "local" } } }
local own = 0
controller { name = "c", rate = "20 Hz", step = function(t) m.kept.sum = m.kept.sum + math.random() end }
local rod = sat:hinge "rod"
local second
sequence { name = "first", run = function()
  local hinge = sat:hinge "rod"
  local seen, words = { angle = hinge:angle(), vector { 1, 2 } }, {}
  for k = 1, 30 do
    local draw, name = math.random(), "step " .. k
    if not wait_until(function() return hinge:rate() + 0.2 * (draw - 0.5) end, { timeout = 0.2 + 0.3 * draw }) then words[#words + 1] = name end
    seen.angle = seen.angle + hinge:angle() + sim:state().q[1]
    seen[1][1] = 0.5 * seen[1][1] + hinge:rate()
    m.n = m.n + k
    m.draws[k % 3 + 1] = draw
    hinge:torque(0.3 * (m.kept.sum % 1 - 0.5) + 0.1 * seen.angle + 0.01 * seen[1][1])
    log["own/plan"](m.n, m.kept.sum, draw, #words)
    if k == 7 then print(name, #words, mission.time()) second:start() end
    if k == 20 and second:state() == "waiting" then second:stop() end
    wait(0) at(mission.time())
    if k % 4 == 0 then wait_until(function() return mission.time() > 0.1 * k end, { rate = "3 Hz", timeout = 0.01 }) end
    wait(0.01 + 0.1 * math.random())
  end
end }
second = sequence { name = "second", start = false, run = function()
  wait_until(function() return m.n % 5 == 0 end, { rate = "7 Hz", timeout = "0.6 s", otherwise = function()
    for k = 1, 100 do wait "0.13 s" m.kept.sum = m.kept.sum + rod:angle() end
  end })
  wait "0.7 s"
  second:stop()
end }
event { name = "passes", when = function() return rod:angle() - 0.05 end, action = function() if second:state() == "ended" then second:start() end end }
)lua";

TEST(Resume, GoesOnInTheMiddleOfPlans) {
  for (const std::string method : {"dopri5", "exponential", "rk4", "cvode_bdf", "dopri5 between steps"}) {
    const TemporaryFolder dir;
    make_scenario(dir, kPlan);
    const std::vector<std::string> options = options_of(method);
    const auto run = [&](const std::vector<std::string>& arguments) { return run_with(options, arguments, dir); };
    const Finished whole = run({dir.path(), "--out", "whole"});
    ASSERT_LE(whole.exit_code, 1) << whole.err;
    EXPECT_EQ(whole.out.find("cannot be resumed"), std::string::npos) << whole.out;
    ASSERT_LE(run({dir.path(), "--out", "part", "--until", "4.83"}).exit_code, 1);
    for (const std::string at : {"0.5", "1.6", "2.5", "4.5"}) {
      const Finished rest = run_program({"run", "--resume", "part", "--at", at, "--until", "6", "--out", "rest"}, dir.path());
      ASSERT_LE(rest.exit_code, 1) << rest.err;
      expect_same_results(dir / "whole", dir / "rest");
    }
  }
}

/// The answer to --resume, without writing anything.
std::string refused(const TemporaryFolder& dir, const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments{"run", "--resume", "out", "--out", "new"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Finished run = run_program(arguments, dir.path());
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_FALSE(fs::exists(dir / "new")) << "nothing was written";
  return run.err;
}

TEST(Resume, IsRefusedWhereTheScriptKeepsMoreThanPersist) {
  const TemporaryFolder dir;
  make_scenario(dir, replaced(kMission, "local m = persist {", "local m = {"));
  const Finished run = run_program({"run", ".", "--out", "out"}, dir.path());
  EXPECT_NE(run.out.find("cannot be resumed: kept outside of persist{}: m.crossings, m.draws.1"), std::string::npos) << run.out;
  const json kept = summary_of(dir / "out")["kept_outside_persist"];
  EXPECT_NE(std::find(kept.begin(), kept.end(), "m.integral"), kept.end()) << kept;
  const std::string err = refused(dir);
  EXPECT_NE(err.find("error[C0704]: a run that cannot be resumed\n"), std::string::npos) << err;
  EXPECT_NE(err.find("  at: /restart/checkpoints\n"
                     "  expected: a script that keeps what it remembers in persist{}\n"
                     "  got:      variables that change: m.crossings, m.draws.1"),
            std::string::npos)
      << err;
  EXPECT_NE(err.find("  hint:     local memory = persist { integral = 0.0 }"), std::string::npos) << err;
  const Finished check = run_program({"check", "."}, dir.path());
  EXPECT_EQ(check.exit_code, 0) << check.err;
  EXPECT_NE(check.out.find("cannot be resumed: kept outside of persist{}: m.draws.1, m.integral"), std::string::npos) << check.out;
}

TEST(Resume, IsRefusedWhereAPlanHoldsWhatNoCheckpointDoes) {
  const auto expect = [](const std::string& plan, const std::string& what) {
    const TemporaryFolder dir;
    make_scenario(dir,
                  "local sat = vehicle 'vehicle.yaml' mission { duration = 2, output = { rate = '10 Hz' } }\nlocal m = persist { n = 0 }\n"
                  "sequence { name = 'plan', run = function()\n  wait(0.1)\n  " +
                      plan + "\nend }\n");
    const Finished run = run_program({"run", ".", "--out", "out"}, dir.path());
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_NE(run.out.find("cannot be resumed: kept outside of persist{}: sequence \"plan\": " + what), std::string::npos)
        << plan << run.out;
    EXPECT_NE(refused(dir).find("error[C0704]"), std::string::npos);
  };
  expect("local s = sim:operators() wait(1)", "a userdata that it was given (scenario.lua:5)");
  expect("pcall(sat.hinge, sat, 'nobody') wait(1)", "an error that it caught");
  expect("local own = {} m.own = own wait(1)", "own (scenario.lua:5)");
  expect("for k = 1, 11000 do for i = 1, 20 do mission.time() end wait(1e-4) end", "more than 200000 values that it was given");
}

/// A condition that counts is not asked again.
TEST(Resume, IsRefusedWhereAPlanDoesNotStandWhereItStood) {
  const TemporaryFolder dir;
  make_scenario(dir,
                "local sat = vehicle 'vehicle.yaml' mission { duration = 2, output = { rate = '10 Hz' } }\n"
                "sequence { name = 'plan', run = function()\n  local n = 0\n"
                "  wait_until(function() n = n + 1 return n > 3 end, { rate = '10 Hz' })\n  wait(1.5)\nend }\n");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  const std::string err = refused(dir, {"--at", "1"});
  EXPECT_NE(err.find("sequence \"plan\": after n it has i0 in place of i4"), std::string::npos) << err;
}

/// Those of the tutorials: tests/scripts/tutorials_test.cpp.
TEST(Resume, IsPossibleForTheScenariosThatComeWithCardan) {
  for (const std::string name : {"01_flexible_slew", "02_free_flying_arm", "03_separation", "04_capture_and_berth", "05_wing_deployment"}) {
    const TemporaryFolder dir;
    const Finished run = run_program({"run", CARDAN_SOURCE_DIR "/scenarios/" + name, "--quiet", "--out", "out"}, dir.path());
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const json summary = summary_of(dir / "out");
    EXPECT_TRUE(summary.at("kept_outside_persist").empty()) << name << ": " << summary["kept_outside_persist"];
  }
}

/// A table in a table and so on: their names, joined, would be 20 GB.
TEST(Resume, AChainOfTablesTakesNoMoreThanTheChain) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies:\n  bus: {mass: 10, inertia: [1, 1, 1], hinge: {type: free, to: world}}\n");
  write(dir / "scenario.lua",
        "vehicle 'vehicle.yaml' mission { duration = 1 } local kept = persist { n = 0 } local own = {}\n"
        "controller { name = 'chain', rate = '1 Hz', step = function()\n"
        "  local t, u = {}, {} for i = 1, 1e5 do t, u = { t }, { u } end kept.t, own.u = t, u\nend }");
  const Finished run = run_program({"run", ".", "--out", "out", "--quiet"}, dir.path(), [] {
    const rlimit limit{rlim_t{1} << 30, rlim_t{1} << 30};
    if (!test::sanitized) setrlimit(RLIMIT_AS, &limit);
  });
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(Resume, NeedsACheckpoint) {
  const TemporaryFolder dir;
  make_scenario(dir, kMission);
  ASSERT_LE(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 1);
  EXPECT_NE(refused(dir, {"--at", "0.3"}).find("got:      the first one at t = 0.5 s"), std::string::npos);
  EXPECT_NE(refused(dir, {"--until", "6"}).find("expected: a finite time > 6 s"), std::string::npos);
  EXPECT_NE(refused(dir, {"--seed", "3"}).find("error[C0801]"), std::string::npos);
  EXPECT_EQ(run_program({"run", ".", "--resume", "out"}, dir.path()).exit_code, 2);
  EXPECT_EQ(run_program({"run", "--again", "out", "--resume", "out"}, dir.path()).exit_code, 2);
  EXPECT_EQ(run_program({"run", ".", "--at", "1"}, dir.path()).exit_code, 2);
  EXPECT_EQ(run_program({"run", "--resume", "out", "--out", "./new/../out"}, dir.path()).exit_code, 2);
  fs::remove_all(dir / "out");
  write(dir / "scenario.lua", replaced(kMission, R"(period = "0.5 s")", "never = true"));
  ASSERT_LE(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 1);
  EXPECT_NE(refused(dir).find("expected: a checkpoint\n  got:      none"), std::string::npos);
}

TEST(Resume, RefusesADamagedCheckpoint) {
  const TemporaryFolder dir;
  make_scenario(dir, kMission);
  ASSERT_LE(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 1);
  const auto with_last = [&](const std::string& what, const std::string& with) {
    fs::copy_file(dir / "out/run.h5", dir / "out/good.h5", fs::copy_options::overwrite_existing);
    {
      Hdf5File file = Hdf5File::update(dir / "out/run.h5");
      auto texts = file.read_texts("/restart/checkpoints/text");
      EXPECT_NE(texts.back().find(what), std::string::npos) << what;
      texts.back() = replaced(texts.back(), what, with);
      file.remove("/restart/checkpoints/text");
      file.write("/restart/checkpoints/text", texts, {texts.size(), 1});
      file.close();
    }
    const std::string err = refused(dir);
    fs::rename(dir / "out/good.h5", dir / "out/run.h5");
    return err;
  };
  EXPECT_NE(with_last(R"("format":1)", R"("format":7)").find("format 7: this program reads 1"), std::string::npos);
  EXPECT_NE(with_last(R"("schedule")", R"("shedule")").find("block schedule: there is none"), std::string::npos);
  EXPECT_NE(with_last(R"("table 1")", R"("table 8")").find("a table that set-up does not make"), std::string::npos);
  EXPECT_NE(with_last("{", "").find("error[C0702]"), std::string::npos);
}

TEST(Resume, ThatIsRefusedLeavesEarlierResultsAsTheyAre) {
  const TemporaryFolder dir;
  make_scenario(dir, kMission);
  ASSERT_LE(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 1);
  ASSERT_LE(run_program({"run", ".", "--out", "earlier", "--until", "3"}, dir.path()).exit_code, 1);
  const auto contents = [&] {
    std::map<std::string, std::string> all;
    for (const auto& entry : fs::directory_iterator(dir / "earlier")) all[entry.path().filename()] = file_text(entry.path());
    return all;
  };
  const auto before = contents();
  EXPECT_EQ(before.size(), 3u);
  const auto expect_refused = [&](const std::string& what) {
    const Finished run = run_program({"run", "--resume", "out", "--out", "earlier"}, dir.path());
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_NE(run.err.find("error[C0702]"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find(what), std::string::npos) << run.err;
    EXPECT_TRUE(contents() == before) << what;
  };
  fs::copy_file(dir / "out/run.h5", dir / "good.h5");
  {
    Hdf5File file = Hdf5File::update(dir / "out/run.h5");
    auto texts = file.read_texts("/restart/checkpoints/text");
    texts.back() = replaced(texts.back(), "table 1", "table 8");
    file.remove("/restart/checkpoints/text");
    file.write("/restart/checkpoints/text", texts, {texts.size(), 1});
    file.close();
  }
  expect_refused("a table that set-up does not make");
  fs::rename(dir / "good.h5", dir / "out/run.h5");
  {
    Hdf5File file = Hdf5File::update(dir / "out/run.h5");
    file.remove("/channels/own/numbers");
    file.close();
  }
  expect_refused("at: /channels/own/numbers");
}

TEST(Resume, OnADiskThatIsFullBeforeTheCheckpointIsAFailureOfTheRun) {
  const TemporaryFolder dir;
  make_scenario(dir, replaced(kMission, "10 Hz", "1000 Hz"));
  ASSERT_LE(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 1);
  const Finished run = run_program({"run", "--resume", "out", "--until", "8"}, dir.path(), [] {
    const rlimit limit{300'000, 300'000};  // [B] of one file, of more than a megabyte
    setrlimit(RLIMIT_FSIZE, &limit);
  });
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_NE(run.err.find("failure[N0204]: the results cannot be written any more\n  t = "), std::string::npos) << run.err;
  EXPECT_EQ(summary_of(dir / "out/resumed")["verdict"], "aborted");
}

TEST(Resume, FromAnotherFolderCountsTheSameWarningsAsOne) {
  const TemporaryFolder dir;
  fs::create_directories(dir / "scene");
  fs::create_directories(dir / "elsewhere/deep");
  fs::copy(kScripts + "/errors/pendulum.yaml", dir / "scene/vehicle.yaml");
  write(dir / "scene/scenario.lua", replaced(replaced(kMission, "t == 1.25", "t >= 1.25"), "print \"odd\" ", ""));
  for (const std::string folder : {"scene", "."}) {
    const std::string at = folder == "." ? dir / "scene" : dir.path();
    ASSERT_LE(run_program({"run", folder, "--out", dir / "whole"}, at).exit_code, 1);
    ASSERT_LE(run_program({"run", folder, "--out", dir / "part", "--until", "3.3"}, at).exit_code, 1);
    const Finished rest = run_program({"run", "--resume", "../../part", "--until", "6", "--out", dir / "rest"}, dir / "elsewhere/deep");
    ASSERT_LE(rest.exit_code, 1) << rest.err;
    const json warnings = summary_of(dir / "rest")["warnings"], before = summary_of(dir / "whole")["warnings"];
    ASSERT_EQ(before.size(), 1u);
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_EQ(warnings[0]["count"], before[0]["count"]);
    EXPECT_EQ(warnings[0]["t"], 1.25);
    EXPECT_EQ(fs::canonical(warnings[0]["file"].get<std::string>()), fs::canonical(dir / "scene/scenario.lua"));
    EXPECT_EQ(Hdf5File::open(dir / "rest/run.h5").read_doubles("/run/warnings/t").values.size(), 1u);
  }
}

TEST(Resume, CountsTheLinesThatAreNotKept) {
  const TemporaryFolder dir;
  make_scenario(dir, replaced(kMission, "m.integral = m", "for i = 1, 200 do print(i) end m.integral = m"));
  ASSERT_LE(run_program({"run", dir.path(), "--out", "whole"}, dir.path()).exit_code, 1);
  ASSERT_LE(run_program({"run", dir.path(), "--out", "part", "--until", "4.2"}, dir.path()).exit_code, 1);
  ASSERT_LE(run_program({"run", "--resume", "part", "--until", "6", "--out", "end"}, dir.path()).exit_code, 1);
  expect_same_results(dir / "whole", dir / "end");
  EXPECT_GT(Hdf5File::open(dir / "part/run.h5").read_doubles("/run/printed/left_out").values.at(0), 1000.0);
}

TEST(Checkpoints, ThatAScriptLeavesNoMemoryForAreAnErrorOfTheScript) {
  const TemporaryFolder dir;
  make_scenario(dir, R"lua(
vehicle "vehicle.yaml"
mission { duration = 2, checkpoint = { period = "0.5 s" } }
local m = persist { all = {} }
local sizes = { 2^24, 2^20, 2^16, 2^12, 2^8 }
controller { name = "fills", rate = "20 Hz", step = function(t)
  local n = sizes[math.floor(t * 20 + 0.5) + 1]
  if n then while pcall(function() m.all[#m.all + 1] = string.rep("x", n) end) do end end
end }
)lua");
  const Finished run = run_program({"run", ".", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_TRUE(run.err.starts_with("failure[N0302]")) << run.err;
  EXPECT_NE(run.err.find("persist{}: "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("scenario.lua:4"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("a table or a text that grows without end?"), std::string::npos) << run.err;
}

TEST(Checkpoints, OfTablesThatAreTooDeepAreNamedAndDoNotEndTheRun) {
  const TemporaryFolder dir;
  make_scenario(dir, replaced(kMission, "m.integral = m", "m.list = { m.list } m.integral = m"));
  const Finished run = run_program({"run", ".", "--out", "out", "--set", "mission.duration=11 s"}, dir.path());
  EXPECT_LE(run.exit_code, 1) << run.err;
  EXPECT_NE(run.out.find("kept outside of persist{}: persist (tables more than 200 deep)\n"), std::string::npos) << run.out;
  EXPECT_NE(refused(dir).find("error[C0704]"), std::string::npos);
}

TEST(Resume, OfResultsOfANewerFormatIsRefusedAsIsTheirReport) {
  const TemporaryFolder dir;
  make_scenario(dir, kMission);
  ASSERT_LE(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 1);
  Hdf5File file = Hdf5File::update(dir / "out/run.h5");
  file.set_attribute("/run", "format", std::string("3"));
  file.close();
  EXPECT_NE(refused(dir).find("  expected: results of a format up to 2\n  got:      format 3"), std::string::npos);
  const Finished report = run_program({"report", "out/run.h5", "--out", "page.html"}, dir.path());
  EXPECT_EQ(report.exit_code, 2);
  EXPECT_NE(report.err.find("format 3"), std::string::npos) << report.err;
}

TEST(Checkpoints, OfAMissionAreTenUnlessItSaysOtherwise) {
  const TemporaryFolder dir;
  make_scenario(dir, "vehicle 'vehicle.yaml' mission { duration = 7, output = { rate = '3 Hz' } }");
  ASSERT_EQ(run_program({"run", ".", "--out", "out"}, dir.path()).exit_code, 0);
  const auto times = Hdf5File::open(dir / "out/run.h5").read_doubles("/restart/checkpoints/t").values;
  ASSERT_EQ(times.size(), 7u);  // every third output: 21 rows
  EXPECT_EQ(times[0], 1.0);
  EXPECT_EQ(times[6], 7.0);
  for (const auto& [text, expected] : {std::pair{"period = '-1 s'", "a time > 0"},
                                       {"period = '1 s', never = true", "period or never, not both"},
                                       {"perod = 1", "did you mean \"period\"?"}}) {
    write(dir / "scenario.lua", std::string("vehicle 'vehicle.yaml' mission { duration = 7, checkpoint = { ") + text + " } }");
    const Finished run = run_program({"check", "."}, dir.path());
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_NE(run.err.find(expected), std::string::npos) << run.err;
  }
}

}  // namespace
}  // namespace cardan
