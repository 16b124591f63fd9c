// `cardan precision` as a user runs it, on small scenes of which the truth is known.
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <filesystem>

#include "core/io/hdf5_file.hpp"
#include "core/io/run_columns.hpp"
#include "scripts/precision/choose.hpp"
#include "tests/scripts/run_program.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kTop = R"(cardan: 1
bodies:
  top:
    mass: 2 kg
    inertia: [3, 3, 5]
    hinge: {type: free, to: world, initial: {angular_velocity: [0.8, 0, 1.1]}}
)";
constexpr const char* kMission = R"(local sat = vehicle "vehicle.yaml"
mission { duration = "8 s", integrator = { method = "dopri5", relative = 1e-7 }, output = { rate = "1 Hz" }, checkpoint = { never = true } }
)";

/// A symmetric top that nothing acts on: it turns about its momentum h by |h| / A, and about its axis z by -(C - A) / A w_z.
Column exact_attitude(const std::vector<double>& times) {
  const double A = 3, C = 5, wx = 0.8, wz = 1.1, nu = (C - A) / A * wz;
  const double h[2] = {A * wx, C * wz}, size = std::hypot(h[0], h[1]);
  Column out{"bodies/top/attitude", {"w", "x", "y", "z"}, {"1", "1", "1", "1"}, {}};
  for (const double t : times) {
    const double a = 0.5 * size / A * t, b = -0.5 * nu * t;
    const double p[4] = {std::cos(a), std::sin(a) * h[0] / size, 0, std::sin(a) * h[1] / size};  // then one about z by 2 b
    for (const double x : {p[0] * std::cos(b) - p[3] * std::sin(b), p[1] * std::cos(b) + p[2] * std::sin(b),
                           p[2] * std::cos(b) - p[1] * std::sin(b), p[3] * std::cos(b) + p[0] * std::sin(b)})
      out.values.push_back(x);
  }
  return out;
}

class Precision : public testing::Test {
 protected:
  void scene(const std::string& mission = kMission, const std::string& vehicle = kTop) {
    write(dir_ / "vehicle.yaml", vehicle);
    write(dir_ / "scenario.lua", mission);
  }
  Finished precision(std::vector<std::string> more) {
    more.insert(more.begin(), {"precision", "scenario.lua", "--out", "out"});
    return run_program(more, dir_.path());
  }
  json data() { return json::parse(file_text(dir_ / "out/precision.json")); }
  json row(const std::string& name, const std::string& rung) {
    const json all = data();
    for (const json& r : all["rows"])
      if (r["name"] == name && r["rung"] == rung) return r;
    ADD_FAILURE() << "no row " << name << " " << rung;
    return {};
  }
  /// Of the channels that a row recorded.
  double exact_error(const json& r) {
    const RunColumns run = read_run_columns(dir_ / ("out/" + r["folder"].get<std::string>() + "/run.h5"));
    RunColumns truth;
    truth.times = run.times;
    truth.columns = {exact_attitude(run.times)};
    return errors_of_run(run, truth)[index_of_kind("attitude")]->largest;
  }
  /// The first error of a command line that is wrong, as text.
  std::string refusal(std::vector<std::string> more, int exit_code = 2) {
    const Finished run = precision(std::move(more));
    EXPECT_EQ(run.exit_code, exit_code) << run.out;
    return run.err;
  }

  TemporaryFolder dir_;
};

TEST_F(Precision, ErrorsHaveTheOrderOfTheMethodAndAreThoseOfTheTruth) {
  scene();
  const Finished run = precision(
      {"--methods", "rk4,dopri5", "--steps", "0.1:0.025", "--tolerances", "1e-6:1e-9", "--reference", "dop853,cvode_adams", "--keep-runs"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const auto error = [&](const json& r) { return r["errors"]["attitude"]["largest"].get<double>(); };
  const json all = data();
  const double a = error(row("rk4", "0.1 s")), b = error(row("rk4", "0.05 s")), c = error(row("rk4", "0.025 s"));
  EXPECT_LT(std::abs(a / b - 16), 1.5) << "order 4";
  EXPECT_LT(std::abs(b / c - 16), 0.8);
  EXPECT_GT(error(row("dopri5", "1e-06")) / error(row("dopri5", "1e-09")), 200.0) << "error goes with tolerance";
  for (const json& r : {row("rk4", "0.1 s"), row("rk4", "0.025 s"), row("dopri5", "1e-07")})
    EXPECT_LT(std::abs(error(r) / exact_error(r) - 1), 1e-3) << r["name"] << ": against the reference as against the truth";
  EXPECT_LT(exact_error(all["reference"]["runs"][0]), 1e-11);
  // The reference knows how good it is: |first - second| is no less than a tenth of what the first is off by.
  for (const json& kind : all["kinds"]) {
    if (kind["name"] != "attitude") continue;
    EXPECT_GT(kind["reference_off_by"]["largest"].get<double>(), 0.1 * exact_error(all["reference"]["runs"][0]));
    EXPECT_LT(kind["reference_off_by"]["largest"].get<double>(), 1e-10);
    EXPECT_EQ(kind["converged"], true);
  }
  for (const json& r : all["rows"]) EXPECT_GT(r["cpu_s"].get<double>(), 1e-5) << r["name"] << ": short runs are measured too";
  EXPECT_EQ(row("dopri5", "1e-07")["own"], true) << "the scenario's own setting is told";
  EXPECT_TRUE(has(run.out, "dopri5 (yours)")) << run.out;
  EXPECT_LT(row("rk4", "0.1 s")["errors"]["momentum"]["largest"], 1e-3);
  EXPECT_FALSE(row("rk4", "0.1 s")["errors"].contains("modes"));
  EXPECT_GT(row("rk4", "0.1 s")["rhs_calls"], 80 * 4 - 1) << "four a step";
  EXPECT_TRUE(has(file_text(dir_ / "out/precision.html"), "Work against precision"));
  // precision.h5 has the same numbers, a group for each method.
  const Hdf5File file = Hdf5File::open(dir_ / "out/precision.h5");
  const auto errors = file.read_doubles("/curves/rk4/errors/attitude/largest").values;
  EXPECT_EQ(errors, (std::vector<double>{a, b, c}));
  EXPECT_EQ(file.read_doubles("/curves/rk4/step").values, (std::vector<double>{0.1, 0.05, 0.025}));
  EXPECT_EQ(file.read_doubles("/curves/dopri5/relative").values, (std::vector<double>{1e-6, 1e-7, 1e-8, 1e-9}));
  EXPECT_EQ(file.read_doubles("/curves/rk4/rhs_calls").values[0], row("rk4", "0.1 s")["rhs_calls"].get<double>());
  EXPECT_EQ(file.text_attribute("/curves/rk4/errors/attitude/largest", "unit"), "rad");
  EXPECT_GT(file.read_doubles("/reference/off_by/attitude/largest").values.at(0), 0.0);
}

TEST_F(Precision, WhatWasRunIsNotRunAgain) {
  scene();
  const std::vector<std::string> two = {"--methods", "dop853", "--tolerances", "1e-6,1e-8", "--quiet", "--repeat", "1"};
  const Finished first = precision(two);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_TRUE(has(first.out, "\n8 runs, 0 of before."))
      << "two of the reference, the scenario's own, by the twin and in two kinds of velocities too, two rows: " << first.out;
  EXPECT_EQ(first.err, "");
  const json before = data();
  EXPECT_TRUE(has(precision(two).out, "\n0 runs, 8 of before."));
  EXPECT_EQ(data(), before) << "times too: nothing was run";
  const auto has_channels = [&](const json& r) {
    return std::filesystem::exists(dir_ / ("out/" + r["folder"].get<std::string>() + "/run.h5"));
  };
  EXPECT_TRUE(has_channels(before["reference"]["runs"][0]) && has_channels(before["reference"]["runs"][1]))
      << "others are measured by them";
  for (const json& r : before["rows"]) EXPECT_FALSE(has_channels(r)) << "it was measured";
  EXPECT_TRUE(has(precision({"--methods", "dop853", "--tolerances", "1e-6,1e-8,1e-10", "--repeat", "1"}).out, "\n1 runs, 8 of before."));
  EXPECT_TRUE(has(precision({"--methods", "dop853", "--tolerances", "1e-6", "--set", "mission.ledger=false", "--repeat", "1"}).out,
                  "\n7 runs, 0 of before."))
      << "another setting";
  std::vector<std::string> other = two, whole = two;
  other.insert(other.end(), {"--reference", "cvode_adams,dop853"});
  EXPECT_TRUE(has(precision(other).out, "\n8 runs, 0 of before.")) << "measured by another one, and so run again";
  whole.push_back("--keep-runs");
  EXPECT_TRUE(has(precision(whole).out, "\n6 runs, 2 of before."));
  EXPECT_TRUE(has_channels(row("dop853", "1e-06")));
  scene(replaced(kMission, "8 s", "7 s"));
  EXPECT_TRUE(has(precision(two).out, "\n8 runs, 0 of before.")) << "another scenario";
}

TEST_F(Precision, AFailureIsARowWithItsReason) {
  // A damper of 400 1/s: rk4 with 0.1 s is far beyond what is stable.
  scene(kMission, R"(cardan: 1
bodies:
  top:
    mass: 2 kg
    inertia: [3, 3, 5]
    hinge: {type: revolute, to: world, axis: [0, 0, 1], spring: {stiffness: 0 N m/rad, damping: 2000 N m s/rad}, initial: {rate: 1}}
)");
  const Finished run = precision({"--methods", "rk4,dopri5", "--steps", "0.1,0.001", "--tolerances", "1e-6", "--quiet"});
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_TRUE(has(run.out, "failed: N0")) << run.out;
  const json failed = row("rk4", "0.1 s");
  EXPECT_TRUE(failed["failure"].get<std::string>().starts_with("N0108: a value is not finite")) << failed["failure"];
  EXPECT_FALSE(failed.contains("cpu_s"));
  EXPECT_TRUE(row("rk4", "0.001 s")["failure"].is_null());
  EXPECT_TRUE(has(precision({"--methods", "rk4,dopri5", "--steps", "0.1,0.001", "--tolerances", "1e-6", "--quiet"}).out, "\n0 runs,"))
      << "failures are kept too";
}

TEST_F(Precision, ARunThatTakesTooLongIsARow) {
  scene(std::string(kMission) +
        "controller { name = 'slow', rate = '10 Hz', step = function(t)\n"
        "  if sim:vehicle() and mission.time() > 0.5 then for i = 1, 1e7 do end end end }\n");
  const Finished run =
      precision({"--methods", "dopri5", "--tolerances", "1e-6", "--limit", "1", "--quiet", "--reference", "dop853,dopri5"});
  EXPECT_EQ(run.exit_code, 3) << run.out << run.err;
  EXPECT_TRUE(has(run.err, "more than 1 s of processor time")) << run.err;
}

TEST_F(Precision, TheCheapestSettingWithinABudgetIsWrittenForRun) {
  scene();
  const Finished run =
      precision({"--methods", "dopri5", "--tolerances", "1e-4:1e-10", "--budget", "attitude=1e-3 deg", "--wanted", "1e-6", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_TRUE(has(run.out, "cheapest for an error of 1e-06 (largest, in the unit of each)\n  attitude    dopri5 ")) << run.out;
  EXPECT_TRUE(has(run.out, "cheapest for attitude 1.7e-05 rad\n  dopri5 ")) << run.out;
  const std::string settings = file_text(dir_ / "out/settings.txt");
  EXPECT_TRUE(has(settings, "\nmission.integrator.method=dopri5\nmission.integrator.relative=")) << settings;
  const Finished again = run_program({"run", ".", "--settings", "out/settings.txt", "--out", "run", "--quiet"}, dir_.path());
  EXPECT_EQ(again.exit_code, 0) << again.err;
  RunColumns truth = read_run_columns(dir_ / "run/run.h5");
  const RunColumns is = truth;
  truth.columns = {exact_attitude(is.times)};
  EXPECT_LE(errors_of_run(is, truth)[index_of_kind("attitude")]->largest, 1.01e-3 * 3.14159265358979 / 180);

  const Finished none = precision({"--methods", "dopri5", "--tolerances", "1e-4:1e-6", "--budget", "attitude=1e-18 rad", "--quiet"});
  EXPECT_EQ(none.exit_code, 1) << none.err;
  EXPECT_TRUE(has(none.out, "none of the settings; nearest dopri5 ")) << none.out;
  EXPECT_TRUE(has(none.out, "; the reference itself may be off by ")) << none.out;
  EXPECT_TRUE(has(file_text(dir_ / "out/settings.txt"), "# none of the settings; nearest"));
}

TEST_F(Precision, AReferenceThatDidNotConvergeIsTold) {
  scene();
  const Finished run = precision({"--methods", "dopri5", "--tolerances", "1e-3,1e-4", "--reference", "dop853,cvode_adams",
                                  "--reference-tolerance", "1e-6", "--quiet"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(
      run.err.starts_with("warning[W0403]: the reference did not converge\n  at: reference\n"
                          "  expected: two runs that agree to 1e-06 of what they measure\n"
                          "  got:      dop853 1e-06 and cvode_adams 1e-06 differ: attitude "))
      << run.err;
  EXPECT_TRUE(
      has(run.err, "  hint:     the table tells nothing below these errors; --until a shorter time, or --reference two other methods\n"))
      << run.err;
  bool marked = false;
  const json all = data();
  for (const json& kind : all["kinds"]) marked = marked || kind.value("converged", true) == false;
  EXPECT_TRUE(marked);
}

constexpr const char* kFourBar = R"(cardan: 1
gravity: {uniform: [0, -9.81, 0]}
bodies:
  crank: {mass: 1 kg, com: [0.1, 0, 0], inertia: [0.002, 0.01, 0.01], hinge: {type: revolute, to: world, axis: [0, 0, 1], initial: {angle: 60 deg}}}
  rod: {mass: 1 kg, com: [0.25, 0, 0], inertia: [0.002, 0.02, 0.02], hinge: {type: revolute, to: {body: crank, position: [0.2, 0, 0]}, axis: [0, 0, 1], initial: {angle: -60 deg}}}
  rocker: {mass: 1 kg, com: [0.1, 0, 0], inertia: [0.002, 0.01, 0.01], hinge: {type: revolute, to: {body: world, position: [0.5, 0, 0]}, axis: [0, 0, 1], initial: {angle: 60 deg}}}
loops:
  pin: {type: line, from: {body: rod, position: [0.5, 0, 0]}, to: {body: rocker, position: [0.2, 0, 0]}}
)";

TEST_F(Precision, HingesThatHaveASquareRootFormAreTriedInIt) {
  constexpr const char* kGimballed = R"(cardan: 1
bodies:
  frame: {mass: 5 kg, inertia: [1, 2, 1.5], hinge: {type: gimbal, sequence: zyx, to: world, initial: {rate_1: 0.3, rate_2: 0.1, rate_3: -0.2}}}
  wheel: {mass: 1 kg, inertia: [0.1, 0.1, 0.2], hinge: {type: revolute, to: frame, axis: [0, 0, 1], initial: {rate: 10}}}
)";
  scene(replaced(replaced(kMission, "8 s", "0.5 s"), "1 Hz", "10 Hz"), kGimballed);
  const Finished run =
      precision({"--methods", "dop853", "--tolerances", "1e-6,1e-11", "--formulations", "standard,square_root", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(row("dop853+square_root", "1e-06")["settings"].back(), "bodies.frame.hinge.factor=square_root");
  EXPECT_LT(row("dop853+square_root", "1e-11")["errors"]["angle"]["largest"].get<double>(), 1e-9);
}

TEST_F(Precision, EachFormulationIsACurve) {
  scene(replaced(replaced(kMission, "8 s", "0.2 s"), "1 Hz", "10 Hz"), kFourBar);
  const std::vector<std::string> some = {"--methods", "dop853", "--tolerances", "1e-6,1e-11", "--repeat", "1", "--quiet"};
  const auto asked = [&](const std::string& forms) {
    std::vector<std::string> more = some;
    more.insert(more.end(), {"--formulations", forms});
    return more;
  };
  const Finished run = precision(asked("all"));
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_TRUE(has(run.out, "formulation  tolerance")) << run.out;
  for (const char* curve : {"dop853", "dop853+dense", "dop853+multipliers", "dop853+dae"}) {
    EXPECT_LT(row(curve, "1e-11")["errors"]["angle"]["largest"].get<double>(), 1e-8) << curve << ": the same motion";
    EXPECT_GT(row(curve, "1e-06")["errors"]["angle"]["largest"].get<double>(), row(curve, "1e-11")["errors"]["angle"]["largest"]) << curve;
  }
  EXPECT_EQ(row("dop853+multipliers", "1e-06")["formulation"], "multipliers");
  EXPECT_EQ(row("dop853+dense", "1e-06")["settings"].back(), "mission.dynamics=dense");
  const Hdf5File file = Hdf5File::open(dir_ / "out/precision.h5");
  EXPECT_EQ(file.read_doubles("/curves/dop853+dense/relative").values, (std::vector<double>{1e-6, 1e-11}));
  EXPECT_EQ(file.text_attribute("/curves/dop853+dense", "formulation"), "dense");
  EXPECT_EQ(file.text_attribute("/curves/dop853+dense", "method"), "dop853");
  EXPECT_TRUE(has(precision(some).out, "\n3 runs, 5 of before.")) << "by default the others once each, as the scenario is: dopri5 1e-07";
  EXPECT_TRUE(row("dopri5+multipliers", "1e-07")["failure"].is_null());
  EXPECT_EQ(
      refusal(asked("embeding")),
      "error[C0801]: wrong command line\n  at: --formulations\n  expected: all, or a formulation that the scene has: standard, dense, "
      "multipliers, dae\n  got:      \"embeding\"\n\n1 error. Nothing was run.\n")
      << "embedding is its own";
  EXPECT_EQ(refusal(asked("dense,dense")),
            "error[C0801]: wrong command line\n  at: --formulations\n  expected: each formulation once\n"
            "  got:      \"dense\"\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(refusal(asked("dense,all")),
            "error[C0801]: wrong command line\n  at: --formulations\n  expected: each formulation once\n"
            "  got:      \"all\" beside others\n\n1 error. Nothing was run.\n");
}

TEST_F(Precision, WhatFailsAlikeAtEachToleranceHasOneLine) {
  scene(replaced(replaced(kMission, "8 s", "0.1 s"), "1 Hz", "10 Hz"), kFourBar);
  const Finished run =
      precision({"--methods", "exponential,dop853", "--tolerances", "1e-6,1e-8,1e-11", "--formulations", "standard", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const std::size_t first = run.out.find("failed: C0401");
  ASSERT_NE(first, std::string::npos) << run.out;
  EXPECT_EQ(run.out.find("failed: C0401", first + 1), std::string::npos) << run.out;
  EXPECT_TRUE(row("exponential", "1e-11")["failure"].get<std::string>().starts_with("C0401")) << "the file has all";
}

TEST_F(Precision, TheReferenceIsIn113BitsWhereTheSceneHasThem) {
  scene();
  const std::vector<std::string> one = {"--methods", "dop853", "--tolerances", "1e-12", "--repeat", "1", "--quiet"};
  const Finished run = precision(one);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(
      has(run.out, "reference: extended 1e-21, in 113 bits; its error: what extended 1e-18 differs by, or the last bit of a double\n"))
      << run.out;
  const json reference = data()["reference"], reference_kinds = data()["kinds"];
  EXPECT_EQ(reference["precision"], "113 bits");
  EXPECT_TRUE(reference["why_double"].is_null());
  EXPECT_LT(exact_error(reference["runs"][0]), 3e-15) << "as far as the closed form is known in double";
  for (const json& kind : reference_kinds) {
    if (kind["name"] != "attitude") continue;
    EXPECT_GE(kind["reference_off_by"]["largest"].get<double>(), 2.2e-16);
  }
  const std::string revolute = "hinge: {type: revolute, to: world, axis: [0, 0, 1], ";
  const auto turning = [&](const std::string& more) {
    return replaced(kTop, "hinge: {type: free, to: world, initial: {angular_velocity: [0.8, 0, 1.1]}}", revolute + more);
  };
  scene(std::string(kMission) + "event { name = 'half', when = function(t) return t - 4 end, action = function() end }\n",
        turning("prescribed: true, initial: {rate: 1}}"));
  EXPECT_TRUE(has(precision(one).out, "reference: extended 1e-21, in 113 bits"));
  const std::string rubbing = "device bearing (dry_friction), which computes in double";
  scene(kMission, turning("initial: {rate: 1}}\ndevices:\n  bearing: {type: dry_friction, at: top, coulomb: 0.1}"));
  EXPECT_TRUE(has(precision(one).out, "in double precision (113 bits are not to be had: " + rubbing + "); its error: what cvode_adams"));
  EXPECT_EQ(data()["reference"]["why_double"], rubbing);
  EXPECT_EQ(refusal({"--reference", "extended"}),
            "error[C0401]: not supported by the chosen method\n  at: --reference\n  expected: a scene that has 113 bits throughout\n"
            "  got:      " +
                rubbing +
                "\n  hint:     --reference dop853,cvode_adams\n\n"
                "1 error. Nothing was run.\n");
}

TEST_F(Precision, WhatABudgetHasNoNeedOfIsLeftOut) {
  scene(R"(local sat = vehicle "vehicle.yaml"
mission { duration = "10 s", integrator = { method = "dopri5", relative = 1e-7 }, output = { rate = "1 Hz" }, checkpoint = { never = true } }
)",
        R"(cardan: 1
gravity: {central: {mu: 398600.4418 km^3/s^2}}
bodies:
  bus:
    mass: 200 kg
    inertia: [40, 50, 60]
    hinge: {type: free, to: world, initial: {position: [7000 km, 0, 0], velocity: [0, 7.5 km/s, 0], angular_velocity: [0.02, 0.01, 0.03]}}
  boom:
    type: modal_flexible
    modal:
      beam: {length: 3 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 3 cm, wall: 1 mm}}, elements: 10}
      modes: {count: 6}
    hinge: {type: locked, to: bus}
)");
  const std::vector<std::string> some = {
      "--methods",   "dopri5,exponential", "--tolerances",          "1e-6,1e-9", "--repeat", "1", "--quiet",
      "--reference", "dop853,dopri5",      "--reference-tolerance", "1e-12"};
  const auto within = [&](const std::string& budget) {
    std::vector<std::string> more = some;
    more.insert(more.end(), {"--budget", budget});
    return more;
  };
  const Finished run = precision(within("pointing=1e-3rad"));
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const json model = data()["model"];
  const json chosen = model["runs"][model["chosen"].get<std::size_t>()], whole = model["runs"][0];
  ASSERT_GT(model["chosen"].get<int>(), 0) << run.out;
  EXPECT_LT(chosen["operations"].get<double>(), 0.7 * whole["operations"].get<double>()) << run.out;
  EXPECT_LE(chosen["errors"]["attitude"]["largest"].get<double>(), 1e-3);
  const std::string settings = file_text(dir_ / "out/settings.txt");
  EXPECT_TRUE(has(settings, "\nvehicle.gravity=none\n")) << settings;
  EXPECT_TRUE(has(settings, "\nvehicle.bodies.boom.modal.modes.count=1\n")) << settings;
  EXPECT_TRUE(has(run.out, "\nwithout: ")) << run.out;
  // Every simplification is measured: what it adds is how far its run is from that of the whole model.
  for (const json& r : model["runs"]) {
    if (r["without"].size() != 1 || r["rung"] != whole["rung"] || r["name"] != whole["name"]) continue;
    EXPECT_LE(r["errors"]["attitude"]["largest"].get<double>(),
              r["added"]["attitude"]["largest"].get<double>() + 1.01 * whole["errors"]["attitude"]["largest"].get<double>())
        << r["settings"];
  }
  EXPECT_EQ(run_program({"run", ".", "--settings", "out/settings.txt", "--out", "run", "--quiet"}, dir_.path()).exit_code, 0);
  const RunColumns is = read_run_columns(dir_ / "run/run.h5");
  const RunColumns truth = read_run_columns(dir_ / ("out/" + data()["reference"]["runs"][0]["folder"].get<std::string>() + "/run.h5"));
  EXPECT_EQ(errors_of_run(is, truth)[index_of_kind("attitude")]->largest, chosen["errors"]["attitude"]["largest"].get<double>());

  // Where the orbit counts gravity stays; where the digits count all of it does.
  std::vector<std::string> both = within("pointing=1e-3rad");
  both.insert(both.end(), {"--budget", "position=1 m"});
  ASSERT_EQ(precision(both).exit_code, 0);
  EXPECT_FALSE(has(file_text(dir_ / "out/settings.txt"), "vehicle.gravity=none")) << "it moves 400 m in that time";
  const Finished fine = precision(within("pointing=1e-14 rad"));
  EXPECT_TRUE(has(fine.out, "nothing is left out")) << fine.out;
  std::vector<std::string> methods = within("pointing=1e-3rad");
  methods.push_back("--whole-model");
  EXPECT_EQ(precision(methods).exit_code, 0);
  EXPECT_TRUE(data()["model"].is_null());
}

/// Constraint modes stay: fewer modes are fewer of those with the interface held.
TEST_F(Precision, ABudgetLeavesConstraintModes) {
  scene(R"(local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", integrator = { method = "dopri5", relative = 1e-7 }, output = { rate = "1 Hz" }, checkpoint = { never = true } }
)",
        R"(cardan: 1
bodies:
  bus: {mass: 200 kg, inertia: [40, 50, 60], hinge: {type: free, to: world, initial: {angular_velocity: [0.02, 0.01, 0.03]}}}
  boom:
    type: modal_flexible
    modal:
      beam: {length: 3 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 3 cm, wall: 1 mm}}, elements: 4}
      boundary: craig_bampton
      modes: {count: 2}
      nodes: {tip: {position: [3, 0, 0], interface: true}}
    hinge: {type: locked, to: bus}
)");
  const Finished run = precision({"--methods", "dopri5", "--tolerances", "1e-6", "--repeat", "1", "--quiet", "--reference", "dop853,dopri5",
                                  "--reference-tolerance", "1e-10", "--budget", "attitude=1 deg"});
  ASSERT_EQ(run.exit_code, 0) << run.out << run.err;
  const json model = data()["model"];
  EXPECT_TRUE(has(model.dump(), "boom: 7 of 8 modes") && has(model.dump(), "boom: 6 of 8 modes")) << model;
  EXPECT_FALSE(has(model.dump(), "boom: 5 of 8 modes")) << model;
  EXPECT_LT(model["runs"][model["chosen"].get<std::size_t>()]["operations"].get<double>(), model["runs"][0]["operations"].get<double>());
  EXPECT_TRUE(has(file_text(dir_ / "out/settings.txt"), "\nvehicle.bodies.boom.modal.modes.count=0\n"));
}

TEST_F(Precision, WithoutAReferenceThereIsNoTable) {
  scene(std::string(kMission) + "controller { name = 'broken', rate = '1 Hz', step = function(t) if t > 2 then error('lost') end end }\n");
  const Finished run = precision(
      {"--methods", "dopri5", "--tolerances", "1e-6", "--reference", "dop853,dopri5", "--reference-tolerance", "1e-10", "--quiet"});
  EXPECT_EQ(run.exit_code, 3) << run.out;
  EXPECT_TRUE(run.err.starts_with("failure[N0206]: no method gets to the tolerance of the reference\n  dop853 1e-10: N0303: ")) << run.err;
  EXPECT_TRUE(has(run.err, "\n  dopri5 1e-10: N0303: ")) << run.err;
  EXPECT_TRUE(
      has(run.err, "\n  hint:     a larger --limit, --until a shorter time, or --reference two methods that can do what the scene needs\n"))
      << run.err;
  EXPECT_FALSE(fs::exists(dir_ / "out/precision.json"));
}

TEST_F(Precision, WrongOptionsAreRefusedBeforeAnythingRuns) {
  scene();
  EXPECT_EQ(
      refusal({"--methods", "dopri6"}), "error[C0801]: wrong command line\n  at: --methods\n  expected: a method: " + [] {
        std::string all;
        for (const PrecisionSetting& s : precision_methods({})) all += (all.empty() ? "" : ", ") + s.name();
        return replaced(all, "exponential, ", "exponential, extended, ");  // which is run where it is named
      }() + "\n  got:      \"dopri6\"\n  hint:     did you mean \"dopri5\"?\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--tolerances", "1e-4:1e-16"}),
            "error[C0801]: wrong command line\n  at: --tolerances\n  expected: numbers from 1e-14 to 1\n  got:      1e-16\n"
            "  hint:     docs/precision.md\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(
      refusal({"--kinds", "atitude"}),
      "error[C0801]: wrong command line\n  at: --kinds\n  expected: a kind of error: attitude, position, angle, rate, velocity, modes, "
      "forces, signals, end, momentum, energy, constraint\n  got:      \"atitude\"\n  hint:     did you mean \"attitude\"?\n\n"
      "1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--measure", "mean"}),
            "error[C0801]: wrong command line\n  at: --measure\n  expected: a measure: final, l2, largest\n  got:      \"mean\"\n\n"
            "1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--whole-model"}),
            "error[C0801]: wrong command line\n  at: --whole-model\n  expected: --budget beside it\n  got:      none\n\n"
            "1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--budget", "attitude"}),
            "error[C0801]: wrong command line\n  at: --budget\n  expected: KIND=ERROR: attitude=\"1e-6 rad\"\n  got:      \"attitude\"\n\n"
            "1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--budget", "attitude=1e-6 m"}),
            "error[C0107]: wrong unit\n  at: --budget\n  expected: angle [rad]\n  got:      \"1e-6 m\": length [m]\n\n1 error. Nothing was "
            "run.\n");
  EXPECT_EQ(refusal({"--budget", "modes=-1"}),
            "error[C0801]: wrong command line\n  at: --budget\n  expected: an error > 0\n  got:      \"modes=-1\"\n\n1 error. Nothing was "
            "run.\n");
  EXPECT_EQ(refusal({"--wanted", "0"}),
            "error[C0801]: wrong command line\n  at: --wanted\n  expected: an error > 0\n  got:      0\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--limit", "0"}),
            "error[C0801]: wrong command line\n  at: --limit\n  expected: a time > 0 s\n  got:      0\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(
      refusal({"--until", "-1"}),
      "error[C0801]: wrong command line\n  at: --until\n  expected: a finite time > 0 s\n  got:      -1\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--reference-tolerance", "1e-3"}),
            "error[C0801]: wrong command line\n  at: --reference-tolerance\n  expected: a number from 1e-14 to 1e-6\n  got:      0.001\n\n"
            "1 error. Nothing was run.\n");
  EXPECT_EQ(refusal({"--reference", "dop853"}),
            "error[C0801]: wrong command line\n  at: --reference\n  expected: two methods, dop853,cvode_adams, or extended\n  got:      "
            "dop853\n\n"
            "1 error. Nothing was run.\n");
  EXPECT_TRUE(has(refusal({"--reference", "dop853,rk4"}), "  expected: a method that chooses its steps: "))
      << "equal steps have no tolerance";
  EXPECT_FALSE(fs::exists(dir_ / "out"));
  const Finished none = run_program({"precision", "nowhere"}, dir_.path());
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_TRUE(none.err.starts_with("error[C0102]: file not found\n")) << none.err;
  EXPECT_EQ(run_program({"precision"}, dir_.path()).exit_code, 2);
}

TEST_F(Precision, LinesOfSettingsAreReadOrRefusedWithTheirPlace) {
  scene();
  write(dir_ / "some.txt", "# as wanted\n\n  mission.integrator.relative=1e-5  \nmission.duration=1 s\r\n");
  EXPECT_EQ(run_program({"run", ".", "--settings", "some.txt", "--set", "mission.duration=2 s", "--quiet"}, dir_.path()).exit_code, 0);
  EXPECT_EQ(summary_of(dir_ / ("out/" + fs::path(dir_.path()).filename().string()))["simulated_s"], 2.0) << "--set comes after it";
  write(dir_ / "wrong.txt", "# first\nrelative 1e-5\n");
  EXPECT_EQ(
      run_program({"run", ".", "--settings", "wrong.txt"}, dir_.path()).err,
      "error[C0801]: wrong command line\n  --> wrong.txt:2:1\n  at: --settings\n    2 | relative 1e-5\n      | ^^^^^^^^^^^^^\n  expected: "
      "key=value\n"
      "  got:      \"relative 1e-5\"\n  hint:     mission.integrator.relative=1e-8\n\n1 error. Nothing was run.\n");
  EXPECT_TRUE(run_program({"run", ".", "--settings", "none.txt"}, dir_.path()).err.starts_with("error[C0102]: file not found\n"));
}

/// A row that could not be written says nothing of its method.
TEST_F(Precision, WhatAFullDiskHasEndedIsRunAgain) {
  scene();
  const std::vector<std::string> line = {"precision", "scenario.lua", "--out",     "out",      "--methods",
                                         "dopri5",    "--tolerances", "1e-5,1e-7", "--repeat", "1"};
  const Finished full = run_program(line, dir_.path(), [] {
    const rlimit most{16384, 16384};  // [bytes] of a file: run.h5 has more, the row of a study less
    setrlimit(RLIMIT_FSIZE, &most);
  });
  EXPECT_EQ(full.exit_code, 3) << full.err;
  EXPECT_TRUE(has(full.err, "N0204")) << full.err;
  fs::create_directories(dir_ / "out/.precision.html.new/in the way");
  const Finished again = run_program(line, dir_.path());
  EXPECT_EQ(again.exit_code, 4) << again.err;
  EXPECT_TRUE(has(again.err, "error[C0701]") && has(again.err, "out/precision.html") && !has(again.err, "Nothing was run")) << again.err;
  EXPECT_EQ(data()["reference"]["attempts"], json::array());
  for (const json& r : data()["rows"]) EXPECT_TRUE(r["failure"].is_null()) << r;
}

TEST_F(Precision, ASecondStudyInTheSameFolderIsRefusedAndResultsAreKept) {
  scene(std::string(kMission) + "controller { name = 'slow', rate = '10 Hz', step = function(t) for i = 1, 3e5 do end end }\n");
  const std::vector<std::string> line = {"precision", "scenario.lua", "--out",     "out",    "--methods",
                                         "dopri5",    "--tolerances", "1e-6:1e-9", "--quiet"};
  Started first(line, dir_.path());
  ASSERT_TRUE(wait_until([&] { return fs::exists(dir_ / "out/runs"); }));
  const std::string refused = refusal({"--methods", "dopri5"});
  EXPECT_TRUE(refused.starts_with("error[C0701]: result cannot be written\n")) << refused;
  first.send(SIGINT);
  const Finished stopped = first.wait();
  EXPECT_EQ(stopped.exit_code, 130) << stopped.err;
  EXPECT_TRUE(has(stopped.out, "Interrupted.")) << stopped.out;
  EXPECT_FALSE(fs::exists(dir_ / "out/precision.json")) << "no table of a part";
  const Finished on = run_program(line, dir_.path());
  EXPECT_EQ(on.exit_code, 0) << on.err;
}

}  // namespace
}  // namespace cardan
