// `cardan` on small scenarios: what it writes, what it answers, and with which exit code.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/io/hdf5_file.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kErrors = kScripts + "/errors";

std::vector<std::string> folders_of(const std::string& path) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(path))
    if (entry.is_directory()) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

// ---- missions that check themselves ----

class Mission : public testing::TestWithParam<std::string> {};

TEST_P(Mission, MeetsItsChecks) {
  const TemporaryFolder out;
  const Finished run = run_program({"run", GetParam(), "--out", out.path(), "--check-against-reference", "--quiet"}, kMissions);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(run.err, "");  // no warning: with --quiet they are counted, and no progress is told after ten seconds
  EXPECT_TRUE(fs::exists(out / "report.html"));
}
INSTANTIATE_TEST_SUITE_P(All, Mission, testing::ValuesIn(folders_of(kMissions)), [](const auto& p) { return p.param; });

// ---- wrong input and failures: the whole text and the exit code ----

class Answer : public testing::TestWithParam<std::string> {};

TEST_P(Answer, IsAsExpected) {
  std::istringstream script(file_text(kErrors + "/" + GetParam() + "/scenario.lua"));
  std::vector<std::string> arguments{"run", GetParam()};
  int exit_code = 0;
  for (std::string line; std::getline(script, line) && line.starts_with("-- ");) {  // -- exit: 2, -- argument: --set a=b
    if (line.starts_with("-- exit: ")) exit_code = std::stoi(line.substr(9));
    if (line.starts_with("-- argument: ")) arguments.push_back(line.substr(13));
  }
  const TemporaryFolder out;
  arguments.insert(arguments.end(), {"--out", out.path()});
  const Finished run = run_program(arguments, kErrors);
  EXPECT_EQ(run.exit_code, exit_code);
  const std::string expected = file_text(kErrors + "/" + GetParam() + "/expected.txt");
  EXPECT_EQ(replaced(run.err, out.path(), "OUT"), expected);
  EXPECT_EQ(fs::exists(out / "summary.json"), expected.find("last accepted state") != std::string::npos)
      << "a run that failed keeps what it reached; one that cannot begin touches no results";
}
INSTANTIATE_TEST_SUITE_P(All, Answer, testing::ValuesIn(folders_of(kErrors)), [](const auto& p) { return p.param; });

TEST(Phases, LastTheirDurationLateInALongRun) {  // half a year on, a third of them were a tick too long: times are rounded to 4e-9 s there
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies:\n  bus: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\n");
  write(dir / "scenario.lua", R"lua(
vehicle "vehicle.yaml"
mission { duration = "20000000 s", output = { period = "1000000 s" }, ledger = false }
local m = persist { begun = 0.0, late = 0 }
local function over(t)
  if m.begun > 0 and t - m.begun > 4000 then m.late = m.late + 1 end
  m.begun = t
end
controller { name = "ticks", period = "1000.1 s", step = function() end }
phase { name = "long", duration = "16001600 s", exit_ = over }
phase { name = "one", duration = "3000.3 s", next = "other", exit_ = over }
phase { name = "other", duration = "3000.3 s", next = "one", exit_ = over }
check { name = "late", value = function() return m.late end, equal = { 0 } }
)lua");
  EXPECT_EQ(run_program({"run", ".", "--quiet", "--no-report", "--out", "out"}, dir.path()).exit_code, 0);
}

TEST(Program, TellsAVehicleFromAScenario) {
  const TemporaryFolder dir;
  write(dir / "tug.yaml", "cardan: 1\n");
  for (const char* verb : {"check", "describe", "run"}) {
    const Finished told = run_program({verb, "tug.yaml"}, dir.path());
    EXPECT_EQ(told.exit_code, 2) << verb;
    EXPECT_EQ(told.err,
              "error[C0801]: wrong command line\n  --> tug.yaml\n  expected: a scenario: a Lua file, or a folder with scenario.lua\n"
              "  got:      the name of a vehicle\n  hint:     two lines make one: vehicle \"tug.yaml\"  mission { duration = 10 }\n\n"
              "1 error. Nothing was run.\n");
  }
}

// "file not found" alone leaves open what is wrong with a file that is there.
TEST(Program, TellsWhyAScriptCannotBeRead) {
  const TemporaryFolder dir;
  fs::create_directories(dir / "empty");
  fs::create_directories(dir / "odd/scenario.lua");
  const auto got = [&](const std::string& of) {
    const Finished told = run_program({"check", of}, dir.path());
    EXPECT_EQ(told.exit_code, 2) << of;
    return told.err;
  };
  EXPECT_EQ(got("empty"),
            "error[C0102]: file not found\n  --> empty/scenario.lua\n  expected: a Lua file\n  got:      No such file or directory\n\n"
            "1 error. Nothing was run.\n");
  EXPECT_TRUE(has(got("odd"), "  got:      a folder\n"));
  EXPECT_TRUE(has(got("/dev/null"), "  got:      a pipe or a device\n"));
}

// The line of the script was shown, which says something else.
TEST(Program, WhatASettingOfTheMissionHasWrongIsToldThere) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies: {a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n");
  write(dir / "list.yaml", "- a\n- b\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = '5 s' }\n");
  write(dir / "list.lua", "vehicle 'list.yaml' mission { duration = '5 s' }\n");
  const auto told = [&](const char* scenario, const std::vector<std::string>& settings) {
    std::vector<std::string> words{"check", scenario};
    for (const std::string& set : settings) words.insert(words.end(), {"--set", set});
    const Finished done = run_program(words, dir.path());
    EXPECT_EQ(done.exit_code, 2) << done.out;
    return done.err;
  };
  EXPECT_TRUE(has(told(".", {"mission.duration=3", "mission.duration=0"}), "--> --set mission.duration=0\n  at: mission.duration\n"));
  EXPECT_TRUE(has(told(".", {"mission.durations=3"}), "--> --set mission.durations=3\n  at: mission.durations\n"));
  EXPECT_TRUE(has(told(".", {"mission.output.rate=-1"}), "--> --set mission.output.rate=-1\n  at: mission.output.rate\n"));
  EXPECT_TRUE(has(told(".", {"mission.integrator.step=2"}), "--> --set mission.integrator.step=2\n"));
  EXPECT_TRUE(has(told(".", {"mission.integrator.method=rk4"}), "--> ./scenario.lua:1\n  at: mission.integrator.step\n"));
  for (const char* file : {"- a\n- b\n", "text\n"}) {  // beside a setting it was: expected: an index below 2
    write(dir / "list.yaml", file);
    EXPECT_TRUE(has(told("list.lua", {"bodies.a.mass=3"}), "--> list.yaml:1:1\n") &&
                has(told("list.lua", {"bodies.a.mass=3"}), "expected: a map"))
        << told("list.lua", {"bodies.a.mass=3"});
  }
}

TEST(Program, SpacesAroundTheSignOfASettingAreNoPartOfIt) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies: {a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }\n");
  write(dir / "settings.txt", "  mission.duration = 2 s  \r\n");
  EXPECT_TRUE(has(run_program({"check", ".", "--settings", "settings.txt"}, dir.path()).out, ", 2 s\n"));
  EXPECT_TRUE(has(run_program({"check", ".", "--set", "mission.duration = 3 s"}, dir.path()).out, ", 3 s\n"));
  EXPECT_EQ(run_program({"check", ".", "--set", " = 3 s"}, dir.path()).exit_code, 2);
}

TEST(Program, ReadsSettingsBehindAByteOrderMark) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies: {a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 }\n");
  write(dir / "settings.txt", "\xEF\xBB\xBFmission.duration=2 s\r\n");
  const Finished told = run_program({"check", ".", "--settings", "settings.txt"}, dir.path());
  EXPECT_TRUE(has(told.out, ", 2 s\n")) << told.out << told.err;
}

TEST(Program, AFailedCheckIsExitCodeOneWithATable) {
  const TemporaryFolder dir;
  write(dir / "scenario.lua",
        "vehicle 'vehicle.yaml'\n"
        "mission { duration = 1 }\n"
        "check { name = 'good', value = function() return 1 end, below = 2 }\n"
        "check { name = 'bad', unit = 'deg', value = function() return 3 end, within = { 1, 2 } }\n");
  fs::copy(kErrors + "/pendulum.yaml", dir / "vehicle.yaml");
  const Finished run = run_program({"run", ".", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_NE(run.out.find("  pass  good                                                           1   below 2\n"
                         "  FAIL  bad                                                        3 deg   within 1 ... 2 deg, beyond by 1\n"),
            std::string::npos)
      << run.out;
  const json checks = summary_of(dir / "out")["checks"];
  EXPECT_EQ(checks[0]["verdict"], "pass");
  EXPECT_EQ(checks[1]["verdict"], "fail");
  EXPECT_EQ(checks[1]["value"], 3.0);
  EXPECT_EQ(checks[1]["limit"], 2.0) << "the limit that is passed";
}

TEST(Program, AFolderThatIsCopiedRunsUnchanged) {
  const TemporaryFolder dir;
  fs::copy(kMissions + "/pendulum", dir / "elsewhere", fs::copy_options::recursive);
  const Finished here = run_program({"run", "pendulum/scenario.lua", "--out", dir / "a"}, kMissions);
  const Finished there = run_program({"run", "scenario.lua"}, dir / "elsewhere");
  EXPECT_EQ(here.exit_code, 0) << here.err;
  EXPECT_EQ(there.exit_code, 0) << there.err;
  EXPECT_EQ(channels_of(dir / "a"), channels_of(dir / "elsewhere/out/elsewhere")) << "the default folder is out/<folder of the scenario>";
}

TEST(Program, SweepsThatDoNotExistAreRefusedBeforeTheRun) {
  const TemporaryFolder dir;
  setenv("CARDAN_KERNELS", "v5", 1);
  const Finished run = run_program({"run", "drive", "--out", dir / "out"}, kMissions);
  EXPECT_EQ(run.exit_code, 2);
  const std::string expected = "expected: one of those that are built and that this processor runs: ";
  for (const std::string& part :
       {std::string("error[C0301]"), std::string("at: environment variable CARDAN_KERNELS"), expected, std::string("got:      \"v5\"")})
    EXPECT_NE(run.err.find(part), std::string::npos) << part << "\n" << run.err;
  EXPECT_FALSE(fs::exists(dir / "out"));
  std::istringstream offered(run.err.substr(std::min(run.err.size(), run.err.find(expected) + expected.size())));
  std::string line, name;
  std::getline(offered, line);
  std::istringstream names(line);
  int count = 0;
  for (; std::getline(names >> std::ws, name, ','); ++count) {
    setenv("CARDAN_KERNELS", name.c_str(), 1);
    const Finished version = run_program({"version"}, dir.path());
    EXPECT_NE(version.out.find("sweeps: x86-64-" + name), std::string::npos) << version.out;
  }
  unsetenv("CARDAN_KERNELS");
  EXPECT_GT(count, 0) << run.err;
}

TEST(Program, TwoRunsGiveTheSameBits) {
  const TemporaryFolder dir;
  for (const char* out : {"a", "b"}) ASSERT_EQ(run_program({"run", "drive", "--out", dir / out}, kMissions).exit_code, 0);
  EXPECT_EQ(channels_of(dir / "a"), channels_of(dir / "b"));
  json a = summary_of(dir / "a"), b = summary_of(dir / "b");
  for (const char* key : {"wall_s", "cpu_s"}) a.erase(key), b.erase(key);
  EXPECT_EQ(a, b);
}

TEST(Program, SetReplacesParametersVehicleAndMission) {
  const TemporaryFolder dir;
  const Finished run =
      run_program({"run", "pendulum", "--out", dir.path(), "--set", "start=-10 deg", "--set", "vehicle.bodies.rod.mass=4 kg", "--set",
                   "mission.integrator.method=cvode_bdf", "--set", "list=[3, 4 km]"},
                  kMissions);
  EXPECT_EQ(run.exit_code, 1) << "the period is another: " << run.err;
  const Hdf5File file = Hdf5File::open(dir / "run.h5");
  EXPECT_NEAR(file.read_doubles("/channels/hinges/rod/angle").values.front(), -10 * M_PI / 180, 1e-15);
  const auto parameters = file.read_texts("/spec/parameters");
  const auto value = [&](const std::string& key) { return *(std::find(parameters.begin(), parameters.end(), key) + 1); };
  EXPECT_EQ(value("bodies.rod.mass"), "4 kg");
  EXPECT_EQ(value("parameters.list"), "[3, 4000]");
  EXPECT_EQ(file.text_attribute("/run", "integrator"), "cvode_bdf, relative tolerance 1e-10");
}

// Controllers, wheels and modes with the matrix-free solver: the same checks, the same bits twice, and the counts in the summary.
TEST(Program, MissionsRunByKrylov) {
  for (const std::string mission : {"drive", "flexible", "phases"}) {
    const TemporaryFolder dir;
    for (const char* out : {"a", "b"}) {
      const Finished run = run_program({"run", mission, "--out", dir / out, "--set", "mission.integrator.method=cvode_bdf", "--set",
                                        "mission.integrator.linear_solver=krylov", "--set", "mission.integrator.relative=1e-12"},
                                       kMissions);
      ASSERT_EQ(run.exit_code, 0) << mission << run.out << run.err;
      EXPECT_NE(run.out.find(" products J v, "), std::string::npos) << run.out;
    }
    EXPECT_EQ(channels_of(dir / "a"), channels_of(dir / "b"));
    const json summary = summary_of(dir / "a");
    for (const char* count : {"jacobian_products", "preconditioner_setups", "linear_iterations"})
      EXPECT_GT(summary[count], 0) << mission << count;
    EXPECT_EQ(Hdf5File::open(dir / "a/run.h5").text_attribute("/run", "integrator"),
              "cvode_bdf, krylov linear solver, relative tolerance 1e-12");
  }
}

TEST(Program, AutoSaysWhatItChoseAndProfileWhereTheTimeWent) {
  const TemporaryFolder dir;
  const Finished run =
      run_program({"run", "flexible", "--out", dir / "out", "--profile", "--set", "mission.integrator.method=auto"}, kMissions);
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const std::size_t chosen = run.out.find(" was chosen by auto: ");
  ASSERT_NE(chosen, std::string::npos) << run.out;
  const std::size_t line = run.out.rfind('\n', chosen) + 1;
  const std::string method = run.out.substr(line, chosen - line);
  EXPECT_NE(run.out.find("method (" + method + ")"), std::string::npos) << run.out;
  for (const char* part : {"\nwhere ", "right-hand side ", "controllers, sampled devices ", "outputs ", "the rest "})
    EXPECT_NE(run.out.find(part), std::string::npos) << part;
  EXPECT_EQ(Hdf5File::open(dir / "out/run.h5").text_attribute("/run", "integrator").substr(0, method.size() + 1), method + ",");
}

TEST(Program, TellsWhereRowsEndMostSteps) {
  const TemporaryFolder dir;
  make_scenario(dir,
                "local sat = vehicle \"vehicle.yaml\"\n"
                "mission { duration = 150, integrator = { method = \"dop853\", relative = 1e-6 }, output = { rate = \"100 Hz\" } }\n");
  const std::string told = "steps ended at rows of the output or readings of sensors alone: output = { between_steps = true }";
  const Finished ends = run_program({"run", dir.path(), "--out", "ends"}, dir.path());
  EXPECT_EQ(ends.exit_code, 0) << ends.err;
  EXPECT_NE(ends.out.find(told), std::string::npos) << ends.out;
  const Finished inside = run_program({"run", dir.path(), "--out", "inside", "--set", "mission.output.between_steps=true"}, dir.path());
  EXPECT_EQ(inside.exit_code, 0) << inside.err;
  EXPECT_EQ(inside.out.find(told), std::string::npos) << inside.out;
  EXPECT_EQ(channels_of(dir / "inside").at("/time"), channels_of(dir / "ends").at("/time"));
  EXPECT_LT(summary_of(dir / "inside")["steps"], 3000);
}

TEST(Program, UntilEndsTheRun) {
  const TemporaryFolder dir;
  run_program({"run", "pendulum", "--out", dir.path(), "--until", "0.725"}, kMissions);
  EXPECT_EQ(summary_of(dir.path())["simulated_s"], 0.725);
  const auto time = Hdf5File::open(dir / "run.h5").read_doubles("/time").values;
  EXPECT_EQ(time.size(), 16u) << "0, 0.05 ... 0.7, and the end";
  EXPECT_EQ(time.back(), 0.725);
  EXPECT_EQ(time[14], 0.7);
}

TEST(Program, SeedDecidesRandomNumbers) {
  const TemporaryFolder dir;
  fs::copy(kErrors + "/pendulum.yaml", dir / "vehicle.yaml");
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml' mission { duration = 1 } print(math.random(1000000))");
  const auto drawn = [&](const char* seed) { return run_program({"run", ".", "--quiet", "--seed", seed, "--out", "out"}, dir.path()).out; };
  const std::string first = drawn("1");
  EXPECT_EQ(drawn("1"), first);
  EXPECT_NE(drawn("2"), first);
  EXPECT_EQ(Hdf5File::open(dir / "out/run.h5").text_attribute("/run", "seed"), "2");
}

TEST(Program, ErrorsAsJson) {
  const TemporaryFolder dir;
  const Finished input = run_program({"run", "C0502_unknown_keys", "--out", dir.path(), "--json-errors"}, kErrors);
  const json wrong = json::parse(input.err);
  EXPECT_EQ(input.exit_code, 2);
  EXPECT_EQ(wrong["exit_code"], 2);
  EXPECT_EQ(wrong["errors"].size(), 3u);
  EXPECT_EQ(wrong["errors"][0]["code"], "C0502");
  EXPECT_EQ(wrong["errors"][0]["at"], "mission.duration");
  EXPECT_EQ(wrong["errors"][0]["line"], 3);
  const Finished numerics = run_program({"run", "N0301_controller_nan", "--out", dir.path(), "--json-errors"}, kErrors);
  const json failed = json::parse(numerics.err);
  EXPECT_EQ(failed["exit_code"], 3);
  EXPECT_EQ(failed["errors"][0]["code"], "N0301");
  EXPECT_EQ(failed["errors"][0]["t"], 0.3);
  const json line = json::parse(run_program({"run", "--json-errors"}, kErrors).err);
  EXPECT_EQ(line["errors"][0]["code"], "C0801");
}

TEST(Program, FailuresOfScriptsHaveTheirPlaceAsJson) {
  const TemporaryFolder dir;
  const json failed =
      json::parse(run_program({"run", "N0303_controller_error", "--out", dir.path(), "--json-errors"}, kErrors).err)["errors"][0];
  EXPECT_EQ(failed["file"], "N0303_controller_error/scenario.lua");
  EXPECT_EQ(failed["line"], 5);
}

/// A scenario of a pendulum with this text, by this command.
Finished pendulum_with(const std::string& text, const std::string& command = "run") {
  const TemporaryFolder dir;
  fs::copy(kErrors + "/pendulum.yaml", dir / "vehicle.yaml");
  write(dir / "scenario.lua", "local sat = vehicle 'vehicle.yaml'\n" + text);
  return run_program({command, "."}, dir.path());
}

// The event is where the function of the time is zero, whatever tells the time: not at the tick before.
TEST(Program, EventFunctionsSeeTheTrialTime) {
  for (const char* time : {"t", "mission.time()", "sim:t()", "sim:state().t"}) {
    const Finished run = pendulum_with(
        "mission { duration = 1, output = { rate = '2 Hz' } }\n"
        "controller { name = 'tick', rate = '10 Hz', step = function() end }\n"
        "local at = 0\n"
        "event { name = 'late', when = function(t) return " +
        std::string(time) +
        " - 0.55 end, action = function(t) at = t assert(mission.time() == t and sim:t() == t) end }\n"
        "check { name = 'time', value = function() return at end, equal = { 0.55, tolerance = 1e-9 } }\n");
    EXPECT_EQ(run.exit_code, 0) << time << run.out << run.err;
  }
  const Finished stored = pendulum_with(
      "mission { duration = 1 }\nlocal s = signals { a = {} }\nevent { name = 'e', when = function(t) s.a(t) return 1 end, action = "
      "function() end }\n");
  EXPECT_EQ(stored.exit_code, 3);
  EXPECT_NE(stored.err.find("one stored in an event's `when`"), std::string::npos) << stored.err;
}

TEST(Program, WhatRunRefusesCheckRefuses) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {"mission { duration = 1 }\nsignals { a = {}, ['a/b'] = {} }", {"scenario.lua:3", "beside the channel"}},
      {"mission { duration = 1 }\nsignals { time = {} }", {"scenario.lua:3", "beside the channel \"time\""}},
      {"mission { duration = 1 }\nsignals { a = { components = { 'x', 'x' } } }", {"scenario.lua:3", "names, each once"}},
      {"mission { duration = 1 }\nsignals { ['ledger/energy'] = {} }", {"scenario.lua:3", "ledger/energy"}},
      {"mission { duration = 1 }\nsignals { hinges = {} }", {"scenario.lua:3", "hinges/rod/angle"}},
      {"mission { duration = 1 }\nsignals { a = {} }\nsignals { a = {} }", {"scenario.lua:3", "signals.a"}},
      {"mission { duration = 1, output = { reactions = { 'rod', 'rod' } } }", {"scenario.lua:2", "mission.output.reactions", "\"rod\""}},
      {"mission { duration = 1, output = { nodes = { 'rod.end', 'rod.end' } } }", {"scenario.lua:2", "mission.output.nodes"}}};
  for (const auto& [text, parts] : cases)
    for (const char* command : {"check", "run"}) {
      const Finished run = pendulum_with(text, command);
      EXPECT_EQ(run.exit_code, 2) << command << text << run.err;
      EXPECT_NE(run.err.find("error[C0207]"), std::string::npos) << command << text << run.err;
      for (const std::string& part : parts) EXPECT_NE(run.err.find(part), std::string::npos) << part << text << run.err;
    }
  const Finished commands =
      pendulum_with("mission { duration = 1 }\nsignals { a = { components = { 'w', 'x', 'y', 'z' }, commands = 'rod' } }", "check");
  EXPECT_EQ(commands.exit_code, 2);
  EXPECT_NE(commands.err.find("an attitude that is recorded: none"), std::string::npos) << commands.err;
  EXPECT_NE(pendulum_with("mission { duration = 1 }\nsignals { a = { commands = 'x' } }", "check").err.find("signals.a.components"),
            std::string::npos);
  const Finished legal =
      pendulum_with("mission { duration = 1 }\nsignals { a = {}, ['b/a'] = {}, ['b/c'] = {}, ['ledger_x'] = {} }", "check");
  EXPECT_EQ(legal.exit_code, 0) << legal.err;
  EXPECT_EQ(
      pendulum_with("mission { duration = 1 }\ncheck { name = 'x', value = print, equal = { 1, tolerance = -1 } }", "check").exit_code, 2);
}

TEST(Program, ASignalThatIsNotFiniteIsAWarning) {
  const Finished run = pendulum_with(
      "mission { duration = 1 }\nlocal s = signals { ['a/b'] = {} }\n"
      "controller { name = 'c', rate = '10 Hz', step = function(t) s['a/b'](1 / (t - 0.5)) end }\n");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE((run.out + run.err).find("warning[W0501]: signal a/b is inf"), std::string::npos) << run.out << run.err;
}

TEST(Program, WhatAStepReturnsIsTakenByNobodyWhichIsToldOnce) {
  const auto with = [](const std::string& step) {
    return pendulum_with("mission { duration = 1 }\ncontroller { name = 'c', rate = '10 Hz', step = function(t) " + step + " end }\n");
  };
  const Finished lost = with("return -3 * t");
  EXPECT_EQ(lost.exit_code, 0) << lost.err;
  const std::string told = lost.out + lost.err;
  EXPECT_NE(told.find("warning[W0303]: its step returns a value, which nothing takes"), std::string::npos) << told;
  EXPECT_NE(told.find("controller \"c\""), std::string::npos) << told;
  for (const char* step : {"", "return", "return nil", "return print(t)"}) {
    const Finished none = with(step);
    EXPECT_EQ((none.out + none.err).find("W0303"), std::string::npos) << step;
  }
}

TEST(Program, TheBudgetOfACallIsTheMissions) {
  const std::string loop = "controller { name = 'c', rate = '1 Hz', step = function() for i = 1, 1e6 do end end }\n";
  const Finished small = pendulum_with("mission { duration = 1, budget = { steps = 1e5 } }\n" + loop);
  EXPECT_EQ(small.exit_code, 3);
  EXPECT_NE(small.err.find("at most 100000 steps in one call"), std::string::npos) << small.err;
  EXPECT_EQ(pendulum_with("mission { duration = 1, budget = { steps = 1e7, time = '1 min' } }\n" + loop).exit_code, 0);
  EXPECT_EQ(pendulum_with("mission { duration = 1, budget = { steps = 0 } }\n" + loop, "check").exit_code, 2);
  EXPECT_EQ(pendulum_with("mission { duration = 1, budget = { time = '5 m' } }\n" + loop, "check").exit_code, 2);
}

/// Studies spend what their work is: each of a chain of 300 links, some ten to hundred milliseconds of them, is within the budget of one
/// function.
TEST(Program, StudiesOfManyBodiesAreWithinABudget) {
  const TemporaryFolder dir;
  std::string chain = "cardan: 1\ngravity: {uniform: [0, -9.81, 0]}\nbodies:\n";
  for (int i = 0; i < 300; ++i)
    chain += fmt::format(
        "  l{}: {{mass: 1, com: [0.5, 0, 0], inertia: [0.01, 0.1, 0.1], nodes: {{e: {{position: [1, 0, 0]}}}}, "
        "hinge: {{type: revolute, axis: [0, 0, 1], to: {}, spring: {{stiffness: 3e6}}}}}}\n",
        i, i == 0 ? "world" : fmt::format("l{}.e", i - 1));
  write(dir / "vehicle.yaml", chain);
  write(dir / "scenario.lua", R"(
local sat = vehicle "vehicle.yaml"
mission { duration = "1 ms", output = { period = "1 ms" } }
local links = {}
for i = 0, 299 do links[i + 1] = "l" .. i end
for name, study in pairs {
  closed_system = function() return sim:closed_system():mobility() end,
  derivatives = function() return sim:derivatives().tau_q:rows() end,
  equilibrium = function() return sim:equilibrium { move = links }.q:rows() end,
  linear_model = function() return sim:linearize { inputs = { "l3.angle" } }.B:rows() / 2 end,
} do check { name = name, equal = { 300, tolerance = 0 }, value = function() return study() end } end
)");
  const Finished run = run_program({"run", "."}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(Program, WhatScriptsPrintIsShownByCheckAndDescribe) {
  for (const char* command : {"check", "describe"}) {
    const Finished run = pendulum_with("mission { duration = 1 }\nprint('seen')", command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.err, "seen\n") << command;
  }
}

TEST(Program, ResultsThatCannotBeWrittenAreRefusedBeforeTheRun) {
  const TemporaryFolder dir;
  write(dir / "file", "");
  const Finished run = run_program({"run", "pendulum", "--out", dir / "file/results"}, kMissions);
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(replaced(run.err, dir.path(), "DIR"),
            "error[C0701]: result cannot be written\n"
            "  --> DIR/file/results\n"
            "  expected: a place that can be written to\n"
            "  got:      Not a directory\n"
            "  hint:     --out DIR chooses another\n\n"
            "1 error. Nothing was run.\n");
}

TEST(Program, NamesWithControlCharactersAreShownWithoutThem) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", "cardan: 1\nbodies: {bus: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}}\n");
  write(dir / "scenario.lua", "local sat = vehicle 'vehicle.yaml'\nmission { duration = 1 }\n");
  const Finished done = run_program({"run", ".", "--out", "o\x1b[31mx\a"}, dir.path());
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_TRUE(has(done.out, "o?[31mx?/run.h5")) << done.out;
  EXPECT_EQ((done.out + done.err).find_first_of("\x1b\a"), std::string::npos);
  EXPECT_TRUE(fs::exists(dir / "o\x1b[31mx\a/run.h5"));
}

TEST(Program, NumbersBeyondAllMeasureAreToldAsSuch) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n"
        "  a: {mass: 1e300, inertia: [1e300, 1e300, 1e300], hinge: {type: free, to: world}}\n"
        "  b: {mass: 1e300, inertia: [1e300, 1e300, 1e300], com: [1, 0, 0],\n"
        "      hinge: {type: revolute, axis: [0, 0, 1], to: {body: a, position: [1, 0, 0]}, initial: {rate: 1}}}\n");
  write(dir / "scenario.lua", "local sat = vehicle 'vehicle.yaml'\nmission { duration = 1 }\n");
  const Finished done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(done.exit_code, 3);
  EXPECT_TRUE(has(done.err, "failure[N0108]") && has(done.err, "beyond 1.8e308: masses")) << done.err;
}

/// A closed mechanism that friction holds altogether has no motions, and so no modes; with a stiff device too.
TEST(Program, WhatFrictionHoldsAltogetherHasNoModes) {
  const TemporaryFolder dir;
  const auto bar = [](const char* name, const char* length, const char* to, const char* more) {
    return fmt::format(
        "  {0}: {{mass: 1, inertia: [1, 1, 1], com: [0.5, 0, 0], nodes: {{tip: {{position: [{1}, 0, 0]}}}}, hinge: {{type: "
        "revolute, axis: [0, 0, 1], to: {2}{3}}}}}\n",
        name, length, to, more);
  };
  write(dir / "vehicle.yaml", "cardan: 1\ngravity: {uniform: [0, -9.81, 0]}\nbodies:\n" +
                                  bar("a", "1", "world", ", initial: {angle: 1.5}") + bar("b", "2", "a.tip", "") +
                                  bar("c", "1.6", "{body: world, position: [2, 0, 0]}", "") +
                                  "loops:\n  p: {type: revolute, axis: [0, 0, 1], from: b.tip, to: c.tip}\n"
                                  "devices:\n  f: {type: dry_friction, at: a, coulomb: 100}\n"
                                  "  s: {type: spring_damper, from: world, to: c.tip, stiffness: 10, rest: 1}\n");
  write(dir / "scenario.lua",
        "local sat = vehicle 'vehicle.yaml'\nmission { duration = 1 }\n"
        "check { name = 'modes', value = function() local m = sat:system_modes {} return m.n_rigid + #m.frequency end, equal = { 0 } }\n");
  const Finished done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(done.exit_code, 0) << done.err << done.out;
}

TEST(Program, DescribeTellsWhatADefaultOfZeroStandsFor) {
  const Finished told = run_program({"describe", "scenarios/tutorials/22_geostationary_with_sun_and_moon"}, kScripts + "/../..");
  EXPECT_TRUE(has(told.out, ".mu = 0 m^3/s^2: that of the body in DE440\n")) << told.out << told.err;
}

/// What Newton's iteration leaves in a step is no more than it says, with a matrix that is some steps old too: estimated errors are far
/// below.
TEST(Program, SmoothMotionByAnImplicitMethodKeepsItsBalances) {
  for (const char* scene : {"02_intermediate_axis", "06_wheel_spin_up"})
    for (const char* relative : {"1e-8", "1e-10", "1e-12"}) {
      const TemporaryFolder out;
      const Finished run =
          run_program({"run", kScripts + "/../../scenarios/tutorials/" + scene, "--out", out.path(), "--until", "0.15", "--quiet", "--set",
                       "mission.integrator.method=ark_implicit", "--set", fmt::format("mission.integrator.relative={}", relative)},
                      out.path());
      EXPECT_FALSE(has(run.err, "W0402")) << scene << relative << run.err;
    }
}

TEST(Program, AFullDiskIsAFailureOfTheRun) {
  const TemporaryFolder dir;
  const Finished run =
      run_program({"run", "pendulum", "--out", dir.path(), "--quiet", "--set", "mission.output.rate=1000 Hz"}, kMissions, [] {
        const rlimit limit{200'000, 200'000};  // [B] of one file; the results begin with less than half of that
        setrlimit(RLIMIT_FSIZE, &limit);
      });
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_TRUE(run.err.starts_with("failure[N0204]: the results cannot be written any more\n  t = ")) << run.err;
  EXPECT_GT(summary_of(dir.path())["simulated_s"], 0.0) << "what is known is written";
}

TEST(Program, AKilledRunLeavesResultsThatCanBeRead) {
  const TemporaryFolder dir;
  const Finished run =
      run_program({"run", "pendulum", "--out", dir.path(), "--set", "mission.duration=100 day"}, kMissions, [] { alarm(4); });
  EXPECT_EQ(run.exit_code, -1) << "killed by the alarm";
  const auto time = Hdf5File::open(dir / "run.h5").read_doubles("/time").values;
  EXPECT_GT(time.size(), 100u);
}

TEST(Program, ReportsAreMadeAgain) {
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path(), "--quiet"}, kMissions).exit_code, 0);
  const std::string first = file_text(dir / "report.html");
  EXPECT_EQ(run_program({"report", dir / "run.h5", "--out", dir / "again.html"}, dir.path()).exit_code, 0);
  EXPECT_EQ(file_text(dir / "again.html"), first);
  EXPECT_EQ(run_program({"report", dir / "absent.h5"}, dir.path()).exit_code, 2);
  fs::remove(dir / "report.html");
  EXPECT_EQ(run_program({"report", dir.path()}, "/").exit_code, 0) << "of the folder of results";
  EXPECT_EQ(file_text(dir / "report.html"), first);
  const TemporaryFolder empty;
  EXPECT_EQ(run_program({"report", empty.path()}, "/").exit_code, 2) << "of a folder without results";
}

TEST(Program, AParameterThatBeginsWithASignOrADotIsATextUnlessADigitFollows) {
  const TemporaryFolder dir;
  write(dir / "scenario.lua",
        "local p = parameters { file = '../data/twin.so', sign = '-', ten = '+.1 m', two = ' 2 m', set = '1 m' }\n"
        "vehicle 'vehicle.yaml'\n"
        "mission { duration = 1 }\n"
        "check { name = 'texts', value = function() return #p.file + #p.sign end, equal = { 16 } }\n"
        "check { name = 'number', value = function() return p.ten + p.two + p.set end, equal = { 5.1 } }\n");
  fs::copy(kErrors + "/pendulum.yaml", dir / "vehicle.yaml");
  const Finished run = run_program({"run", ".", "--set", "set= 3 m", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(Program, ReportsDrawAFigureOfSomeChannels) {
  const TemporaryFolder dir;
  ASSERT_EQ(run_program({"run", "pendulum", "--out", dir.path(), "--quiet"}, kMissions).exit_code, 0);
  const std::vector<std::string> both = {"report",           dir.path(), "--plot",
                                         "hinges/rod/angle", "--plot",   "nodes/rod.end/position.z,hinges/rod/rate"};
  ASSERT_EQ(run_program(both, "/").exit_code, 0);
  const std::string svg = file_text(dir / "figure.svg");
  const auto count = [&](const std::string& what) {
    std::size_t n = 0;
    for (auto at = svg.find(what); at != std::string::npos; at = svg.find(what, at + 1)) ++n;
    return n;
  };
  EXPECT_EQ(count("fill=\"none\""), 3u) << "lines";
  EXPECT_EQ(count(">nodes/rod.end/position.z</tspan>"), 1u);
  EXPECT_EQ(count(">rad</text>"), 1u);
  EXPECT_EQ(count(">m, rad/s</text>"), 1u) << "the second panel has two units";
  EXPECT_EQ(count("nan") + count("inf"), 0u);
  const Finished no_channel = run_program({"report", dir.path(), "--plot", "hinges/rod/angel"}, "/");
  EXPECT_EQ(no_channel.exit_code, 2);
  EXPECT_NE(no_channel.err.find("C0208"), std::string::npos) << no_channel.err;
  EXPECT_NE(no_channel.err.find("did you mean \"hinges/rod/angle\"?"), std::string::npos) << no_channel.err;
  const Finished no_component = run_program({"report", dir.path(), "--plot", "nodes/rod.end/position.w"}, "/");
  EXPECT_NE(no_component.err.find("one of: x, y, z"), std::string::npos) << no_component.err;
  EXPECT_EQ(run_program({"report", dir.path(), "--plot", ""}, "/").exit_code, 2) << "no channel at all";
}

TEST(Program, CheckValidatesWithoutARun) {
  const TemporaryFolder dir;
  const Finished good = run_program({"check", kMissions + "/pendulum"}, dir.path());
  EXPECT_EQ(good.exit_code, 0);
  EXPECT_EQ(good.out,
            "ok: 1 body, 1 coordinates, 1 velocities, 0 modes, 1 controller, 1 event, 3 checks, 4 s\n"
            "cannot be resumed: kept outside of persist{}: ticks (scenario.lua:10)\n");
  EXPECT_TRUE(fs::is_empty(dir.path()));
  EXPECT_EQ(run_program({"check", kErrors + "/C0201_unknown_body"}, dir.path()).exit_code, 2);
}

TEST(Program, DescribeHasAMassLedgerThatSumsUp) {
  const Finished run = run_program({"describe", "merged", "--json"}, kMissions);
  const json masses = json::parse(run.out)["masses"];
  EXPECT_EQ(masses["total"], 13.0);
  // 10 kg at the origin, 3 kg at x = 2: mass centre at 6/13; own inertias 1 + 1, and 10 (6/13)^2 + 3 (20/13)^2 across
  // x.
  EXPECT_NEAR(masses["com_world"][0], 6.0 / 13, 1e-15);
  EXPECT_NEAR(masses["inertia_world_about_com"][0][0], 2.0, 1e-14);
  EXPECT_NEAR(masses["inertia_world_about_com"][1][1], 2.0 + 10 * 36.0 / 169 + 3 * 400.0 / 169, 1e-14);
  const Finished text = run_program({"describe", "merged"}, kMissions);
  EXPECT_NE(text.out.find("merged with the body it is fixed to"), std::string::npos);
  EXPECT_NE(text.out.find("gravity: uniform [0, 0, -10] m/s^2"), std::string::npos);
  EXPECT_NE(text.out.find("  mission.integrator.method = dopri5\n"), std::string::npos) << "every default is told";
}

TEST(Program, DescribeTellsTheProgramAndTheModes) {
  const json flexible = json::parse(run_program({"describe", "flexible", "--json"}, kMissions).out);
  EXPECT_EQ(flexible["modes"][0]["kept"], 4);
  EXPECT_EQ(flexible["modes"][0]["audit"][0]["kept"], true);
  const std::string loaded = json::parse(run_program({"describe", "free_body", "--json"}, kMissions).out)["program"];
  const std::string unloaded = json::parse(run_program({"describe", "drive", "--json"}, kMissions).out)["program"];
  EXPECT_NE(loaded.find("node wrenches"), std::string::npos);
  EXPECT_EQ(unloaded.find("node wrenches"), std::string::npos) << "a scene without loads has no op for them";
}

TEST(Program, DescribeTellsWhyAccelerationsAreRefined) {
  const std::string graded = json::parse(run_program({"describe", "graded_masses", "--json"}, kMissions).out)["program"];
  const std::string plain = json::parse(run_program({"describe", "pendulum", "--json"}, kMissions).out)["program"];
  EXPECT_NE(graded.find("refinement of v'"), std::string::npos) << graded;
  EXPECT_NE(graded.find("the mass of p3 is "), std::string::npos) << graded;
  EXPECT_EQ(plain.find("refinement"), std::string::npos);
}

TEST(Program, PluginsAreLoadedAndChecked) {
  const TemporaryFolder dir;
  fs::copy(CARDAN_BINARY_DIR "/plugins/custom_cam.so", dir / "cam.so");
  write(dir / "vehicle.yaml",
        "cardan: 1\nbodies:\n  slider: {mass: 1, inertia: [1, 1, 1], hinge: {type: custom_cam, to: world, axis: [0, 0, "
        "1], a: 0.1, b: 0.2, c: 0.3}}\n");
  write(dir / "scenario.lua", "plugin 'cam.so' vehicle 'vehicle.yaml' mission { duration = 1 } initial { slider = { rate = 1 } }");
  const Finished check = run_program({"check-plugin", "cam.so"}, dir.path(), {});
  EXPECT_EQ(check.exit_code, 0) << check.err;
  EXPECT_TRUE(check.out.starts_with("ok    hinge custom_cam: ")) << check.out;
  const Finished run = run_program({"run", ".", "--out", "out", "--check-against-reference"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(Hdf5File::open(dir / "out/run.h5").read_texts("/run/plugins").front(), "cam.so");
}

TEST(Program, TellsItsVersion) {
  const Finished run = run_program({"version"}, kMissions);
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_TRUE(run.out.starts_with("cardan ")) << run.out;
}

}  // namespace
}  // namespace cardan
