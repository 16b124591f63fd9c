// Pareto front and recommendation of rows that are given; by the program, and by the page.
#include "scripts/precision/choose.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/base/diagnostic.hpp"
#include "scripts/precision/settings.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

const std::size_t kAttitude = index_of_kind("attitude"), kModes = index_of_kind("modes");

PrecisionRow row_of(const std::string& method, double relative, double cpu_s, double attitude, double modes = 1e-15) {
  PrecisionRow row;
  row.setting = {.method = method, .linear_solver = "", .adaptive = true, .relative = relative, .absolute = relative};
  row.cpu_s = cpu_s;
  row.rhs_calls = static_cast<long>(1000 / cpu_s);  // the other way round
  row.errors.resize(precision_kinds().size());
  row.errors[kAttitude] = KindError{attitude, attitude, attitude, 1.0, "bodies/bus/attitude"};
  row.errors[kModes] = KindError{modes, modes, modes, 1.0, "modes/wing/eta"};
  return row;
}
PrecisionRow failed_row() {
  PrecisionRow row = row_of("fails", 1e-9, 0.01, 1e-20);
  row.failure = "N0201: the integrator's step became too small";
  return row;
}

const std::vector<PrecisionRow>& rows() {
  static const std::vector<PrecisionRow> all = {row_of("a", 1e-4, 1.0, 1e-3, 0.3),
                                                row_of("a", 1e-6, 2.0, 1e-8),
                                                row_of("a", 1e-8, 4.0, 1e-5, 1e-3),
                                                row_of("a", 1e-10, 8.0, 1e-9),
                                                row_of("b", 1e-6, 3.0, 1e-6),
                                                row_of("b", 1e-8, 5.0, 1e-9),
                                                failed_row()};
  return all;
}
std::vector<double> floors(double of_attitude = 0.0) {
  std::vector<double> out(precision_kinds().size(), 0.0);
  out[kAttitude] = of_attitude;
  return out;
}
using Indices = std::vector<std::size_t>;
PrecisionChoice choose(double most, double floor = 0.0, RunCost cost = RunCost::cpu) {
  return cheapest_within(rows(), {{kAttitude, most}}, floors(floor), ErrorMeasure::largest, cost);
}

TEST(PrecisionAdvice, TheFrontIsWhatNothingBeats) {
  EXPECT_EQ(pareto_front(rows(), kAttitude, ErrorMeasure::largest, RunCost::cpu, 0.0), (Indices{0, 1, 5}));
  EXPECT_EQ(pareto_front(rows(), kAttitude, ErrorMeasure::largest, RunCost::cpu, 1e-7), (Indices{0, 1}))
      << "what cannot be told apart is equal";
  EXPECT_EQ(pareto_front(rows(), kAttitude, ErrorMeasure::largest, RunCost::rhs_calls, 0.0), (Indices{3}))
      << "fewest calls and smallest error";
  EXPECT_TRUE(pareto_front(rows(), index_of_kind("energy"), ErrorMeasure::largest, RunCost::cpu, 0.0).empty())
      << "nothing of it was measured";
}

TEST(PrecisionAdvice, AnErrorThatIsMetByChanceIsNotMet) {
  EXPECT_EQ(choose(1e-2).row, Indices::value_type{0});
  EXPECT_EQ(choose(1e-6).row, Indices::value_type{4}) << "a 1e-6 is cheaper and as good, but its next rung is worse";
  EXPECT_EQ(choose(1e-8).row, Indices::value_type{5});
  EXPECT_EQ(choose(1e-8, 0.0, RunCost::rhs_calls).row, Indices::value_type{3});
}

TEST(PrecisionAdvice, WhereNothingKeepsItTheNearestIsTold) {
  const PrecisionChoice none = choose(5e-10);
  EXPECT_FALSE(none.row.has_value());
  EXPECT_EQ(none.nearest, Indices::value_type{3});
  EXPECT_EQ(none.ratio, 1e-9 / 5e-10);
  EXPECT_FALSE(choose(1e-6, 1e-5).row.has_value()) << "the reference itself is not good enough";
  EXPECT_FALSE(cheapest_within({failed_row()}, {{kAttitude, 1.0}}, floors(), ErrorMeasure::largest, RunCost::cpu).nearest.has_value());
}

TEST(PrecisionAdvice, SeveralBudgetsAreKeptAllAtOnce) {
  const auto both = [](double modes) {
    return cheapest_within(rows(), {{kAttitude, 1e-2}, {kModes, modes}}, floors(), ErrorMeasure::largest, RunCost::cpu).row;
  };
  EXPECT_EQ(both(0.5), Indices::value_type{0});
  EXPECT_EQ(both(1e-4), Indices::value_type{4}) << "the third rung of a has modes of 1e-3";
}

/// What node prints of an expression with the functions of the page and `rows` above.
nlohmann::json in_node(const std::string& expression) {
  nlohmann::json all = nlohmann::json::array();
  for (const PrecisionRow& r : rows()) {
    nlohmann::json one = {{"name", r.setting.name()},
                          {"adaptive", true},
                          {"relative", r.setting.relative},
                          {"cpu_s", r.cpu_s},
                          {"rhs_calls", r.rhs_calls},
                          {"failure", nullptr},
                          {"errors", {{"attitude", {{"largest", r.errors[kAttitude]->largest}}}}}};
    if (!r.failure.empty()) one["failure"] = r.failure;
    all.push_back(one);
  }
  const std::string program = test::scratch("choose.mjs"), out = test::scratch("choose.txt");
  std::ofstream(program) << "import * as page from '" CARDAN_SOURCE_DIR "/scripts/report/choose.mjs';\nconst rows = " << all.dump() << ";\n"
                         << "console.log(JSON.stringify(" << expression << "));\n";
  EXPECT_EQ(std::system(("node " + program + " > " + out).c_str()), 0);
  std::stringstream text;
  text << std::ifstream(out).rdbuf();
  return nlohmann::json::parse(text.str());
}

TEST(PrecisionAdvice, ThePageChoosesAsTheProgramDoes) {
  const std::vector<std::string> floors_told = {"0", "1e-7", "1e-5"}, wanted = {"1e-2", "1e-6", "1e-8", "5e-10"};
  const auto all = in_node(
      "['cpu_s', 'rhs_calls'].map((cost) => [0, 1e-7, 1e-5].map((floor) => ({ front: page.front(rows, 'attitude', "
      "'largest', cost, floor), choices: [1e-2, 1e-6, 1e-8, 5e-10].map((most) => page.cheapest(rows, 'attitude', "
      "'largest', cost, floor, most)) })))");
  for (const std::size_t c : {0u, 1u})
    for (std::size_t f = 0; f < floors_told.size(); ++f) {
      const RunCost cost = c == 0 ? RunCost::cpu : RunCost::rhs_calls;
      const double floor = std::stod(floors_told[f]);
      EXPECT_EQ(all[c][f]["front"].get<Indices>(), pareto_front(rows(), kAttitude, ErrorMeasure::largest, cost, floor));
      for (std::size_t w = 0; w < wanted.size(); ++w) {
        const auto& page = all[c][f]["choices"][w];
        const PrecisionChoice program = choose(std::stod(wanted[w]), floor, cost);
        EXPECT_EQ(page["row"], program.row ? nlohmann::json(*program.row) : nlohmann::json()) << wanted[w] << " " << floor;
        EXPECT_EQ(page["nearest"], *program.nearest) << wanted[w] << " " << floor;
        EXPECT_EQ(page["ratio"].get<double>(), program.ratio) << wanted[w] << " " << floor;
      }
    }
  EXPECT_EQ(in_node("[page.decadeMarks(2e-3, 50, 9).map((m) => m.text), page.decadeMarks(1, 40, 9).map((m) => m.value)]"),
            nlohmann::json::parse("[[\"0.01\", \"0.1\", \"1\", \"10\"], [1, 2, 5, 10, 20]]"));
}

// ---- ladders

std::string refusal(const std::function<void()>& work) {
  try {
    work();
  } catch (const InputError& e) {
    return e.diagnostics().front().expected + " | " + e.diagnostics().front().got;
  }
  return "";
}

TEST(PrecisionSettings, ALadderGoesFromTheLoosestToTheTightest) {
  EXPECT_EQ(tolerance_ladder("1e-4:1e-7"), (std::vector<double>{1e-4, 1e-5, 1e-6, 1e-7})) << "decades, to the last bit";
  EXPECT_EQ(tolerance_ladder("1e-7:2e-5"), (std::vector<double>{2e-5, 2e-6, 2e-7, 1e-7}));
  EXPECT_EQ(tolerance_ladder("1e-7,1e-4,1e-7"), (std::vector<double>{1e-4, 1e-7}));
  const auto five = tolerance_ladder("1e-4:1e-6:5");
  ASSERT_EQ(five.size(), 5u);
  EXPECT_LT(std::abs(five[1] / std::pow(10.0, -4.5) - 1), 1e-14);
  EXPECT_EQ(five.back(), 1e-6);
  EXPECT_EQ(step_ladder("0.8:0.1"), (std::vector<double>{0.8, 0.4, 0.2, 0.1}));
}

TEST(PrecisionSettings, WhatIsNoLadderIsRefused) {
  EXPECT_EQ(refusal([] { tolerance_ladder("1e-4:1e-16"); }), "numbers from 1e-14 to 1 | 1e-16");
  EXPECT_EQ(refusal([] { tolerance_ladder("tight"); }), "tolerances: 1e-4:1e-12, 1e-4:1e-12:17 or 1e-4,1e-7 | \"tight\"");
  EXPECT_EQ(refusal([] { tolerance_ladder("1e-4:1e-8:1"); }), "a number of rungs from 2 to 100 | \"1\"");
  EXPECT_EQ(refusal([] { tolerance_ladder("1e-4:1e-5:1e-6:3"); }),
            "tolerances: 1e-4:1e-12, 1e-4:1e-12:17 or 1e-4,1e-7 | \"1e-4:1e-5:1e-6:3\"");
  EXPECT_EQ(refusal([] { tolerance_ladder("1e-4,"); }), "tolerances: 1e-4:1e-12, 1e-4:1e-12:17 or 1e-4,1e-7 | \"1e-4,\"");
  EXPECT_EQ(refusal([] { tolerance_ladder(""); }), "tolerances: 1e-4:1e-12, 1e-4:1e-12:17 or 1e-4,1e-7 | \"\"");
  EXPECT_EQ(refusal([] { step_ladder("0:1"); }), "times > 0 s, below 1e9 s | 0");
}

TEST(PrecisionSettings, EqualStepsBeginWhereTheyAreStable) {
  EXPECT_EQ(usual_steps(0.0, 0.5, 100.0), (std::vector<double>{0.5, 0.25, 0.125, 0.0625, 0.03125, 0.015625}));
  EXPECT_EQ(usual_steps(100.0, 0.5, 100.0).front(), 0.02);
  EXPECT_EQ(usual_steps(1e6, 0.5, 1000.0), (std::vector<double>{2e-6})) << "too many steps: the first alone";
}

TEST(PrecisionSettings, AbsoluteTolerancesGoAlong) {
  PrecisionSetting own;
  own.method = "dopri5", own.relative = 1e-6, own.absolute = 1e-8, own.by_kind = {{"angle", 1e-5}};
  const auto grid = precision_grid(precision_methods({"dop853", "rk4"}), {1e-4, 1e-10}, {0.1}, own);
  ASSERT_EQ(grid.size(), 3u);
  EXPECT_LT(std::abs(grid[1].absolute / 1e-12 - 1), 1e-14);
  ASSERT_EQ(grid[1].by_kind.size(), 1u);
  EXPECT_LT(std::abs(grid[1].by_kind[0].second / 1e-9 - 1), 1e-14);
  EXPECT_EQ(grid[1].sets(own)[3].first, "mission.integrator.tolerances.angle");
  EXPECT_EQ(grid[2].step, 0.1);
  EXPECT_FALSE(grid[2].adaptive);
}

TEST(PrecisionSettings, MethodsAreThoseOfTheRegistry) {
  std::size_t curves = 0;
  for (const MethodKind& m : integration_methods())
    curves += m.extended ? 0 : m.automatic ? 1 : std::max<std::size_t>(1, m.linear_solvers.size());
  EXPECT_EQ(precision_methods({}).size(), curves);
  EXPECT_EQ(precision_methods({"cvode_bdf"}).size(), 2u) << "with each of its linear solvers";
  EXPECT_EQ(precision_methods({"cvode_bdf/krylov"}).front().linear_solver, "krylov");
  EXPECT_NE(refusal([] { precision_methods({"dopri"}); }).find("cvode_adams, cvode_bdf/dense, cvode_bdf/krylov, "), std::string::npos);
  EXPECT_EQ(refusal([] { precision_methods({"rk4", "rk4"}); }), "each method once | \"rk4\"");
}

}  // namespace
}  // namespace cardan
