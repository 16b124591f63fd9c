// `cardan campaign`: parameters that chance sets, many runs of one scenario as a user runs them, and what their numbers tell.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "core/io/result_folder.hpp"
#include "scripts/campaign/statistics.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kTutorial = CARDAN_SOURCE_DIR "/scenarios/tutorials/26_deployment_by_chance";

TEST(Statistics, QuantilesLieBetweenNeighbours) {
  const Distribution d = distribution_of({3.0, 1.0, 2.0, 5.0, 4.0, 5.0});
  EXPECT_EQ(d.n, 6u);
  EXPECT_DOUBLE_EQ(d.mean, 20.0 / 6.0);
  EXPECT_DOUBLE_EQ(d.deviation, std::sqrt(40.0 / 15.0));  // sum of squares 80 - 400 / 6, over 5
  EXPECT_EQ(d.least, 1.0);
  EXPECT_EQ(d.p05, 1.25);  // 5 x 0.05 beyond the first
  EXPECT_EQ(d.median, 3.5);
  EXPECT_EQ(d.p95, 5.0);
  EXPECT_EQ(d.at_least, 1u);
  EXPECT_EQ(d.at_most, 3u);
  const Distribution one = distribution_of({7.0});
  EXPECT_EQ(one.deviation, 0.0);
  EXPECT_EQ(one.p95, 7.0);
}

/// Table values of Clopper and Pearson's bound, one side: of R, binom.test(k, n, alternative = "greater").
TEST(Statistics, BoundsOfSharesAreThoseOfTheBinomialDistribution) {
  EXPECT_NEAR(share_at_least(10, 10, 0.95), std::pow(0.05, 0.1), 1e-12);
  EXPECT_EQ(share_at_least(0, 10, 0.95), 0.0);
  EXPECT_NEAR(share_at_least(1, 10, 0.95), 1.0 - std::pow(0.95, 0.1), 1e-12);  // P(X >= 1) = 1 - (1 - p)^10
  const double p = share_at_least(8, 10, 0.95);                                // P(X >= 8) = 0.05
  EXPECT_NEAR(45 * std::pow(p, 8) * std::pow(1 - p, 2) + 10 * std::pow(p, 9) * (1 - p) + std::pow(p, 10), 0.05, 1e-12);
  EXPECT_NEAR(p, 0.4930987, 5e-8);
  EXPECT_GT(share_at_least(99'990, 100'000, 0.95), 0.9998);  // many terms, none of them overflows
  EXPECT_NEAR(share_below_largest(59, 0.95), 0.95, 1e-3);    // the 59 runs of Wilks
  EXPECT_LT(share_below_largest(58, 0.95), 0.95);
}

TEST(Statistics, RanksGoTogetherHoweverTheyAreBent) {
  const std::vector<double> x{1, 2, 3, 4, 5, 6};
  EXPECT_DOUBLE_EQ(rank_correlation(x, {1, 8, 27, 64, 125, 216}), 1.0);
  EXPECT_DOUBLE_EQ(rank_correlation(x, {6, 5, 4, 3, 2, 1}), -1.0);
  // Ranks of y: 0.5 0.5 2 3 4 5, off their mean by -2 -2 -0.5 0.5 1.5 2.5.
  EXPECT_NEAR(rank_correlation(x, {1, 1, 2, 3, 4, 5}), 17.0 / std::sqrt(17.5 * 17.0), 1e-15);
  EXPECT_TRUE(std::isnan(rank_correlation(x, {2, 2, 2, 2, 2, 2})));
  EXPECT_EQ(histogram({0.0, 0.1, 0.9, 1.0}, 2), (std::vector<std::size_t>{2, 2}));
  EXPECT_EQ(histogram({3.0, 3.0}, 3), (std::vector<std::size_t>{2, 0, 0}));
}

class CampaignOf : public testing::Test {
 protected:
  Finished campaign(std::vector<std::string> more) {
    more.insert(more.begin(), {"campaign", scenario_, "--out", "c"});
    return run_program(more, dir_.path());
  }
  json results() { return json::parse(file_text(dir_ / "c/campaign.json")); }
  /// The columns of the table but for times of the machine.
  std::string table() {
    std::string out;
    std::istringstream lines(file_text(dir_ / "c/campaign.csv"));
    for (std::string line; std::getline(lines, line);) {
      const auto quoted = line.rfind('"');
      std::istringstream cells(quoted == std::string::npos ? line : line.substr(quoted));
      int column = 0;
      for (std::string cell; std::getline(cells, cell, ',');) out += (column == 2 || column == 3) ? "" : cell + ",", ++column;
      out += "\n";
    }
    return out;
  }
  json quantity(const std::string& name) {
    const json all = results();
    for (const json& q : all["quantities"])
      if (q["name"] == name) return q;
    ADD_FAILURE() << "no " << name;
    return {};
  }
  void use(const std::string& script) {
    fs::remove(dir_ / "vehicle.yaml");
    make_scenario(dir_, script);
    scenario_ = dir_ / "scenario.lua";
  }
  TemporaryFolder dir_;
  std::string scenario_ = kTutorial;
};

TEST_F(CampaignOf, ATutorialTellsWhatItsFormulasTell) {
  const Finished run = campaign({"--runs", "40", "--lean"});
  EXPECT_EQ(run.exit_code, 1) << run.out << run.err;  // some are too fast for the latch
  const json all = results();
  EXPECT_EQ(all["runs_done"], 40);
  EXPECT_EQ(all["without_end"], 0);
  EXPECT_EQ(all["passed"].get<int>() + all["failed"].get<int>(), 40);
  EXPECT_GT(all["failed"], 0);
  // t = pi/2 sqrt(I / k) and a_0 sqrt(k / I), run by run.
  const json k = quantity("stiffness"), inertia = quantity("inertia"), angle = quantity("stowed"), t = quantity("out in time"),
             rate = quantity("rate at the latch");
  for (std::size_t i = 0; i < 40; ++i) {
    const double w = std::sqrt(k["values"][i].get<double>() / (12 * 0.9 * 0.9 + inertia["values"][i].get<double>()));
    EXPECT_NEAR(t["values"][i].get<double>(), M_PI / (2 * w), 1e-8);
    EXPECT_NEAR(rate["values"][i].get<double>(), w * angle["values"][i].get<double>(), 1e-10);
    EXPECT_LE(std::abs(k["values"][i].get<double>() - 0.4), 0.05);
    EXPECT_LE(std::abs(angle["values"][i].get<double>() - M_PI / 2), 3 * M_PI / 180);
  }
  EXPECT_EQ(t["drivers"][0]["drawn"], "stiffness");
  EXPECT_LT(t["drivers"][0]["rank_correlation"], -0.9);
  EXPECT_TRUE(file_text(dir_ / "c/campaign.html").starts_with("<!DOCTYPE html>"));
  for (const json& r : all["runs"])  // of those that passed the numbers alone
    EXPECT_EQ(fs::exists(fs::path(dir_.path()) / r["results"].get<std::string>() / "run.h5"), r["verdict"] == "failed");
}

TEST_F(CampaignOf, SharesAndOrderOfWorkChangeNothingAndWhatIsThereIsNotMadeAgain) {
  campaign({"-n", "6", "--jobs", "1"});
  const std::string together = table();
  EXPECT_NE(together.find("stiffness"), std::string::npos);
  const std::string one = file_text(dir_ / "c/seed_3/summary.json");
  fs::remove_all(dir_ / "c/seed_2");
  fs::remove(dir_ / "c/seed_5/ending.json");
  const Finished again = campaign({"-n", "6", "--jobs", "3"});
  EXPECT_TRUE(has(again.out, "4 of 6 runs were there already")) << again.out;
  EXPECT_EQ(file_text(dir_ / "c/seed_3/summary.json"), one);
  EXPECT_EQ(table(), together);
  fs::remove_all(dir_ / "c");
  EXPECT_TRUE(has(campaign({"-n", "6", "--shard", "2/2"}).out, "3 of 6 runs are done"));
  EXPECT_FALSE(fs::exists(dir_ / "c/campaign.csv"));
  EXPECT_FALSE(fs::exists(dir_ / "c/seed_1"));
  campaign({"-n", "6", "--shard", "1/2"});
  EXPECT_EQ(table(), together);
  // Of another input they are made anew; and a run alone is the same.
  EXPECT_FALSE(has(campaign({"-n", "6", "--set", "stiffness=0.4 N m/rad"}).out, "there already"));
  EXPECT_EQ(quantity("stiffness")["deviation"], 0.0);
  run_program({"run", kTutorial, "--seed", "3", "--out", "alone"}, dir_.path());
  EXPECT_EQ(summary_of(dir_ / "alone")["hashes"], json::parse(one)["hashes"]);
}

TEST_F(CampaignOf, WhatDoesNotComeToItsEndIsCountedAndToldAndTheOthersGoOn) {
  use(R"(local p = parameters { push = { 0, uniform = 1 } }
vehicle "vehicle.yaml"
mission { duration = 1 }
controller { name = "c", rate = 10, step = function() if p.push > 0 then error("pushed") end end }
check { name = "push", value = function() return p.push end, below = 0 })");
  const Finished run = campaign({"-n", "12"});
  EXPECT_EQ(run.exit_code, 1) << run.out << run.err;
  const json all = results();
  EXPECT_EQ(all["passed"].get<int>() + all["without_end"].get<int>(), 12);
  EXPECT_GT(all["without_end"], 0);
  for (const json& r : all["runs"]) EXPECT_EQ(has(r["why"], "pushed"), r["verdict"] != "passed") << r;
  // What made the others abort was drawn too, and is told; the shares say of whom they are.
  for (const json& q : all["quantities"]) {
    EXPECT_EQ(q["n"], q["kind"] == "drawn" ? json(12) : all["passed"]) << q;
    EXPECT_EQ(q["most"]["value"] > 0.0, q["kind"] == "drawn") << q;
  }
  EXPECT_TRUE(has(run.out, "% of those that come to their end stay below the largest number")) << run.out;
  EXPECT_TRUE(has(campaign({"-n", "12"}).out, "12 of 12 runs were there already"));
}

/// Results of another input that a run leaves where it is refused are not its own.
TEST_F(CampaignOf, ARunThatIsRefusedHasNoResultsOfBefore) {
  use("local p = parameters { mass = { 2, uniform = 1 }, less = 0 }\n"
      "vehicle(\"vehicle.yaml\", { [\"bodies.rod.mass\"] = p.mass - p.less })\nmission { duration = 0.1 }");
  EXPECT_EQ(campaign({"-n", "6"}).exit_code, 0);
  double first = 0.0, least = 4.0;
  const json drawn = quantity("mass")["values"];
  for (const double x : drawn) least = std::min(least, x);
  first = drawn[0];
  ASSERT_GT(first, least);  // which is opened before the runs
  const Finished run = campaign({"-n", "6", "--set", "less=" + std::to_string(0.5 * (first + least))});
  EXPECT_EQ(run.exit_code, 1) << run.out << run.err;
  const json all = results();
  EXPECT_GT(all["without_end"], 0);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(all["runs"][i]["verdict"] == "passed", drawn[i].get<double>() > 0.5 * (first + least)) << i;
}

/// Nor are they where the start of a run cannot be evaluated, which touches no results.
TEST_F(CampaignOf, ARunThatCannotBeginHasNoEndOfBefore) {
  use(R"(local p = parameters { push = { 0, uniform = 1 }, early = 0 }
local rate = p.push < 0 and p.early > 0 and 1e200 or 0.1
vehicle("vehicle.yaml", { ["bodies.rod.hinge.initial.rate"] = rate })
mission { duration = 1 }
controller { name = "c", rate = 10, step = function(t) if p.push < 0 and t > 0.45 then error("pushed") end end })");
  const auto aborted = [&](const char* why, double until) {
    int n = 0;
    const json all = results();
    for (const json& r : all["runs"]) {
      if (r["verdict"] != "aborted" && r["verdict"] != "no result") continue;
      EXPECT_TRUE(has(r["why"], why)) << r;
      EXPECT_FALSE(why[0] == 'N' && has(r["ended_by"], "pushed")) << r;
      EXPECT_DOUBLE_EQ(r["simulated_s"], until);
      ++n;
    }
    return n;
  };
  campaign({"-n", "6"});
  const int n = aborted("pushed", 0.5);
  EXPECT_GT(n, 0);
  campaign({"-n", "6", "--set", "early=1"});
  EXPECT_EQ(aborted("N0108", 0.0), n);
}

/// What is ended from outside is told in the tables, which come all the same, and made again.
TEST_F(CampaignOf, WhatAnotherKeepsFromRunningIsMadeAgain) {
  fs::create_directories(dir_ / "c/seed_2");
  {
    const ResultFolder held(dir_ / "c/seed_2", {});
    const Finished run = campaign({"-n", "3"});
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_TRUE(has(run.out, "1 of 3 runs were ended from outside")) << run.out;
    EXPECT_EQ(results()["runs"][1]["verdict"], "not done");
    EXPECT_TRUE(has(results()["runs"][1]["why"], "C0701"));
    EXPECT_EQ(results()["without_end"], 1);
  }
  EXPECT_TRUE(has(campaign({"-n", "3"}).out, "2 of 3 runs were there already"));
  EXPECT_EQ(results()["without_end"], 0);
}

/// A full disk, among others: neither do the others end of it, nor is it told that nothing was run.
TEST_F(CampaignOf, WhatCannotBeWrittenIsMadeAgain) {
  use("vehicle \"vehicle.yaml\"\nmission { duration = 0.1 }");
  fs::create_directories(dir_ / "c/seed_2/ending.json/in the way");
  write(dir_ / "c/seed_3", "no folder");
  fs::create_directories(dir_ / "c/seed_4/run.h5");  // refused, and its answer is lost
  fs::create_symlink("/dev/null", dir_ / "c/seed_4/errors.json");
  fs::create_directories(dir_ / "c/.campaign.csv.new/in the way");
  const Finished run = campaign({"-n", "5"});
  EXPECT_EQ(run.exit_code, 1) << run.err;  // worse than that a table is missing
  EXPECT_TRUE(has(run.out, "3 of 5 runs were ended from outside") && has(run.out, "2 of 5 runs passed")) << run.out;
  EXPECT_TRUE(has(run.err, "campaign.csv") && !has(run.err, "Nothing was run")) << run.err;
  const json runs = results()["runs"];
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(runs[i]["verdict"], i == 0 || i == 4 ? "passed" : "not done");
    EXPECT_EQ(has(runs[i]["why"], "C0701"), i == 1 || i == 2) << runs[i];
  }
  for (const char* in_the_way : {"seed_2/ending.json", "seed_3", "seed_4/run.h5", "seed_4/errors.json"})
    fs::remove_all(dir_ / ("c/" + std::string(in_the_way)));
  fs::create_directories(dir_ / "c/campaign.csv");
  const Finished again = campaign({"-n", "5"});
  EXPECT_EQ(again.exit_code, 4) << again.err;
  EXPECT_TRUE(has(again.out, "2 of 5 runs were there already") && has(again.out, "5 of 5 runs passed")) << again.out;
  EXPECT_TRUE(has(again.err, "campaign.csv") && !has(again.err, "Nothing was run")) << again.err;
}

/// a_0 cos(w t) of each run, as long as it goes on: sorted anew here at each time.
TEST_F(CampaignOf, ChannelsSpreadOverTime) {
  ASSERT_LE(campaign({"--runs", "30"}).exit_code, 1);
  const Finished run = campaign({"--runs", "30", "--plot", "hinges/panel/angle,hinges/panel/rate"});  // of what is there
  ASSERT_LE(run.exit_code, 1) << run.err;
  EXPECT_TRUE(has(run.out, "30 of 30 runs were there already") && has(run.out, "hinges/panel/angle [rad]")) << run.out;
  const json k = quantity("stiffness"), inertia = quantity("inertia"), stowed = quantity("stowed"), end = quantity("out in time");
  const json bands = results()["bands"];
  ASSERT_EQ(bands.size(), 2u);
  const json& angle = bands[0];
  EXPECT_EQ(angle["name"], "hinges/panel/angle");
  EXPECT_EQ(angle["unit"], "rad");
  double highest = 0.0, last = 0.0;
  for (std::size_t i = 0; i < angle["t_s"].size(); ++i) {
    const double t = last = angle["t_s"][i];
    EXPECT_EQ(t, 0.5 * static_cast<double>(i));
    std::vector<double> there;
    for (std::size_t r = 0; r < 30; ++r)
      if (t < end["values"][r].get<double>())
        there.push_back(stowed["values"][r].get<double>() *
                        std::cos(std::sqrt(k["values"][r].get<double>() / (12 * 0.9 * 0.9 + inertia["values"][r].get<double>())) * t));
    const Distribution d = distribution_of(there);
    EXPECT_EQ(angle["runs"][i], there.size()) << t;
    for (const auto& [name, value] : {std::pair{"least", d.least}, {"p05", d.p05}, {"median", d.median}, {"p95", d.p95}, {"most", d.most}})
      EXPECT_NEAR(angle[name][i].get<double>(), value, 1e-8) << name << " at " << t;
    highest = std::max(highest, d.most);
  }
  EXPECT_LT(last, end["most"]["value"]);
  EXPECT_GT(last + 0.5, end["most"]["value"]);
  EXPECT_NEAR(angle["highest"]["value"].get<double>(), highest, 1e-8);
  EXPECT_EQ(angle["highest"]["seed"], stowed["most"]["seed"]);  // at t = 0
  EXPECT_EQ(angle["highest"]["t_s"], 0.0);
  const Finished wrong = campaign({"--runs", "31", "--plot", "hinges/panel/angel"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_TRUE(has(wrong.err, "did you mean \"hinges/panel/angle\"?")) << wrong.err;
  EXPECT_FALSE(fs::exists(dir_ / "c/seed_31")) << "before any run";
  EXPECT_EQ(campaign({"--runs", "31", "--plot", ""}).exit_code, 2);
  EXPECT_EQ(campaign({"--runs", "31", "--plot", "hinges/panel/angle", "--lean"}).exit_code, 2);
}

/// Bands are of all runs or none: those whose run.h5 is gone are made again, and one that cannot be read keeps no other number back.
TEST_F(CampaignOf, BandsLeaveNoRunOutInSilence) {
  ASSERT_LE(campaign({"-n", "5", "--lean"}).exit_code, 1);
  EXPECT_FALSE(fs::exists(dir_ / "c/seed_2/run.h5"));
  const std::vector<std::string> plotted = {"-n", "5", "--plot", "hinges/panel/angle"};
  ASSERT_LE(campaign(plotted).exit_code, 1);
  EXPECT_EQ(results()["bands"][0]["runs"][0], 5);
  write(dir_ / "c/seed_2/run.h5", "no longer");
  const Finished damaged = campaign(plotted);
  EXPECT_EQ(damaged.exit_code, 4);
  EXPECT_TRUE(has(damaged.err, "C0702") && has(damaged.err, "seed_2/run.h5")) << damaged.err;
  EXPECT_EQ(results()["bands"].size(), 0u);
  EXPECT_EQ(results()["runs_done"], 5);
  EXPECT_EQ(quantity("stiffness")["values"].size(), 5u);
  fs::remove(dir_ / "c/seed_2/run.h5");
  ASSERT_LE(campaign(plotted).exit_code, 1);
  EXPECT_EQ(results()["bands"][0]["runs"][0], 5);
}

TEST_F(CampaignOf, AnInterruptedOneGoesOn) {
  use(R"(parameters { a = { 0, normal = 1 } }
vehicle "vehicle.yaml"
mission { duration = 2000 })");
  Started run({"campaign", scenario_, "-n", "400", "--out", "c", "-j", "2"}, dir_.path());
  ASSERT_TRUE(wait_until([&] { return fs::exists(dir_ / "c/seed_3/ending.json"); }));
  run.send(SIGINT);
  const Finished stopped = run.wait();
  EXPECT_EQ(stopped.exit_code, 130);
  EXPECT_TRUE(has(stopped.out, "goes on from there")) << stopped.out;
  EXPECT_FALSE(fs::exists(dir_ / "c/campaign.csv"));
  const Finished rest = campaign({"-n", "4"});
  EXPECT_EQ(rest.exit_code, 0) << rest.out << rest.err;
  EXPECT_TRUE(has(rest.out, "runs were there already"));
}

TEST_F(CampaignOf, OfAScenarioWithoutChanceItIsSaidSo) {
  use("vehicle \"vehicle.yaml\"\nmission { duration = 0.1 }\nfigure { name = \"one\", value = function() return 1 end }");
  EXPECT_TRUE(has(campaign({"-n", "2"}).out, "All runs have the same numbers"));
  const Finished nowhere = run_program({"campaign", scenario_, "-n", "2", "--out", dir_ / "scenario.lua/c"}, dir_.path());
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_TRUE(has(nowhere.err, "C0701")) << nowhere.err;
}

TEST_F(CampaignOf, WhatIsWrongIsToldBeforeAnyRun) {
  use("vehicle \"vehicle.yaml\"\nmission { duration = 1, title = 3 }");
  const Finished wrong = campaign({"-n", "3"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_TRUE(has(wrong.err, "scenario.lua:2")) << wrong.err;
  EXPECT_FALSE(fs::exists(dir_ / "c"));
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {}, {"-n", "0"}, {"-n", "two"}, {"-n", "3", "--shard", "4/3"}, {"-n", "3", "--seed", "18446744073709551614"}})
    EXPECT_EQ(campaign(words).exit_code, 2) << testing::PrintToString(words);
}

/// A parameter with a spread is drawn by its name and the seed: not by its place among others, and not at all with seed 0.
TEST_F(CampaignOf, ParametersAreDrawnByTheirNamesAndTheSeed) {
  const auto drawn = [&](const std::string& parameters, const std::string& seed, std::vector<std::string> more = {}) {
    use("parameters { " + parameters + " }\nvehicle \"vehicle.yaml\"\nmission { duration = 0.1 }");
    more.insert(more.begin(), {"run", scenario_, "--seed", seed, "--out", "r", "--quiet"});
    const Finished run = run_program(more, dir_.path());
    EXPECT_EQ(run.exit_code, 0) << run.err;
    std::map<std::string, double> out;
    const json summary = summary_of(dir_ / "r");
    for (const json& d : summary["drawn"]) out[d["name"]] = d["value"];
    return out;
  };
  const std::string m = "m = { \"500 kg\", normal = \"10 kg\" }", v = "v = { \"1 deg\", 0.1, 0, uniform = { \"1 deg\", 0.2, 0 } }";
  EXPECT_EQ(drawn(m, "0").at("m"), 500.0);
  const auto a = drawn(m, "7"), b = drawn("z = { 1, normal = 1 }, a = { 1, normal = 1 }, " + m + ", " + v, "7");
  EXPECT_NE(a.at("m"), 500.0);
  EXPECT_EQ(b.at("m"), a.at("m"));
  EXPECT_NE(drawn(m, "8").at("m"), a.at("m"));
  EXPECT_NE(b.at("z"), b.at("a"));
  EXPECT_NE(b.at("v[1]"), M_PI / 180);
  EXPECT_NE((b.at("v[1]") / (M_PI / 180) - 1), (b.at("v[2]") - 0.1) / 0.2);
  EXPECT_EQ(b.at("v[3]"), 0.0);
  EXPECT_EQ(drawn(m, "7", {"--set", "m=0.51 t"}).at("m"), 510.0);
  // Ten thousand of them: mean and deviation of a normal, a normal cut at one deviation, and a uniform distribution.
  std::string many;
  for (int i = 0; i < 3; ++i) {
    many += i > 0 ? ", " : "";
    many += std::string(1, static_cast<char>('a' + i)) + " = { ";
    for (int k = 0; k < 10000; ++k) many += "0, ";
    many += i == 0 ? "normal = 1 }" : i == 1 ? "normal = 1, within = 1 }" : "uniform = 1 }";
  }
  const auto all = drawn(many, "12");
  const double expected[] = {1.0, std::sqrt(1.0 - 2.0 * std::exp(-0.5) / std::sqrt(2.0 * M_PI) / std::erf(std::sqrt(0.5))),
                             1.0 / std::sqrt(3.0)};
  for (int i = 0; i < 3; ++i) {
    double sum = 0.0, squares = 0.0, most = 0.0;
    for (int k = 1; k <= 10000; ++k) {
      const double x = all.at(std::string(1, static_cast<char>('a' + i)) + "[" + std::to_string(k) + "]");
      sum += x, squares += x * x, most = std::max(most, std::abs(x));
    }
    EXPECT_LT(std::abs(sum / 1e4), 5 * expected[i] / 100) << i;  // five deviations of a mean of 10,000
    EXPECT_NEAR(std::sqrt(squares / 1e4), expected[i], 5 * expected[i] / 141) << i;
    EXPECT_EQ(most <= 1.0, i > 0) << i;
  }
}

TEST_F(CampaignOf, WhatChanceSetsIsDescribed) {
  const std::string nominal = run_program({"describe", kTutorial}, dir_.path()).out;
  EXPECT_TRUE(has(nominal, "stiffness         0.4 N m/rad, normal 0.02 N m/rad, within 0.05 N m/rad")) << nominal;
  EXPECT_TRUE(has(run_program({"run", kTutorial, "--out", "r"}, dir_.path()).out, "as they are given (seed 0)"));
}

TEST_F(CampaignOf, ASpreadThatIsWrongIsToldByItsPath) {
  const std::vector<std::pair<std::string, std::string>> wrong = {{"{ \"5 kg\", normal = \"1 m\" }", "parameters.x.normal"},
                                                                  {"{ \"5 kg\", normal = \"-1 kg\" }", "parameters.x.normal"},
                                                                  {"{ 5, normal = 1, uniform = 1 }", "parameters.x"},
                                                                  {"{ 5, within = 1 }", "parameters.x"},
                                                                  {"{ 5, normal = 1, within = 0.01 }", "parameters.x.within"},
                                                                  {"{ 5, uniform = 1, within = 1 }", "parameters.x.within"},
                                                                  {"{ 5, norml = 1 }", "parameters.x.norml"},
                                                                  {"{ 5, 6, normal = { 1, 2, 3 } }", "parameters.x.normal"},
                                                                  {"{ 5, 6, normal = { 1, \"2 kg\" } }", "parameters.x.normal"},
                                                                  {"{ \"5 kg\", 6, normal = 1 }", "parameters.x.normal"},
                                                                  {"{ normal = 1 }", "parameters.x"}};
  for (const auto& [value, at] : wrong) {
    use("parameters { x = " + value + " }\nvehicle \"vehicle.yaml\"\nmission { duration = 1 }");
    const Finished run = run_program({"check", scenario_, "--json-errors"}, dir_.path());
    EXPECT_EQ(run.exit_code, 2) << value;
    const json all = json::parse(run.err, nullptr, false);
    ASSERT_TRUE(all.is_object()) << run.err;
    EXPECT_TRUE(all["errors"][0]["at"].get<std::string>().starts_with(at)) << value << all;
    EXPECT_EQ(all["errors"][0]["line"], 1) << all;
  }
}

/// Values of a vehicle by the script: all bits of a number, arrays, and what is wrong at the line of the script.
TEST_F(CampaignOf, AVehicleTakesValuesOfTheScript) {
  use("local sat = vehicle(\"vehicle.yaml\", { [\"bodies.rod.mass\"] = 1 / 3 })\n"
      "mission { duration = 0.1 }\nfigure { name = \"mass\", unit = \"kg\", value = function() return sat:mass() end }");
  ASSERT_EQ(run_program({"run", scenario_, "--out", "r", "--quiet"}, dir_.path()).exit_code, 0);
  EXPECT_EQ(summary_of(dir_ / "r")["figures"][0]["value"], 1.0 / 3.0);
  ASSERT_EQ(run_program({"run", scenario_, "--out", "r", "--quiet", "--set", "bodies.rod.mass=2"}, dir_.path()).exit_code, 0);
  EXPECT_EQ(summary_of(dir_ / "r")["figures"][0]["value"], 2.0);  // the command line comes after the script
  use("vehicle(\"vehicle.yaml\", { [\"bodies.rod.hinge.locked\"] = true })\nmission { duration = 0.1 }");
  EXPECT_TRUE(has(run_program({"describe", scenario_}, dir_.path()).out, "0 coordinates"));
  for (const char* values : {"{ [\"bodies.rod.mass\"] = -1 }", "{ [\"bodies.rood.mass\"] = 1 }", "{ [\"mass\"] = 1 }", "3",
                             "{ [\"bodies.rod.mass\"] = true }"}) {
    use("\n\nvehicle(\"vehicle.yaml\", " + std::string(values) + ")\nmission { duration = 0.1 }");
    const Finished run = run_program({"check", scenario_}, dir_.path());
    EXPECT_EQ(run.exit_code, 2) << values;
    EXPECT_TRUE(has(run.err, "scenario.lua:3")) << values << run.err;
  }
}

}  // namespace
}  // namespace cardan
