// `cardan regress` and `cardan diff`: scenarios with a golden file, as a user runs them.
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/base/child_process.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// The golden file that docs/golden.md prints, about the pendulum of tests/scripts/missions.
std::string printed() {
  const std::string page = file_text(CARDAN_SOURCE_DIR "/docs/golden.md"), fence = "```yaml\n";
  const auto from = page.find(fence) + fence.size();
  return page.substr(from, page.find("```", from) - from);
}

/// A folder with scenarios.
class Regress : public testing::Test {
 protected:
  /// `name` becomes a copy of a mission with this golden file.
  void add(const std::string& name, const std::string& golden, const std::string& mission = "pendulum") {
    fs::copy(CARDAN_SOURCE_DIR "/tests/scripts/missions/" + mission, dir_ / name, fs::copy_options::recursive);
    write(dir_ / (name + "/golden.yaml"), golden);
  }
  /// Two seconds of computation, whose checks pass.
  void lengthen(const std::string& name) {
    const fs::path mission = dir_ / (name + "/scenario.lua");
    std::string text = replaced(file_text(mission), "\"4 s\"", "\"4000 s\"");
    write(mission, replaced(replaced(text, "equal = { 41, tolerance = 0 }", "below = 50000"), "equal = { 5 }", "below = 5000"));
  }
  Finished regress(std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"regress", "."});
    return run_program(more, dir_.path());
  }
  json results() { return json::parse(file_text(dir_ / "out/regress/regress.json")); }
  /// The row with this name of the scenario.
  json row(const std::string& scenario, const std::string& name) {
    const json all = results();
    for (const json& s : all["scenarios"])
      for (const json& r : s["rows"])
        if (s["name"] == scenario && r["name"] == name) return r;
    ADD_FAILURE() << scenario << ": no row " << name;
    return {};
  }
  /// The errors of a golden file that is wrong.
  json errors_of(const std::string& golden) {
    fs::remove_all(dir_ / "wrong");
    add("wrong", golden);
    const Finished run = regress({"--json-errors"});
    EXPECT_EQ(run.exit_code, 2) << run.out << run.err;
    EXPECT_FALSE(fs::exists(dir_ / "out/regress/wrong")) << "it was not run";
    const json all = json::parse(run.err, nullptr, false);
    return all.is_object() ? all["errors"] : json::array();
  }

  TemporaryFolder dir_;
};

TEST_F(Regress, TheFileOfTheDocumentsPasses) {
  add("swing", printed());
  const Finished run = regress();
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_TRUE(has(run.out, "pass  swing")) << run.out;
  EXPECT_TRUE(has(run.out, "1 of 1 scenarios pass")) << run.out;
  EXPECT_EQ(results()["verdict"], "pass");
  EXPECT_EQ(row("swing", "half period")["kind"], "check") << "checks of the scenario count too";
  EXPECT_EQ(row("swing", "hinges/rod/angle")["worst"]["limit"], 1e-8);
}

TEST_F(Regress, ADifferenceFailsWithItsTimeItsLimitAndTheReasonOfThat) {
  add("swing", replaced(printed(), "0.2498277694781558", "0.2498277794781558"));  // by 1e-8 at t = 2 s
  add("right", printed());
  const Finished run = regress();
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_TRUE(has(run.out, "FAIL  swing")) << run.out;
  EXPECT_TRUE(has(run.out, "pass  right")) << run.out;
  EXPECT_TRUE(has(run.out, "why this limit: steps with a relative tolerance")) << run.out;
  const json worst = row("swing", "hinges/rod/angle")["worst"];
  EXPECT_EQ(worst["t"], 2.0);
  EXPECT_NEAR(worst["difference"].get<double>(), 1e-8, 2e-9);
  const std::string junit = file_text(dir_ / "out/regress/junit.xml");
  EXPECT_TRUE(has(junit, "<testsuite name=\"swing\"")) << junit;
  EXPECT_TRUE(has(junit, "failures=\"1\"")) << junit;
  EXPECT_TRUE(has(junit, "<failure message=\"off by ")) << junit;
  const std::string page = file_text(dir_ / "out/regress/regress.html");
  EXPECT_TRUE(has(page, "steps with a relative tolerance")) << "the reason";
  EXPECT_TRUE(has(page, "\"series\":{\"t\":[0.0,1.0,2.0,4.0]")) << "what is drawn";
  EXPECT_FALSE(has(page, "http:") || has(page, "https:")) << "no network";
}

// Forges show one alone of tests that have one name.
TEST_F(Regress, AChannelThatIsClaimedTwiceIsTwoTests) {
  const std::string claim =
      R"(  - {channel: hinges/rod/angle, class: truth, absolute: 1 rad, why: a bound, reference: {final: [0.1], unit: rad}}
)";
  add("twice", "cardan_golden: 1\ntruth: a bound\nchannels:\n" + claim + replaced(claim, "1 rad", "1e-9 rad"));
  EXPECT_EQ(regress().exit_code, 1);
  const std::string junit = file_text(dir_ / "out/regress/junit.xml");
  EXPECT_TRUE(has(junit, "name=\"channel: hinges/rod/angle\" time=\"0.000\"/>")) << junit;
  EXPECT_TRUE(has(junit, "name=\"channel: hinges/rod/angle (2)\" time=\"0.000\">\n      <failure")) << junit;
}

// As many words as components: "N m s" of three was taken for N, m and s.
TEST_F(Regress, UnitsOfSeveralWordsAreThoseOfEachComponent) {
  add("units", R"(cardan_golden: 1
truth: constants of the script
channels:
  - {channel: h, class: truth, absolute: 1e-9 N m s, why: constants, reference: {final: [1, 2, 3], unit: N m s}}
  - {channel: k, class: truth, absolute: 1e-9 kg m^2/s, why: constants, reference: {final: [4, 5], unit: kg m^2/s}}
  - {channel: reactions/rod, components: [mx, my, mz], class: truth, absolute: 1e6 N m, why: a unit, reference: {final: [0, 0, 0], unit: N m}}
)");
  write(dir_ / "units/scenario.lua", file_text(dir_ / "units/scenario.lua") + R"(
local s = signals { h = { unit = "N m s", components = { "x", "y", "z" } }, k = { unit = "kg m^2/s", components = { "a", "b" } } }
controller { name = "constants", rate = "10 Hz", step = function() s.h(1, 2, 3) s.k(4, 5) end }
)");
  const Finished run = regress();
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_TRUE(has(file_text(dir_ / "out/regress/units/report.html"), "\"N*m*s N*m*s N*m*s\"")) << "each on the page";
}

// A quaternion x, y, z, w in place of w, x, y, z: numbers of other components are not compared place by place.
TEST_F(Regress, AReferenceHasTheComponentsOfTheChannel) {
  const std::string golden =
      "cardan_golden: 1\ntruth: another program\nchannels:\n  - {channel: k, class: truth, absolute: 1e-9, "
      "why: constants, reference: ";
  add("swing", golden + "{final: [4, 4], unit: 1}}\n");
  const std::string mission = file_text(dir_ / "swing/scenario.lua");
  const auto named = [&](const std::string& names) {
    write(dir_ / "swing/scenario.lua", mission + "local s = signals { k = { unit = '1', components = { " + names +
                                           " } } }\ncontroller { name = 'constants', rate = '10 Hz', step = function() s.k(4, 4) end }\n");
  };
  named("'a', 'b'");
  EXPECT_EQ(regress().exit_code, 0);
  fs::copy(dir_ / "out/regress/swing/run.h5", dir_ / "swing/truth.h5");
  write(dir_ / "swing/golden.yaml", golden + "{file: truth.h5}}\n");
  EXPECT_EQ(regress().exit_code, 0);
  named("'b', 'a'");
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_TRUE(has(results().dump(), "a reference of b, a, as the channel has them")) << results().dump(1);
}

// They were told to be zero, and to pass.
TEST_F(Regress, BalancesThatNobodyKeepsAreNotJudged) {
  const std::string none = printed() + "settings: {mission.ledger: false}\n", bound = "ledger: {energy: 1e-3, why: a bound}\n";
  add("none", none);
  EXPECT_EQ(regress().exit_code, 0);
  EXPECT_TRUE(summary_of(dir_ / "out/regress/none")["ledger"].is_null());
  EXPECT_FALSE(has(results().dump(), "\"kind\":\"ledger\""));
  EXPECT_TRUE(fs::exists(dir_ / "out/regress/none/report.html"));
  write(dir_ / "none/golden.yaml", none + bound);
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_TRUE(has(results().dump(), "none: mission.ledger is false")) << results().dump(1);
  write(dir_ / "none/golden.yaml", printed() + bound);
  EXPECT_EQ(regress().exit_code, 0);
}

TEST_F(Regress, AFailedCheckOfTheScenarioFails) {
  add("swing", printed() + "settings: {start: 31 deg}\n");  // which the period knows
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_EQ(row("swing", "half period")["verdict"], "fail");
}

TEST_F(Regress, WhatIsWrongInAGoldenFileIsNamedByPlaceBeforeAnythingRuns) {
  struct Fault {
    std::string was, is, code, at;
  };
  for (const Fault& f :
       {Fault{"truth: >", "truths: >", "C0105", "truth"},
        {"cardan_golden: 1", "cardan_golden: 2", "C0401", "cardan_golden"},
        {"    class: integration\n", "", "C0105", "channels[0].class"},
        {"class: integration", "class: nearly", "C0208", "channels[0].class"},
        {"    absolute: 1e-8 rad\n", "", "C0105", "channels[0].absolute"},
        {"absolute: 1e-8 rad", "absolute: 1e-8", "C0107", "channels[0].absolute"},
        {"absolute: 1e-8 rad", "absolute: 1e-8 kg", "C0107", "channels[0].absolute"},
        {"absolute: 1e-8 rad", "absolute: -1 rad", "C0301", "channels[0].absolute"},
        {"class: integration", "class: same bits", "C0106", "channels[0].absolute"},
        {"    why: steps with", "    way: steps with", "C0105", "channels[0].why"},
        {"times: [0, 1, 2, 4]", "times: [0, 1, 2]", "C0106", "channels[0].reference.values"},
        {"times: [0, 1, 2, 4]", "times: [0, 2, 1, 4]", "C0301", "channels[0].reference.times"},
        {"-0.450337349942642", "nan", "C0108", "channels[0].reference.values[1]"},
        {"      unit: rad", "", "C0105", "channels[0].reference.unit"},
        {"reference:", "references:", "C0105", "channels[0].reference"},
        {"cardan_golden: 1", "cardan_golden: 1\nscenario: other.lua", "C0102", "scenario"},
        {"cardan_golden: 1", "cardan_golden: 1\nledger: {why: trust}", "C0105", "ledger"},
        {"cardan_golden: 1", "cardan_golden: 1\nseed: -1", "C0301", "seed"},
        {"cardan_golden: 1", "cardan_golden: 1\nseed: 1.5", "C0301", "seed"},
        {"cardan_golden: 1", "cardan_golden: 1\nlimits: {memory: 3 kg}", "C0107", "limits.memory"},
        {"cardan_golden: 1", "cardan_golden: 1\nlimits: {memory: 1 MiB}", "C0301", "limits.memory"},
        {"cardan_golden: 1", "cardan_golden: 1\nlimits: {memory: -4 GiB}", "C0301", "limits.memory"},
        {"cardan_golden: 1", "cardan_golden: 1\nlimits: {file: 1e300 GiB}", "C0301", "limits.file"},
        {"cardan_golden: 1", "cardan_golden: 1\nlimits: {time: 1e300 s}", "C0301", "limits.time"},
        {"    class:", "    components: angle\n    class:", "C0106", "channels[0].components"},
        {"times: [0, 1, 2, 4]\n      values", "deviation: [1, -1, 1, 1]\n      mean", "C0301", "channels[0].reference.deviation"}}) {
    const json errors = errors_of(replaced(printed(), f.was, f.is));
    EXPECT_TRUE(std::any_of(errors.begin(), errors.end(), [&](const json& e) { return e["code"] == f.code && e["at"] == f.at; }))
        << f.is << "\n"
        << errors.dump(1);
    for (const json& e : errors) EXPECT_TRUE(has(e["file"], "wrong/golden.yaml")) << errors.dump(1);
  }
  // A mean is told of thirty values, beside a deviation of five.
  for (const auto& [beside, independent, good] :
       {std::tuple{"", 29, false}, {"", 30, true}, {"deviation: 1\n      ", 4, false}, {"deviation: 1\n      ", 5, true}}) {
    const std::string golden = printed();
    const json errors = errors_of(golden.substr(0, golden.find("    class:")) +
                                  "    class: statistical\n    confidence: 0.999\n    independent: " + std::to_string(independent) +
                                  "\n    why: noise\n    reference:\n      " + beside + "mean: 0.1\n      unit: rad\nnothing: 1\n");
    const bool told = std::any_of(errors.begin(), errors.end(), [](const json& e) { return e["at"] == "channels[0].independent"; });
    EXPECT_NE(told, good) << errors.dump(1);
  }
}

TEST_F(Regress, WhatIsHiddenBuiltOrPutOutIsNotSearched) {
  add("swing", printed());
  for (const char* aside : {"out", "build-here", ".hidden"}) {
    fs::create_directories(dir_ / aside);
    add(std::string(aside) + "/swing", "truth: it is not read\n");
  }
  fs::copy(dir_ / "out/swing/golden.yaml", dir_ / "swing/.golden.yaml");
  EXPECT_EQ(regress().exit_code, 0);
}

TEST_F(Regress, AChannelAComponentOrAUnitThatTheRunDoesNotHaveIsAFailedRow) {
  add("channel", replaced(printed(), "hinges/rod/angle", "hinges/rod/angel"));
  add("component", replaced(printed(), "    class:", "    components: [x]\n    class:"));
  add("unit", replaced(replaced(printed(), "unit: rad", "unit: m"), "1e-8 rad", "1e-8 m"));
  add("time", replaced(printed(), "[0, 1, 2, 4]", "[0, 1, 2, 5]"));
  add("width", replaced(printed(), "hinges/rod/angle", "nodes/rod.end/position"));
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_TRUE(has(row("channel", "hinges/rod/angel")["text"], "did you mean \"hinges/rod/angle\"?"));
  EXPECT_TRUE(has(row("channel", "hinges/rod/angel")["text"], "channel/golden.yaml:"));
  EXPECT_TRUE(has(row("component", "hinges/rod/angle x")["text"], "a component of hinges/rod/angle"));
  EXPECT_TRUE(has(row("unit", "hinges/rod/angle")["text"], "which is in rad"));
  EXPECT_TRUE(has(row("time", "hinges/rod/angle")["text"], "none at t = 5 s"));
  EXPECT_TRUE(has(row("width", "nodes/rod.end/position")["text"], "a reference of 3 numbers"));
}

TEST_F(Regress, AReferenceWithoutATimeThatCountsIsAFailedRow) {
  add("swing", replaced(printed(), "    class:", "    from: 2.5\n    to: 3.5\n    class:"));
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_TRUE(has(row("swing", "hinges/rod/angle")["text"], "a time of the reference between `from` and `to`"));
}

TEST_F(Regress, AReferenceMayBeInAnotherUnitThatMeasuresTheSame) {
  std::string golden = printed();
  golden = replaced(golden, "times: [0, 1, 2, 4]", "times: [0]");
  golden = golden.substr(0, golden.find("      values:")) + "      values: [30]\n      unit: deg\n";
  add("swing", golden);
  EXPECT_EQ(regress().exit_code, 0);
}

TEST_F(Regress, ReferencesMayBeTables) {
  std::string golden = printed();
  golden = golden.substr(0, golden.find("    reference:")) + "    reference: {file: truth.csv, columns: [angle]}\n";
  const std::string table = "# Jacobi's cd\nt [s], rate [rad/s], angle [rad]\n0, 0, 0.5235987755982989\n1, 0, -0.450337349942642\n";
  add("swing", golden);
  write(dir_ / "swing/truth.csv", table);
  write(dir_ / "swing/golden.yaml", replaced(golden, "[angle]", "angle"));
  EXPECT_EQ(json::parse(regress({"--json-errors"}).err)["errors"][0]["at"], "channels[0].reference.columns");
  write(dir_ / "swing/golden.yaml", golden);
  EXPECT_EQ(regress().exit_code, 0) << file_text(dir_ / "out/regress/regress.json");
  write(dir_ / "swing/truth.csv", replaced(replaced(table, "t [s]", "t [ms]"), "\n1, 0", "\n1000, 0"));
  EXPECT_EQ(regress().exit_code, 0) << file_text(dir_ / "out/regress/regress.json");
  write(dir_ / "swing/truth.csv", table.substr(0, table.size() - 12));  // cut in the middle of a number
  EXPECT_EQ(regress().exit_code, 1);
  for (const auto& [was, is, got] :
       {std::tuple{", -0.45", "; -0.45", "2"}, {"rate [rad/s]", "rate", "\"rate\""}, {"0.5235", "x", "\"x987755982989\""}}) {
    write(dir_ / "swing/truth.csv", replaced(table, was, is));
    const Finished run = regress({"--json-errors"});
    EXPECT_EQ(run.exit_code, 2) << run.out;
    const json error = json::parse(run.err)["errors"][0];
    EXPECT_TRUE(has(error["file"], "truth.csv")) << error.dump(1);
    EXPECT_GT(error["line"], 0);
    EXPECT_EQ(error["got"], got);
  }
}

TEST_F(Regress, RecordedReferencesAreWrittenForThoseNamedAndTheReasonIsKept) {
  std::string golden = printed();
  golden = replaced(golden.substr(0, golden.find("    reference:")), "    absolute: 1e-8 rad\n", "") +
           "    reference: {recorded: reference.h5, every: 20}\n";
  golden = replaced(golden, "class: integration", "class: same bits");
  add("one", golden);
  add("two", golden);
  const Finished before = regress();
  EXPECT_EQ(before.exit_code, 2);
  EXPECT_TRUE(has(before.err, "--update one --why")) << before.err;
  EXPECT_EQ(regress({"--update", "one"}).exit_code, 2) << "without a reason";
  const Finished update = regress({"--update", "one", "--why", "the first \"record\""});
  EXPECT_EQ(update.exit_code, 0) << update.out << update.err;
  EXPECT_TRUE(fs::exists(dir_ / "one/reference.h5"));
  EXPECT_FALSE(fs::exists(dir_ / "two/reference.h5"));
  EXPECT_TRUE(has(file_text(dir_ / "one/golden.yaml"), "why: \"the first \\\"record\\\"\"")) << file_text(dir_ / "one/golden.yaml");
  EXPECT_EQ(regress({"--only", "one"}).exit_code, 0) << "the same bits again";
  EXPECT_EQ(regress({"--update", "two", "--update", "one", "--why", "both"}).exit_code, 0);
  EXPECT_TRUE(has(file_text(dir_ / "one/golden.yaml"), "why: \"both\"\n"));
  fs::resize_file(dir_ / "one/reference.h5", 1000);
  const Finished cut = regress();
  EXPECT_EQ(cut.exit_code, 2);
  EXPECT_TRUE(has(cut.err, "one/reference.h5")) << cut.err;
}

TEST_F(Regress, WhatTheChecksOfAScenarioRefuseIsNotRecorded) {
  std::string golden = printed();
  golden = replaced(golden.substr(0, golden.find("    reference:")), "    absolute: 1e-8 rad\n", "") +
           "    reference: {recorded: reference.h5}\nsettings: {start: 31 deg}\n";
  add("swing", replaced(golden, "class: integration", "class: same bits"));
  EXPECT_EQ(regress({"--update", "swing", "--why", "no reason"}).exit_code, 1);
  EXPECT_FALSE(fs::exists(dir_ / "swing/reference.h5"));
  EXPECT_EQ(row("swing", "half period")["verdict"], "fail");
}

/// The golden file of the documents with a recorded reference in place of its truth.
std::string recorded(const std::string& file = "reference.h5", const std::string& more = "") {
  std::string golden = printed();
  golden = replaced(golden.substr(0, golden.find("    reference:")), "    absolute: 1e-8 rad\n", "");
  return replaced(golden, "class: integration", "class: same bits") + "    reference: {recorded: " + file + more + "}\n";
}

TEST_F(Regress, WhatCannotBeRecordedIsRefusedBeforeAnythingIsTouched) {
  const auto expect_refused = [&](const std::string& golden, const std::string& says, int code = 2, const std::string& why = "better") {
    write(dir_ / "swing/golden.yaml", golden);
    const auto before = content_of(dir_ / "swing");
    const Finished run = regress({"--update", "swing", "--why", why});
    EXPECT_EQ(run.exit_code, code) << golden << run.out << run.err;
    EXPECT_TRUE(has(run.out + run.err, says)) << says << "\n" << run.out << run.err;
    EXPECT_EQ(content_of(dir_ / "swing"), before);
  };
  add("swing", recorded());
  ASSERT_EQ(regress({"--update", "swing", "--why", "the first"}).exit_code, 0);
  expect_refused(recorded(), "an empty reason", 2, " \n");
  for (const char* name : {"scenario.lua", "../reference.h5", "/reference.h5", "deep/reference.h5", "''"})
    expect_refused(recorded(name), "a file beside this one: reference.h5");
  fs::copy(dir_ / "out/regress/swing/run.h5", dir_ / "swing/truth.h5");
  expect_refused(recorded("truth.h5"), "a recorded reference of this golden file, or nothing yet");
  write(dir_ / "swing/slow.golden.yaml", recorded());
  EXPECT_TRUE(has(regress({"--update", "swing/slow", "--why", "mine"}).err, "that of golden.yaml"));
  fs::remove(dir_ / "swing/slow.golden.yaml");
  expect_refused(recorded() + "updates: [{program: a, why: b}]\n", "a list with a dash for each entry");
  expect_refused(recorded() + "updates: []\n", "a list with a dash for each entry");
  expect_refused(recorded() + "updates:\n  - {program: a, why: b}\nchecks: [ticks]\n", "a list with a dash for each entry");
  const std::string other = "  - channel: hinges/rod/angle\n    class: truth\n    absolute: 1e-3 rad\n    why: not at all\n";
  expect_refused(recorded() + other + "    reference: {final: 3, unit: rad}\n", "hinges/rod/angle: off by", 1);
  expect_refused(recorded() + other + "    reference: {recorded: reference.h5, every: 2}\n", "the same `every`");

  const std::string mission = file_text(dir_ / "swing/scenario.lua");
  write(dir_ / "swing/scenario.lua", replaced(mission, "20 Hz", "20000 Hz"));
  expect_refused(recorded(), "at most 200 kB", 1);
  write(dir_ / "swing/scenario.lua", "local log = signals { odd = { unit = '1' } }\n" +
                                         replaced(mission, "  ticks = ticks + 1\n", "  ticks = ticks + 1 log.odd(t > 2 and 0 / 0 or 1)\n"));
  expect_refused(replaced(recorded(), "hinges/rod/angle", "odd"), "finite numbers, got", 1);
}

// Of the run, of a table, of a file of results, in the run and its reference.
TEST_F(Regress, NaNEqualsNothing) {
  const std::string golden = printed().substr(0, printed().find("    reference:"));
  const auto with = [&](const std::string& reference) {
    return replaced(replaced(golden, "hinges/rod/angle", "odd"), "1e-8 rad", "1") + "    reference: " + reference + "\n";
  };
  add("swing", with("{always: 1, unit: 1}"));
  const fs::path mission = dir_ / "swing/scenario.lua";
  write(mission, "local log = signals { odd = { unit = '1' } }\n" +
                     replaced(file_text(mission), "  ticks = ticks + 1\n", "  ticks = ticks + 1 log.odd(t > 2 and 0 / 0 or 1)\n"));
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_EQ(row("swing", "odd")["verdict"], "fail");
  EXPECT_EQ(row("swing", "odd")["worst"]["is"], nullptr) << results().dump(1);
  fs::copy(dir_ / "out/regress/swing/run.h5", dir_ / "swing/truth.h5");
  write(dir_ / "swing/golden.yaml", with("{file: truth.h5}"));
  EXPECT_NE(regress().exit_code, 0) << "the same file on both sides";
  write(dir_ / "swing/truth.csv", "t [s], odd [1]\n0, 1\n1, nan\n");
  write(dir_ / "swing/golden.yaml", with("{file: truth.csv}"));
  const Finished table = regress();
  EXPECT_EQ(table.exit_code, 2) << table.out;
  EXPECT_TRUE(has(table.err, "swing/truth.csv:3")) << table.err;
}

TEST_F(Regress, TheReasonIsAddedBelowTheOthersAsTheyAreIndented) {
  for (const std::string indent : {"", "  ", "      "}) {
    const std::string golden =
        recorded() + "updates:\n" + indent + "- program: a\n" + indent + "  why: b\n" + indent + "- why: c\n" + indent + "  program: d";
    add("swing" + indent, golden);
    const Finished run = regress({"--update", "swing" + indent, "--why", "x: \"#\" \\ \x01"});
    EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
    const std::string text = file_text(dir_ / ("swing" + indent + "/golden.yaml"));
    EXPECT_TRUE(text.starts_with(golden + "\n" + indent + "- program: \"")) << text;
    EXPECT_TRUE(text.ends_with("\n" + indent + "  why: \"x: \\\"#\\\" \\\\ ?\"\n")) << text;
  }
  EXPECT_EQ(regress().exit_code, 0);
}

TEST_F(Regress, AGoldenFileThatIsEditedWhileItIsRecordedIsKept) {
  add("swing", recorded("reference.h5", ", every: 100"));
  lengthen("swing");
  Started update({"regress", ".", "--update", "swing", "--why", "better"}, dir_.path());
  ASSERT_TRUE(wait_until([&] { return fs::exists(dir_ / "out/regress/swing/run.h5"); }));
  write(dir_ / "swing/golden.yaml", recorded("reference.h5", ", every: 100") + "# by hand\n");
  const auto before = content_of(dir_ / "swing");
  const Finished end = update.wait();
  EXPECT_EQ(end.exit_code, 1) << end.err;
  EXPECT_TRUE(has(end.out, "the golden file as it was before the run")) << end.out;
  EXPECT_EQ(content_of(dir_ / "swing"), before);
}

TEST_F(Regress, TruthsFromElsewhereAreNeverRewritten) {
  add("swing", printed());
  const Finished run = regress({"--update", "swing", "--why", "it fails"});
  EXPECT_EQ(run.exit_code, 2) << run.out;
  EXPECT_TRUE(has(run.err, "edited by hand")) << run.err;
  EXPECT_EQ(file_text(dir_ / "swing/golden.yaml"), printed());
}

TEST_F(Regress, ARunThatEndsBadlyIsAFailedRowAndTheOthersGoOn) {
  add("right", printed());
  add("long", printed() + "limits: {time: 1 s}\n");
  write(dir_ / "long/scenario.lua", replaced(file_text(dir_ / "long/scenario.lua"), "\"4 s\"", "\"1e6 s\""));
  add("large", printed() + "limits: {memory: 300 MiB}\n");
  write(dir_ / "large/scenario.lua", "local t = {} for i = 1, 1e9 do t[i] = { i } end\n");
  add("wrong", printed());
  write(dir_ / "wrong/scenario.lua", "local p = parametres {}\n");
  add("failed", printed());
  write(dir_ / "failed/scenario.lua",
        file_text(dir_ / "failed/scenario.lua") + "controller { name = \"x\", rate = \"1 Hz\", step = function() error(\"no\") end }\n");
  const Finished run = regress({"-j", "2"});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_TRUE(has(run.out, "1 of 5 scenarios pass")) << run.out;
  json ended;
  const json all = results();
  for (const json& s : all["scenarios"]) ended[s["name"]] = s;
  EXPECT_EQ(ended["right"]["verdict"], "pass");
  EXPECT_EQ(ended["long"]["ended"], "out of time") << ended["long"].dump(1);
  EXPECT_EQ(ended["wrong"]["exit_code"], 2);
  EXPECT_TRUE(has(ended["wrong"]["text"], "scenario.lua:1")) << ended["wrong"].dump(1);
  EXPECT_EQ(ended["failed"]["exit_code"], 3);
  EXPECT_TRUE(has(ended["failed"]["text"], "N0303")) << ended["failed"].dump(1);
  EXPECT_EQ(ended["large"]["verdict"], "fail") << ended["large"].dump(1);
#ifndef CARDAN_ADDRESS_CHECKS
  EXPECT_EQ(ended["large"]["ended"], "out of memory") << ended["large"].dump(1);
  EXPECT_FALSE(has(ended["large"]["text"], "expected")) << ended["large"].dump(1);
#endif
}

struct RunFault {
  const char *name, *ended, *text;
};
class RegressPlugin : public Regress, public testing::WithParamInterface<RunFault> {
 protected:
  /// A scenario with the hinge of the plugin `faulty`, and one without a plugin.
  void SetUp() override {
    add("right", printed());
    fs::create_directory(dir_ / "slide");
    fs::copy(CARDAN_BINARY_DIR "/plugins/faulty.so", dir_ / "slide/p.so");
    write(dir_ / "slide/vehicle.yaml", "cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: faulty/slide, to: world}}\n");
    write(dir_ / "slide/scenario.lua",
          "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1, integrator = { method = 'rk4', step = 0.25 } } initial { a = { "
          "rate = 1 } }\n");
    // to fill a gigabyte takes its time
    const std::string time = GetParam().ended == std::string("out of time") ? "2 s" : "5 min";
    write(dir_ / "slide/golden.yaml",
          "cardan_golden: 1\ntruth: it goes on\nlimits: {time: " + time +
              ", memory: 1 GiB}\nchannels:\n"
              "  - {channel: hinges/a/s, class: round-off, absolute: 1e-12 m, why: four steps, reference: {final: 1, unit: m}}\n");
  }
};

TEST_P(RegressPlugin, ThatEndsTheRunIsAFailedRowAndTheOthersAreKept) {
#ifdef CARDAN_ADDRESS_CHECKS
  if (GetParam().ended == std::string("out of memory")) GTEST_SKIP() << "memory is not limited then";
#endif
  ASSERT_EQ(regress().exit_code, 0) << "without the fault";
  const auto [name, ended, text] = GetParam();
  const Finished run = run_program({"regress", ".", "-j", "1"}, dir_.path(), [fault = name] { setenv("CARDAN_FAULT", fault, 1); });
  EXPECT_EQ(run.exit_code, 1) << run.out << run.err;
  EXPECT_TRUE(has(run.out, "1 of 2 scenarios pass")) << run.out;
  EXPECT_TRUE(has(run.out, "pass  right") && has(run.out, "FAIL  slide") && has(run.out, text)) << run.out;
  const json table = results();
  json all;
  for (const json& s : table["scenarios"]) all[s["name"]] = s;
  EXPECT_EQ(table["verdict"], "fail");
  EXPECT_EQ(all["right"]["verdict"], "pass");
  EXPECT_EQ(all["slide"]["verdict"], "fail");
  EXPECT_EQ(all["slide"]["ended"], ended) << all["slide"].dump(1);
  EXPECT_TRUE(has(all["slide"]["text"], text)) << all["slide"].dump(1);
  EXPECT_EQ(row("slide", "ends as planned")["verdict"], "fail");
  const std::string junit = file_text(dir_ / "out/regress/junit.xml"), page = file_text(dir_ / "out/regress/regress.html");
  EXPECT_TRUE(has(junit, "<testcase classname=\"right\" name=\"channel: hinges/rod/angle\"")) << junit;
  EXPECT_TRUE(has(junit, "<testsuite name=\"slide\"") && has(junit, std::string("<failure message=\"") + text)) << junit;
  EXPECT_TRUE(has(page, text) && has(page, "hinges/rod/angle")) << "both are on the page";
}
INSTANTIATE_TEST_SUITE_P(, RegressPlugin,
                         testing::Values(RunFault{"abort_late", "crashed", "crashed: killed by signal 6 (Aborted)"},
                                         RunFault{"crash_late", "crashed", "crashed: killed by signal 11 (Segmentation fault)"},
                                         RunFault{"memory_late", "out of memory", "more than 1024 MiB of memory"},
                                         RunFault{"loop_late", "out of time", "more than 2 s of processor time"}),
                         [](const auto& fault) { return std::string(fault.param.name); });

TEST_F(Regress, ARunThatIsLateByTheClockIsAFailedRow) {
  add("swing", printed() + "limits: {clock: 0.5 s}\n");
  lengthen("swing");
  const Finished run = regress();
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_EQ(results()["scenarios"][0]["ended"], "out of time");
  EXPECT_TRUE(has(run.out, "hung: more than 0.5 s")) << run.out;
}

TEST_F(Regress, AReportThatCannotBeWrittenIsToldAndTheOthersAreWritten) {
  add("swing", printed());
  lengthen("swing");
  Started regress({"regress", "."}, dir_.path());
  ASSERT_TRUE(wait_until([&] { return fs::exists(dir_ / "out/regress/swing/run.h5"); }));
  fs::create_directory(dir_ / "out/regress/regress.json");
  const Finished end = regress.wait();
  EXPECT_EQ(end.exit_code, 4) << end.out << end.err;
  EXPECT_TRUE(has(end.err, "error[C0701]") && has(end.err, "out/regress/regress.json") && !has(end.err, "Nothing was run")) << end.err;
  for (const char* other : {"junit.xml", "regress.html"}) EXPECT_TRUE(fs::exists(dir_ / ("out/regress/" + std::string(other)))) << other;
}

// The limit of another is not that of the golden file: what it strikes down has crashed.
TEST_F(Regress, ARunThatIsKilledHasCrashed) {
  add("swing", printed());
  write(dir_ / "swing/scenario.lua", replaced(file_text(dir_ / "swing/scenario.lua"), "\"4 s\"", "\"1e6 s\""));
  const Finished run = run_program({"regress", "."}, dir_.path(), [] {
    const rlimit second{1, 1};
    setrlimit(RLIMIT_CPU, &second);
  });
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_EQ(results()["scenarios"][0]["ended"], "crashed");
  EXPECT_TRUE(has(run.out, "crashed: killed by signal 9 (Killed)")) << run.out;
}

TEST_F(Regress, AGoldenFileThatIsWrongIsAFailedRowAndTheOthersGoOn) {
  add("right", printed());
  add("wrong", replaced(printed(), "class: integration", "class: nearly"));
  add("unreadable", "{");
  add("truth", printed());
  fs::create_directories(dir_ / "out/regress");
  write(dir_ / "out/regress/truth", "a file in place of the folder");
  const Finished run = regress();
  EXPECT_EQ(run.exit_code, 2) << run.out;
  EXPECT_TRUE(has(run.out, "pass  right")) << run.out;
  EXPECT_TRUE(has(run.out, "FAIL  wrong")) << run.out;
  EXPECT_TRUE(has(run.out, "FAIL  truth")) << run.out;
  EXPECT_TRUE(has(run.out, "1 of 4 scenarios pass")) << run.out;
  EXPECT_TRUE(has(run.err, "wrong/golden.yaml:7:12")) << run.err;
  EXPECT_FALSE(has(run.err, "Nothing was run")) << run.err;
  EXPECT_EQ(row("wrong", "golden file")["problem"]["code"], "C0208");
  EXPECT_EQ(row("unreadable", "golden file")["problem"]["code"], "C0101");
  EXPECT_TRUE(has(file_text(dir_ / "out/regress/junit.xml"), "<testcase classname=\"unreadable\" name=\"golden: golden file\""));
  EXPECT_EQ(json::parse(regress({"--json-errors"}).err)["errors"].size(), 2u);
}

TEST_F(Regress, WhatAScriptPrintsIsComparedByWordsAndNumbers) {
  const std::string golden =
      "cardan_golden: 1\ntruth: arithmetic\nscenario: vehicle.yaml\nscript: look.lua\nprints: {file: expected.txt, class: truth, "
      "relative: 1e-6, why: six digits}\n";
  add("look", golden);
  const auto expect = [&](const std::string& prints, const std::string& wanted, int code) {
    write(dir_ / "look/look.lua", "print(" + prints + ")\n");
    write(dir_ / "look/expected.txt", wanted);
    const Finished run = regress();
    EXPECT_EQ(run.exit_code, code) << prints << " against " << wanted << run.out << run.err;
  };
  const std::string third = "'third', 1 / 3, 'done'";
  for (const auto& [wanted, code] : {std::pair{"third 0.33333333 done\n", 0},
                                     {"third 0.3334 done\n", 1},
                                     {"thirds 0.33333333 done\n", 1},
                                     {"third 0.33333333\n", 1},
                                     {"third # done\n", 1},
                                     {"third 1e999 done\n", 1},
                                     {"third nan done\n", 1},
                                     {"", 2},
                                     {" \n", 2}})
    expect(third, wanted, code);
  expect("'#', 1, '#'", "# 1.0 #\n", 0);
  expect("'#', 1, '#'", "1 # #\n", 1);
  expect("'1e999'", "1e999\n", 0);
  expect("'a\\n  b'", "a\nb\n", 0);
  expect("'nan', 'inf'", "nan inf\n", 0);  // words
  expect("'one') assert(false", "one\n", 1);
  expect("string.rep('x', 200001)", std::string(200'001, 'x') + "\n", 2);
  fs::remove_all(dir_ / "look");
  const json errors = errors_of(golden + "checks: [one]\n");
  EXPECT_TRUE(std::any_of(errors.begin(), errors.end(), [](const json& e) { return e["at"] == "checks"; })) << errors.dump(1);
}

TEST_F(Regress, ShardsTogetherAreAll) {
  for (const char* name : {"a", "b", "c"}) add(name, printed());
  std::vector<std::string> names;
  for (const char* shard : {"1/2", "2/2"}) {
    EXPECT_EQ(regress({"--shard", shard}).exit_code, 0);
    const json all = results();
    for (const json& s : all["scenarios"]) names.push_back(s["name"]);
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"a", "b", "c"}));
  for (const char* wrong : {"0/2", "3/2", "2", "a/b", "1/2x"}) EXPECT_EQ(regress({"--shard", wrong}).exit_code, 2) << wrong;
}

TEST_F(Regress, TheSearchEndsWhereAFolderCannotBeRead) {
  add("swing", printed());
  fs::create_directories(dir_ / "closed");
  fs::permissions(dir_ / "closed", fs::perms::none);
  const Finished run = run_program({"regress", "."}, dir_.path(), [] {  // root reads all, unless it has lost the right to
    for (const int right : {1, 2}) prctl(PR_CAPBSET_DROP, right);       // CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH of <linux/capability.h>
  });
  fs::permissions(dir_ / "closed", fs::perms::owner_all);
  EXPECT_EQ(run.exit_code, 2) << run.out;
  EXPECT_TRUE(has(run.err, "./closed")) << run.err;
}

TEST_F(Regress, LinksToFoldersAreNotFollowedAndThoseToNothingAreNoFault) {
  add("swing", printed());
  fs::create_symlink("loop", dir_ / "loop");
  fs::create_symlink("nowhere", dir_ / "nothing");
  fs::create_directory_symlink(".", dir_ / "swing/again");
  EXPECT_EQ(regress().exit_code, 0);
  EXPECT_EQ(results()["scenarios"].size(), 1u);
  fs::create_directory(dir_ / "ring");
  fs::create_symlink("golden.yaml", dir_ / "ring/golden.yaml");
  EXPECT_EQ(regress().exit_code, 2);
  EXPECT_EQ(row("ring", "golden file")["problem"]["code"], "C0102");
}

TEST_F(Regress, APipeIsNotWaitedFor) {
  add("swing", printed());
  const std::string prints =
      "cardan_golden: 1\ntruth: x\nscenario: vehicle.yaml\nscript: scenario.lua\nprints: {file: pipe, class: same bits, why: y}\n";
  for (const auto& [name, golden] :
       {std::pair<std::string, std::string>{"golden.yaml", ""},
        {"pipe", prints},
        {"pipe.csv", replaced(printed().substr(0, printed().find("times:")), "reference:\n", "reference: {file: pipe.csv}\n")},
        {"pipe.lua", "scenario: pipe.lua\n" + printed()}}) {
    fs::remove_all(dir_ / "piped");
    add("piped", golden);
    fs::remove(dir_ / ("piped/" + name));
    ASSERT_EQ(mkfifo((dir_ / ("piped/" + name)).c_str(), 0600), 0);
    EXPECT_EQ(regress().exit_code, 2) << name;
    EXPECT_EQ(row("piped", "golden file")["problem"]["code"], "C0102") << name;
  }
}

TEST_F(Regress, TwoCasesOfOneNameAreRefused) {
  add("swing", printed());
  fs::create_directory(dir_ / "swing/slow");
  write(dir_ / "swing/slow/golden.yaml", printed());
  write(dir_ / "swing/slow.golden.yaml", printed());
  const Finished run = regress();
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_TRUE(has(run.err, "C0207") && has(run.err, "./swing/slow.golden.yaml") && has(run.err, "./swing/slow/golden.yaml")) << run.err;
  EXPECT_FALSE(fs::exists(dir_ / "out"));
  fs::remove_all(dir_ / "swing/slow");
  for (const char* hidden : {".golden.yaml", "...golden.yaml"}) write(dir_ / (std::string("swing/") + hidden), "no case");
  EXPECT_EQ(regress().exit_code, 0) << "names that begin with a dot are not searched";
}

TEST_F(Regress, AFileThatGrowsBeyondItsLimitIsAFailedRow) {
  add("swing", printed() + "limits: {file: 1 MiB}\n");
  write(dir_ / "swing/scenario.lua", replaced(file_text(dir_ / "swing/scenario.lua"), "20 Hz", "20000 Hz"));
  EXPECT_EQ(regress().exit_code, 1);
  EXPECT_TRUE(has(results()["scenarios"][0]["text"], "N0204")) << results().dump(1);
  EXPECT_LE(fs::file_size(dir_ / "out/regress/swing/run.h5"), 1u << 20);
}

TEST_F(Regress, ResultsDoNotGoWhereGoldenFilesAreOrWhereAnotherRunWrites) {
  add("swing", printed());
  add("long", printed());
  const std::string mission = file_text(dir_ / "long/scenario.lua");
  for (const std::string out : {".", "swing", "./swing/../long/"}) {
    const auto before = content_of(dir_ / "swing");
    const Finished run = regress({"--out", out});
    EXPECT_EQ(run.exit_code, 2) << out << run.out;
    EXPECT_TRUE(has(run.err, "where no golden file is")) << run.err;
    EXPECT_EQ(content_of(dir_ / "swing"), before);
  }
  EXPECT_EQ(run_program({"regress", "."}, dir_ / "swing").exit_code, 0) << "out/regress below is another folder";
  EXPECT_EQ(regress({"--only", "swing"}).exit_code, 0);
  const std::string report = file_text(dir_ / "out/regress/regress.json");
  write(dir_ / "long/scenario.lua", replaced(mission, "\"4 s\"", "\"1e6 s\""));
  Started first({"regress", ".", "-j", "1"}, dir_.path());
  ASSERT_TRUE(wait_until([&] { return fs::exists(dir_ / "out/regress/long/run.h5"); }));
  const Finished second = regress();
  EXPECT_EQ(second.exit_code, 2) << second.out;
  EXPECT_TRUE(has(second.err, "a run that is going on")) << second.err;
  first.send(SIGINT);
  const Finished end = first.wait();
  EXPECT_EQ(end.exit_code, 130);
  EXPECT_TRUE(has(end.out, "Interrupted: 0 of 2 scenarios were run. No report is written")) << end.out;
  EXPECT_EQ(file_text(dir_ / "out/regress/regress.json"), report);
}

TEST_F(Regress, WhatIsNoTextIsNoneInTheReportsEither) {
  add("swing<&>\xff", printed() + "settings: {nothing: 1}\n");
  EXPECT_EQ(regress().exit_code, 2);
  const std::string junit = file_text(dir_ / "out/regress/junit.xml");
  EXPECT_TRUE(has(junit, "<testsuite name=\"swing&lt;&amp;&gt;?\"")) << junit;
  EXPECT_EQ(junit.find('\xff'), std::string::npos) << junit;
  EXPECT_TRUE(has(junit, "nothing") && !has(junit, ":0,")) << junit;
}

/// What no golden file can know, the names and units of the scenario, is answered as what is wrong with it: with its line.
TEST_F(Regress, ASettingThatTheScenarioRefusesIsAFaultOfTheGoldenFile) {
  add("swing", printed()), add("wrong", printed());
  for (const auto& [setting, code, got] :
       {std::tuple{"strat: 31 deg", "C0208", "\"strat\""}, std::tuple{"start: 31 m", "C0107", "\"31 m\": length"},
        std::tuple{"bodies.rod.mas: 1", "C0104", "mas"}}) {
    write(dir_ / "wrong/golden.yaml", printed() + "settings:\n  " + setting + "\n");
    const Finished run = regress();
    EXPECT_EQ(run.exit_code, 2) << setting;
    EXPECT_TRUE(has(run.err, std::string("error[") + code + "]") && has(run.err, got)) << run.err;
    const auto lines = static_cast<int>(std::ranges::count(file_text(dir_ / "wrong/golden.yaml"), '\n'));
    EXPECT_TRUE(has(run.err, "wrong/golden.yaml:" + std::to_string(lines))) << run.err;
    EXPECT_TRUE(has(run.out, "1 of 2 scenarios pass")) << run.out;
  }
}

TEST_F(Regress, SaysWhatIsWrongWithTheCommandLine) {
  EXPECT_EQ(regress().exit_code, 2) << "no golden file";
  add("swing", printed());
  const Finished run = regress({"--only", "swign"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_TRUE(has(run.err, "did you mean \"swing\"?")) << run.err;
  EXPECT_EQ(run_program({"regress", "nowhere"}, dir_.path()).exit_code, 2);
  for (const char* jobs : {"-7", "0", "many"}) EXPECT_EQ(regress({"-j", jobs}).exit_code, 2) << jobs;
  EXPECT_EQ(regress({"--only", "swing", "--shard", "2/2"}).exit_code, 2) << "nothing is left";
  EXPECT_EQ(regress({"--only", "swing", "--shard", "1/2"}).exit_code, 0);
}

class Diff : public Regress {
 protected:
  void run(const std::string& out, std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"run", CARDAN_SOURCE_DIR "/tests/scripts/missions/pendulum", "--out", dir_ / out, "--quiet"});
    run_program(more, dir_.path());
  }
  Finished diff(std::vector<std::string> more) {
    more.insert(more.begin(), "diff");
    return run_program(more, dir_.path());
  }
};

TEST_F(Diff, TheSameRunTwiceIsTheSame) {
  run("a"), run("b");
  const Finished same = diff({"a", "b/run.h5"});
  EXPECT_EQ(same.exit_code, 0) << same.out << same.err;
  EXPECT_TRUE(same.out.ends_with("the same\n")) << same.out;
}

TEST_F(Diff, TellsWhatDiffersWhereAndByHowMuch) {
  run("a"), run("b", {"--set", "start=30.0001 deg"});
  const Finished bits = diff({"a", "b", "--json", "d.json"});
  EXPECT_EQ(bits.exit_code, 1) << bits.err;
  EXPECT_TRUE(has(bits.out, "FAIL  hinges/rod/angle angle")) << bits.out;
  const json all = json::parse(file_text(dir_ / "d.json"));
  const auto angle =
      std::find_if(all["components"].begin(), all["components"].end(), [](const json& c) { return c["channel"] == "hinges/rod/angle"; });
  EXPECT_GT((*angle)["difference"], 1.7e-6);  // 1e-4 deg at the start
  EXPECT_EQ((*angle)["verdict"], "fail");
  const Finished report = run_program({"report", "a", "b"}, dir_.path());
  EXPECT_EQ(report.exit_code, 1) << report.err;
  EXPECT_TRUE(has(file_text(dir_ / "a/differences.html"), "hinges/rod/angle angle"));
  EXPECT_EQ(diff({"a", "b", "--relative", "0.1"}).exit_code, 1) << "moments of the pin are round-off, which another run has otherwise";
  const Finished but_for_rounding = diff({"a", "b", "--relative", "0.1", "--absolute", "1e-12"});
  EXPECT_EQ(but_for_rounding.exit_code, 0) << but_for_rounding.out;
  EXPECT_EQ(diff({"a", "b", "--relative", "1e-9", "--absolute", "1e-12"}).exit_code, 1);
  for (const char* wrong : {"-1", "inf", "nan"}) EXPECT_EQ(diff({"a", "b", "--absolute", wrong}).exit_code, 2) << wrong;
}

TEST_F(Diff, WhatIsNotANumberInBothIsNoDifferenceAndToldAllTheSame) {
  const std::string mission = file_text(CARDAN_SOURCE_DIR "/tests/scripts/missions/pendulum/scenario.lua");
  for (const std::string name : {"a", "b", "c"}) {
    fs::copy(CARDAN_SOURCE_DIR "/tests/scripts/missions/pendulum", dir_ / name, fs::copy_options::recursive);
    write(dir_ / (name + "/scenario.lua"),
          "local log = signals { odd = { unit = '1' } }\n" +
              replaced(mission, "  ticks = ticks + 1\n",
                       "  ticks = ticks + 1 log.odd(t > " + std::string(name == "c" ? "3" : "2") + " and 0 / 0 or 1)\n"));
    run_program({"run", name, "--out", "out_" + name, "--quiet"}, dir_.path());
  }
  for (const std::string relative : {"0", "1e-9"}) {
    const Finished same = diff({"out_a", "out_b", "--relative", relative});
    EXPECT_EQ(same.exit_code, 0) << same.out;
    EXPECT_TRUE(has(same.out, "odd: not finite, and the same in both, at ")) << same.out;
  }
  const Finished other = diff({"out_a", "out_c", "--relative", "0.5"});
  EXPECT_EQ(other.exit_code, 1) << other.out;
  EXPECT_TRUE(has(other.out, "FAIL  odd odd")) << other.out;
}

TEST_F(Diff, OfOtherTimesIsToldClearly) {
  run("a"), run("b", {"--until", "2"});
  const Finished d = diff({"a", "b"});
  EXPECT_EQ(d.exit_code, 1);
  EXPECT_TRUE(has(d.out, "the times differ: 81 rows of a/run.h5, 41 rows of b/run.h5; compared at the 41 that both have")) << d.out;
  EXPECT_EQ(diff({"a", "b", "--common-times"}).exit_code, 0) << "until then they are the same";
}

TEST_F(Diff, RefusesWhatIsNoResults) {
  run("a");
  EXPECT_EQ(diff({"a", "nothing"}).exit_code, 2);
  fs::create_directory(dir_ / "b");
  fs::copy(dir_ / "a/run.h5", dir_ / "b/run.h5");
  fs::resize_file(dir_ / "b/run.h5", 20000);
  const Finished cut = diff({"a", "b"});
  EXPECT_EQ(cut.exit_code, 2) << cut.out;
  EXPECT_TRUE(has(cut.err, "b/run.h5")) << cut.err;
}

TEST_F(Diff, AndReportNeverWriteOverWhatTheyRead) {
  run("a"), run("b");
  for (const char* option : {"--page", "--json"})
    for (const char* results : {"a/run.h5", "./a/../b/run.h5"})
      EXPECT_EQ(diff({"a", "b", option, results}).exit_code, 2) << option << results;
  EXPECT_EQ(run_program({"report", "a", "b", "--out", "a/run.h5"}, dir_.path()).exit_code, 2);
  EXPECT_EQ(run_program({"report", "a", "--out", "a/run.h5"}, dir_.path()).exit_code, 2);
  EXPECT_EQ(diff({"a", "b"}).exit_code, 0) << "both are there still";
}

}  // namespace
}  // namespace cardan
