// What `check`, `describe` and the end of a run say about physics that is legal and yet wrong, or that cannot start.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "core/io/hdf5_file.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

using nlohmann::json;

const std::string kSource = CARDAN_SOURCE_DIR;
const std::string kBoomMission =
    "vehicle \"v.yaml\"\nmission { duration = 1, integrator = { method = \"dopri5\" }, output = { rate = 10 } }\n";

/// A boom of 15 m with 5 kg at its tip on a hub that flies freely; numbers of tubes, section 1.5 mm wall, as published by nobody.
std::string boom(const std::string& boundary, int modes, const std::string& hinge, const std::string& material = "{E: 120 GPa, rho: 1600}",
                 const std::string& more = "") {
  return R"(cardan: 1
bodies:
  hub: {mass: 300 kg, inertia: [60, 75, 80], nodes: {mount: {position: [0.5, 0, 0]}}, hinge: {type: free, to: world}}
  boom:
    type: modal_flexible
    modal:
      beam: {length: 15 m, material: )" +
         material + R"(, section: {tube: {radius: 6 cm, wall: 1.5 mm}}}
      boundary: )" +
         boundary + "\n      modes: {count: " + std::to_string(modes) + "}\n" + more +
         "      masses: [{mass: 5 kg, position: [15, 0, 0], inertia: [0.1, 0.2, 0.2]}]\n    hinge: " + hinge + "\n";
}

class Physics : public testing::Test {
 protected:
  void write(const std::string& vehicle, const std::string& mission = kBoomMission) {
    std::ofstream(folder_ / "v.yaml") << vehicle;
    std::ofstream(folder_ / "scenario.lua") << mission;
  }
  Finished run(const std::vector<std::string>& arguments) { return run_program(arguments, folder_.path()); }
  Finished check() { return run({"check", "."}); }
  json describe(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"describe", ".", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished f = run(arguments);
    EXPECT_EQ(f.exit_code, 0) << f.err;
    return json::parse(f.out);
  }
  /// The codes of the warnings that `describe` lists, in order.
  std::string codes() {
    std::string all;
    const json description = describe();
    for (const json& w : description["warnings"]) all += w["code"].get<std::string>() + " ";
    return all;
  }
  TemporaryFolder folder_;
};

// ---- effective masses ----

TEST_F(Physics, EffectiveMassesAreToldOfBodiesOfAnySize) {
  // A cantilever moves by 61.3 % and 18.8 % of its mass in its first two bending modes, of 2200 t as of 2 ng.
  for (const auto& [unit, mass] : {std::pair("m", 1.0), {"um", 1e-18}}) {
    write(fmt::format(R"(cardan: 1
bodies:
  beam:
    type: modal_flexible
    modal:
      beam: {{length: 100 {0}, material: {{E: 160 GPa, rho: 2330}}, section: {{tube: {{radius: 2 {0}, wall: 1 {0}}}}}}}
      modes: {{count: 4}}
    hinge: {{type: locked, to: world}}
)",
                      unit));
    const std::string out = run({"describe", "."}).out;
    const double whole = mass * 2330 * M_PI * (4 - 1) * 100;
    for (const double share : {0.613, 0.188}) {
      const auto close = [&](double x) { return std::abs(x - share * whole) < 0.03 * share * whole; };
      int n = 0;
      std::istringstream words(out.substr(out.find("kept")));
      for (std::string word; words >> word;) n += close(std::strtod(word.c_str(), nullptr));
      EXPECT_EQ(n, 2) << share << " of " << whole << "\n" << out;
    }
  }
}

// ---- places ----

/// Turned by a quarter and by two: 6e-17 m and 1e-33 kg m^2 are no places and no inertias.
TEST_F(Physics, RoundingsAreNoPlaces) {
  write(R"(cardan: 1
bodies:
  base: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}
  a: {mass: 1, com: [1, 0, 0], inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: base, initial: {angle: 90 deg}}}
  b: {mass: 1, com: [1e-9, 0, 0], inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: {body: a, position: [1, 0, 0]}, initial: {angle: 180 deg}}}
)");
  const std::string out = run({"describe", "."}).out,
                    masses = out.substr(out.find("masses at"), out.find("program of sweeps") - out.find("masses at"));
  EXPECT_TRUE(has(masses, "  a                            1           0           1           0\n")) << masses;
  EXPECT_EQ(masses.find("e-1"), std::string::npos) << masses;
  write("cardan: 1\nbodies:\n  b: {mass: 1, com: [1e-9, 0, 0], inertia: [1, 1, 1], hinge: {type: free, to: world}}\n");
  EXPECT_TRUE(has(run({"describe", "."}).out, "  b                            1       1e-09           0           0\n"));
}

// ---- what fields know of time ----

TEST_F(Physics, AFieldThatEndsBeforeTheRunIsToldBeforeIt) {
  const auto told = [&](const std::string& days) {
    write(R"(cardan: 1
fields:
  air: {type: nrlmsise00, epoch: "2003-10-28T00:00:00", weather: ")" +
              kSource + R"(/tests/reference/data/atmosphere/space_weather_2003.csv"}
bodies:
  sat: {mass: 1 kg, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {position: [6800 km, 0, 0]}}}
devices:
  drag: {type: drag, at: sat, air: air, area: 1}
)",
          "vehicle \"v.yaml\"\nmission { duration = \"" + days + " day\", output = { rate = 1 } }\n");
    return check();
  };
  EXPECT_EQ(told("6").err.find("W0501"), std::string::npos);
  const Finished late = told("8");
  EXPECT_EQ(late.exit_code, 0);
  for (const char* part : {"W0501", "v.yaml:3", "fields.air",
                           "at the end of the run, at 691200 s, air is asked beyond its limit after: after the last day of `weather`: the "
                           "run ends before, where something asks it there"})
    EXPECT_NE(late.err.find(part), std::string::npos) << part << "\n" << late.err;
}

// ---- attachment of free-free modes ----

TEST_F(Physics, BoomOnAHubHasTheFrequencyOfEulerAndBernoulli) {
  const double exact = 2.218579;  // Euler-Bernoulli with rotary inertia and a rigid hub, solved apart from this project
  write(boom("cantilever", 16, "{type: locked, to: hub.mount}"));
  EXPECT_NEAR(describe()["system_modes"]["modes"][0]["frequency_hz"].get<double>(), exact, 2e-5) << "16 modes: 6e-6 of it with 8 already";
  // Free-free modes held at the root come from above, slowly; the frame instead of the root would give 4.467 with any number.
  double before = 2.6;
  for (const int modes : {8, 16}) {
    write(boom("free", modes, "{type: locked, to: hub.mount, at: root}"));
    const double f = describe()["system_modes"]["modes"][0]["frequency_hz"];
    EXPECT_LT(f, before);
    EXPECT_GT(f, exact);
    EXPECT_NEAR(f, modes == 8 ? 2.3176 : 2.2781, 1e-4);
    before = f;
  }
  write(boom("free", 8, "{type: locked, to: hub.mount}"));
  const Finished refused = check();
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(has(refused.err, "C0324") && has(refused.err, "bodies.boom.hinge.at") && has(refused.err, "a node of boom: root"))
      << refused.err;
}

TEST_F(Physics, ModesThatAreLeftOutAreToldOf) {
  std::string chain = "cardan: 1\nbodies:\n";
  for (int i = 0; i <= 400; ++i)
    chain += fmt::format(
        "  b{}: {{mass: 1, inertia: [1, 1, 1], hinge: {{type: revolute, axis: [0, 0, 1], to: {}, spring: {{stiffness: 1}}}}}}\n", i,
        i > 0 ? fmt::format("b{}", i - 1) : "world");
  write(chain, "vehicle \"v.yaml\"\nmission { duration = 1 }\n");
  const std::string why = describe()["system_modes"].value("why_not", "");
  EXPECT_TRUE(has(why, "401") && has(why, "--modes 10")) << why;
}

TEST_F(Physics, AFreeBodyMayFlyOnItsMeanAxes) {
  write(R"(cardan: 1
bodies:
  beam:
    type: modal_flexible
    modal: {beam: {length: 10 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 5 cm, wall: 2 mm}}}, boundary: free, modes: {count: 6}}
    hinge: {type: free, to: world}
)");
  EXPECT_EQ(check().exit_code, 0);
}

TEST_F(Physics, AHingeBesideTheNodesOfAFlexibleBodyIsToldOf) {
  write(boom("cantilever", 4, "{type: locked, to: hub.mount}") +
        "  tip: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, to: {body: boom, position: [15, 0, 0]}, axis: [0, 1, 0]}}\n");
  EXPECT_EQ(codes(), "W0306 ");
}

// What is the same of several bodies, whose sections differ by less than what is written, is told once and counted for each.
TEST_F(Physics, PiecesThatAreAlikeAreToldOfOnce) {
  std::string pieces =
      "cardan: 1\nbodies:\n  hub: {mass: 1, inertia: [1, 1, 1], nodes: {end: {position: [0, 0, 0]}}, hinge: {type: free, to: world}}\n";
  for (int i = 1; i <= 6; ++i)
    pieces +=
        "  piece_" + std::to_string(i) +
        ": {type: modal_flexible, modal: {beam: {length: 10 cm, material: {E: 70 GPa, rho: 2700}, section: {rectangle: {width: " +
        (i == 6 ? "4" : "3.000000" + std::to_string(i)) +
        " cm, height: 2 cm}}}, boundary: craig_bampton, modes: {count: 0}, nodes: {end: {position: [0.1, 0, 0], interface: true}}}, hinge: "
        "{type: locked, to: " +
        (i == 1 ? "hub" : "piece_" + std::to_string(i - 1)) + ".end, at: root}}\n";
  write(pieces);
  const Finished f = check();
  const auto times = [&](const std::string& what, const std::string& in) {
    int n = 0;
    for (std::size_t at = in.find(what); at != std::string::npos; at = in.find(what, at + 1)) ++n;
    return n;
  };
  EXPECT_EQ(times("warning[W0304]", f.err), 2) << "one piece is wider: " << f.err;
  EXPECT_TRUE(has(f.err, "the same of piece_2, piece_3, piece_4 and 1 more")) << f.err;
  EXPECT_TRUE(has(f.err, "\n6 warnings.\n")) << f.err;
  EXPECT_EQ(times("W0304", codes()), 6);
}

// ---- rates beyond what linear modes tell ----

TEST_F(Physics, ASpunBoomIsToldOfBeforeTheRun) {
  const std::string vehicle = boom("cantilever", 4, "{type: revolute, to: hub.mount, at: root, axis: [0, 0, 1], prescribed: true}");
  // The first frequency with the root held is 0.57 Hz, 3.6 rad/s.
  write(vehicle);
  EXPECT_EQ(codes(), "W0303 ") << "prescribed, without a motion";
  const std::string turn =
      "local v = vehicle \"v.yaml\"\nmission { duration = 1, integrator = { method = \"dopri5\" } }\nv:hinge(\"boom\"):profile{ rate_table "
      "= { {0, 0}, {0.5, ";
  write(vehicle, turn + "20} } }\n");
  const json w = describe()["warnings"];
  ASSERT_EQ(w.size(), 1u) << w;
  EXPECT_EQ(w[0]["code"], "W0301");
  const double omega = 2 * std::numbers::pi * describe()["modes"][0]["audit"][0]["frequency_hz"].get<double>();
  std::ostringstream share;
  share.precision(2);
  share << "(Omega/omega_1)^2 = " << 400.0 / (omega * omega);
  EXPECT_TRUE(has(w[0]["about"], share.str())) << w << share.str();
  write(vehicle, turn + "0.05} } }\n");
  EXPECT_EQ(codes(), "") << "(0.05 / 3.6)^2 is far below one percent";
  const std::string turns = replaced(vehicle, "prescribed: true}", "prescribed: true, initial: {rate: 0.25}}");
  write(turns, "local v = vehicle \"v.yaml\"\nmission { duration = 1 }\nv:hinge(\"boom\"):profile{ hold = 0.25 }\n");
  EXPECT_EQ(codes(), "") << "it has the rate of its profile already, not both: (0.25 / 3.6)^2 is 0.5 percent";
  write(replaced(turns, "0.25", "1"), "local v = vehicle \"v.yaml\"\nmission { duration = 1 }\nv:hinge(\"boom\"):profile{ hold = 1 }\n");
  const Finished f = run({"run", ".", "--out", "o"});
  EXPECT_EQ(f.exit_code, 0) << f.err;
  EXPECT_TRUE(has(f.err, "may turn with up to 1 rad/s")) << f.err;
  EXPECT_FALSE(has(file_text(folder_ / "o/summary.json"), "turns with")) << "after the run it is no news";
}

TEST_F(Physics, ASpunBoomIsToldOfAfterTheRunWhereNobodyKnewBefore) {
  // The drive is told in the first tick: to 3 rad/s, 0.8 times the first frequency with the root held, and back to rest.
  write(replaced(boom("cantilever", 2, "{type: revolute, to: hub.mount, at: root, axis: [0, 0, 1], prescribed: true}",
                      "{E: 120 GPa, rho: 1600}", "      nodes: {tip: {position: [15, 0, 0]}}\n"),
                 "{type: free, to: world}", "{type: locked, to: world}"),
        "local v = vehicle \"v.yaml\"\nmission { duration = 1, integrator = { method = \"dopri5\" } }\n"
        "controller { name = \"spin\", rate = 1, step = function(t)\n"
        "  if t == 0 then v:hinge(\"boom\"):profile{ rate_table = { {0, 0}, {0.6, 3}, {1, 0} } } end\nend }\n");
  EXPECT_EQ(codes(), "");
  const Finished f = run({"run", ".", "--out", "o"});
  ASSERT_EQ(f.exit_code, 0) << f.err;
  const json warnings = json::parse(file_text(folder_ / "o/summary.json"))["warnings"];
  bool told = false, bent = false;
  for (const json& w : warnings)
    if (w["code"] == "W0301") {
      const bool turns = has(w["about"], "turns with 3 rad/s");
      (turns ? told : bent) = true;
      if (turns) {
        EXPECT_NEAR(w["t"].get<double>(), 0.6, 1e-9) << "when it was largest";
      }
    }
  EXPECT_TRUE(told) << warnings;
  EXPECT_TRUE(bent) << "the boom bends by metres: " << warnings;
}

TEST_F(Physics, WhatABeamCarriesAlongItselfIsToldOfAfterTheRun) {
  // A rod of 2 m that stands under its weight, of 10 kg at its end too, four times what it buckles under, or lies.
  const std::string fixed = "{type: locked, to: world}";
  const auto told = [&](const std::string& gravity, const std::string& more, const std::string& hinge,
                        const std::string& mission = kBoomMission) {
    write("cardan: 1\ngravity: {uniform: " + gravity + "}\nbodies:\n  rod:\n    type: modal_flexible\n    modal:\n" +
              "      beam: {length: 2 m, material: {E: 70 GPa, rho: 2700}, section: {rectangle: {width: 3 cm, height: 6 mm}}}\n" +
              "      modes: {count: 2}\n      nodes: {tip: {position: [2, 0, 0]}}\n" + "    hinge: " + hinge + "\n" + more,
          mission);
    const Finished f = run({"run", ".", "--out", "o"});
    EXPECT_EQ(f.exit_code, 0) << f.err;
    std::string all;
    const json warnings = json::parse(file_text(folder_ / "o/summary.json"))["warnings"];
    for (const json& w : warnings)
      if (w["code"] == "W0301" && has(w["about"], "along itself"))
        all += fmt::format("{} at {:.3f} s", w["about"].get<std::string>(), w["t"].get<double>());
    return all;
  };
  // Of own weight 1.57 g / L is added to omega_1^2 or taken off: 0.128 of (1.23 Hz * 2 pi)^2.
  EXPECT_TRUE(has(told("[-9.81, 0, 0]", "", fixed), "a compression") && has(told("[-9.81, 0, 0]", "", fixed), "order of 0.12"))
      << told("[-9.81, 0, 0]", "", fixed);
  EXPECT_TRUE(has(told("[9.81, 0, 0]", "", fixed), "a tension"));
  const std::string load = told("[-9.81, 0, 0]", "  load: {type: particle, mass: 10 kg, hinge: {type: locked, to: rod.tip}}\n", fixed);
  EXPECT_TRUE(has(load, "a compression") && !has(load, "order of 0.")) << load;
  // At its other end it hangs, with 20 kg and what counts of its own below: 9.81 (20 + 0.315 * 0.972) N.
  std::string hangs = file_text(folder_ / "v.yaml");
  for (const auto& [what, by] : {std::pair("modes: {count: 2}", "boundary: free\n      modes: {count: 2}"),
                                 {"{tip: {position: [2, 0, 0]}", "{tip: {position: [2, 0, 0]}, foot: {position: [0, 0, 0]}"},
                                 {"to: world", "to: world, at: tip"},
                                 {"10 kg, hinge: {type: locked, to: rod.tip}", "20 kg, hinge: {type: locked, to: rod.foot}"}})
    hangs = replaced(hangs, what, by);
  write(hangs);
  EXPECT_TRUE(has(run({"run", ".", "--out", "o"}).err, "rod carries 199 N along itself, a tension")) << hangs;
  EXPECT_EQ(told("[0, 0, -9.81]", "", fixed), "");
  // On a sled that takes it along with 25 m/s^2, as much as its stiffness for 1 kg at its end, or shakes it ten times as fast as it bends.
  const auto on_sled = [&](const std::string& rates) {
    return told(
        "[0, 0, 0]",
        "  load: {type: particle, mass: 1 kg, hinge: {type: locked, to: rod.tip}}\n  sled: {type: particle, mass: 1, hinge: {type: "
        "prismatic, to: world, axis: [1, 0, 0], prescribed: true}}\n",
        "{type: locked, to: sled}",
        "local v = vehicle \"v.yaml\"\nmission { duration = 1, integrator = { method = \"dopri5\" }, output = { rate = \"200 Hz\" } }\n"
        "local t = { {0, 0} }\n" +
            rates + "v:hinge(\"sled\"):profile{ rate_table = t }\n");
  };
  const std::string sled = on_sled("t[2] = {0.1, 0}\nt[3] = {0.3, 5}\nt[4] = {1, 5}\n");
  EXPECT_TRUE(has(sled, "a compression") && has(sled, "at 0.295 s")) << sled;
  EXPECT_EQ(on_sled("for k = 1, 25 do t[k + 1] = {0.04 * k, k == 1 and 0 or 0.5 * (-1)^k} end\n"), "") << "of no mean";
  // It spins at 0.3 times its first frequency: of its own mass the rate tells, of what it carries this.
  const std::string spins = "{type: revolute, to: world, at: root, axis: [0, 0, 1], initial: {rate: 2.3}}";
  EXPECT_EQ(told("[0, 0, 0]", "", spins), "");
  EXPECT_TRUE(has(told("[0, 0, 0]", "  load: {type: particle, mass: 1 kg, hinge: {type: locked, to: rod.tip}}\n", spins), "a tension"));
}

TEST_F(Physics, WhatIsLookedAtBeforeTheRunLeavesTheBalancesOfPrescribedMotion) {
  write(boom("cantilever", 2, "{type: revolute, to: hub.mount, at: root, axis: [0, 0, 1], prescribed: true}"),
        "local v = vehicle \"v.yaml\"\nmission { duration = 1, integrator = { method = \"dopri5\" } }\n"
        "v:hinge(\"boom\"):profile{ rate_table = { {0, 0.3}, {1, 0.3} } }\n");
  const Finished f = run({"run", ".", "--out", "o"});
  ASSERT_EQ(f.exit_code, 0) << f.err;
  const json ledger = json::parse(file_text(folder_ / "o/summary.json"))["ledger"];
  for (const char* name : {"linear_momentum", "angular_momentum", "energy"})  // at rest at the start it would be of order one
    EXPECT_LT(ledger[name].get<double>(), 1e-6) << name << ledger;
}

// ---- values ----

TEST_F(Physics, UnusualValuesAreToldWithTheirConsequence) {
  write(boom("cantilever", 4, "{type: locked, to: hub.mount}", "{E: 70, rho: 1600}"));
  const Finished f = check();
  EXPECT_EQ(f.exit_code, 0);
  EXPECT_TRUE(has(f.out, "1 warning")) << f.out;
  EXPECT_TRUE(has(f.err, "warning[W0302]") && has(f.err, "bodies.boom.modal.beam.material.E") && has(f.err, "E = 70 Pa")) << f.err;
  EXPECT_TRUE(has(f.err, "Hz")) << "the first frequency that comes of it: " << f.err;
  write(boom("cantilever", 4, "{type: locked, to: hub.mount}", "{E: 120 GPa, rho: 1600}", "      damping: 500 %\n"));
  EXPECT_EQ(codes(), "W0302 ");
  write(boom("cantilever", 1, "{type: locked, to: hub.mount}"));
  EXPECT_EQ(codes(), "W0305 ") << "one plane of bending without the other";
  write(
      boom("cantilever", 4, "{type: revolute, to: hub.mount, axis: [0, 0, 1], locked: true, spring: {stiffness: 5}, initial: {rate: 1}}"));
  EXPECT_EQ(codes(), "W0303 W0303 ") << "the spring, and the rate";
  write(boom("cantilever", 4, "{type: revolute, to: hub.mount, at: root, axis: [0, 0, 1]}") + "loop_form: embedding\n");
  EXPECT_EQ(codes(), "W0303 ") << "no loops";
  write(boom("cantilever", 4, "{type: revolute, to: hub.mount, at: root, axis: [0, 0, 1], spring: {stiffness: -5}}"));
  EXPECT_EQ(codes(), "W0302 ");
}

TEST_F(Physics, AnglesWithoutAUnitThatAreManyTurnsAreDoubted) {
  const auto initial = [&](const std::string& angle, const std::string& script) {
    write(boom("cantilever", 4, "{type: revolute, to: hub.mount, at: root, axis: [0, 0, 1], initial: {angle: " + angle + "}}"),
          "local v = vehicle \"v.yaml\"\nmission { duration = 1 }\n" + script);
    return codes();
  };
  EXPECT_EQ(initial("90", ""), "W0302 ");
  const std::string told = check().err;
  EXPECT_TRUE(has(told, "v.yaml:") && has(told, "at: bodies.boom.hinge.initial.angle") &&
              has(told, "90 without a unit is 90 rad, 14.3 turns") && has(told, R"("90 deg", or "90 rad" where that is meant)"))
      << told;
  for (const char* meant : {"90 deg", "90 rad", "6.2832", "-1.5707963", "-6.925"}) EXPECT_EQ(initial(meant, ""), "") << meant;
  EXPECT_EQ(initial("0", "initial { boom = { angle = -45 } }\n"), "W0302 ");
  EXPECT_TRUE(has(check().err, "scenario.lua:3") && has(check().err, "at: initial.boom.angle")) << check().err;
  EXPECT_EQ(initial("0", "initial { boom = { angle = \"-45 deg\" } }\n"), "");
}

TEST_F(Physics, KilometresWithoutAUnitAreDoubted) {
  const auto orbit = [&](const std::string& mu, const std::string& x) {
    write("cardan: 1\ngravity: {central: {mu: " + mu +
              "}}\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: "
              "{position: [" +
              x + ", 0, 0], velocity: [0, 7.6 km/s, 0]}}}\n",
          "vehicle \"v.yaml\"\nmission { duration = 1 }\n");
    return codes();
  };
  for (const char* mu : {"3.986004418e14", "398600.4418 km^3/s^2"}) EXPECT_EQ(orbit(mu, "6878.137 km"), "") << mu;
  EXPECT_EQ(orbit("446300", "20 km"), "") << "an asteroid";
  EXPECT_EQ(orbit("398600.4418", "6878.137 km"), "W0302 ");
  EXPECT_TRUE(has(check().err, "at: gravity.central.mu") && has(check().err, "that of the Earth is so much in km^3/s^2")) << check().err;
  EXPECT_EQ(orbit("3.986004418e14", "6878.137"), "W0302 ");
  EXPECT_TRUE(has(check().err, "at: bodies.a.hinge") && has(check().err, "where gravity is 8.43e+06 m/s^2")) << check().err;
}

TEST_F(Physics, FieldsThatBeginOnDifferentDatesAreToldSo) {
  const auto dated = [&](const std::string& moon, const std::string& light) {
    write(
        "cardan: 1\ngravity: {field: [earth, moon]}\nbodies: {a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: "
        "{position: [7000 km, 0 m, 0 m]}}}}\n"
        "fields:\n  earth: {type: point_mass, mu: 398600 km^3/s^2}\n  moon: {type: third_body, body: moon, epoch: " +
        moon + "}\n  light: {type: sunlight, epoch: " + light + "}\n");
  };
  dated("2026-11-26T12:00:00 UTC", "2026-11-26T12:00:00 UTC");
  EXPECT_EQ(codes(), "");
  dated("2026-11-26T12:00:00 UTC", "2026-11-27T12:00:00 UTC");
  EXPECT_EQ(codes(), "W0302 ");
  EXPECT_TRUE(has(check().err, "at: fields.light.epoch") &&
              has(check().err, "t = 0 is 2026-11-27T12:00:00 UTC here and 2026-11-26T12:00:00 UTC for moon"));
}

TEST_F(Physics, AllOfTheEffectiveMassIsMoreThanSixtyModesHave) {
  write(replaced(boom("cantilever", 4, "{type: locked, to: hub.mount}"), "count: 4", "effective_mass: 100 %"));
  const json w = describe()["warnings"];
  ASSERT_EQ(w.size(), 1u) << w;
  EXPECT_EQ(w[0]["code"], "W0305");
  EXPECT_TRUE(has(w[0]["about"], "60 modes computed")) << w;
}

TEST_F(Physics, DefaultsOfKeysThatAShapeDoesNotHaveAreNotListedAsUsed) {
  write(R"(cardan: 1
bodies:
  ball: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {position: [0, 0, 2]}}}
fields:
  sun: {type: sunlight, direction: [1, 0, 0]}
devices:
  soft: {type: contact, from: ball, from_shape: sphere, from_radius: 10 cm, to: world, to_shape: plane, stiffness: 2 kN/m, exponent: 1}
  rough: {type: contact, from: ball, from_shape: ring, from_radius: 10 cm, to: world, to_shape: plane, stiffness: 2 kN/m, friction: 0.3}
  tank: {type: tank, at: ball, radius: 10 cm}
  gas: {type: tank, at: ball, radius: 10 cm, shape: cylinder, length: 1, pressure: 1 MPa, density: 1000, loaded: 1}
  round: {type: radiation_pressure, at: ball, area: 1, light: sun}
  flat: {type: radiation_pressure, at: ball, area: 1, light: sun, shape: plate}
)");
  std::vector<std::string> listed;
  const json all = describe()["defaults"];
  for (const auto& [key, value] : all.items())
    if (key.starts_with("devices.")) listed.push_back(key.substr(8));
  const std::vector<std::string> used = {
      "flat.both_sides", "flat.diffuse",      "flat.specular",      "gas.exponent",    "gas.fill",        "gas.residual",
      "rough.at_depth",  "rough.exponent",    "rough.from_samples", "rough.from_tube", "rough.max_depth", "rough.restitution",
      "rough.width",     "round.coefficient", "round.shape",        "soft.friction",   "soft.max_depth",  "soft.restitution",
      "tank.density",    "tank.fill",         "tank.pressure",      "tank.residual",   "tank.shape"};
  EXPECT_EQ(listed, used);
}

TEST_F(Physics, AKeyOfAShapeThatIsNotChosenIsTold) {
  write(R"(cardan: 1
fields:
  wind: {type: co_rotating_wind, east: 5, radius: 6371 km}
  aloft: {type: co_rotating_wind, east_shear: 1e-3, radius: 6371 km}
bodies:
  ball: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {position: [0, 0, 2]}}}
devices:
  paw: {type: contact, from: ball, from_shape: sphere, from_radius: 10 cm, from_length: 2, to: world, to_shape: plane, stiffness: 2 kN/m}
)");
  const std::string told = check().err;
  EXPECT_TRUE(has(told, "warning[W0303]") && has(told, "`from_length` does not apply to paw as its other keys choose it")) << told;
  EXPECT_TRUE(has(told, "at: fields.wind.radius") && has(told, "`radius` does not apply to wind")) << told;
  EXPECT_FALSE(has(told, "aloft")) << told;
}

// ---- what cannot go on ----

/// A slender beam that flies by itself bends by more than the thickness of its section while it turns about its axis: at level 1 that
/// inertia goes to zero, its rate has no bounds and steps vanish. The answer says so; without modes that large it does not.
TEST_F(Physics, StepsThatVanishAsABeamLosesItsInertiaAreAnsweredByItsLevel) {
  const auto beam = [](const std::string& level) {
    return "cardan: 1\nbodies:\n  beam:\n    type: modal_flexible\n    level: " + level +
           "\n    modal:\n      beam: {length: 10 m, material: {E: 70 GPa, rho: 2700}, section: {rectangle: {width: 5 cm, height: 1 cm}}, "
           "rotary_inertia: false}\n      boundary: free\n      modes: {count: 6}\n    hinge: {type: free, to: "
           "world}\n";
  };
  const std::string mission =
      "vehicle \"v.yaml\"\nmission { duration = 2, integrator = { method = \"dopri5\" }, output = { rate = 10 } }\n"
      "initial { beam = { angular_velocity = { 0.02, 0, 0.05 }, etadot = { 5, 5, 0, 0, 0, 0 } } }\n";
  write(beam("1"), mission);
  const Finished lost = run({"run", ".", "--out", "o"});
  EXPECT_EQ(lost.exit_code, 3) << lost.err;
  EXPECT_TRUE(has(lost.err, "N0201") && has(lost.err, "direction: wx (N0107) with modes a tenth larger: modes of beam have deformed it"))
      << lost.err;
  write(beam("2"), mission);  // what it asks for there is enough
  const std::string asked = check().err, key = "`rotary_inertia: ";
  ASSERT_TRUE(has(asked, "C0321") && has(asked, key)) << asked;
  const std::size_t at = asked.find(key) + key.size();
  write(beam("2\n    rotary_inertia: " + asked.substr(at, asked.find('`', at) - at)), mission);
  EXPECT_EQ(run({"run", ".", "--out", "o"}).exit_code, 0);
}

// ---- what cannot start ----

TEST_F(Physics, ShapesThatOverlapAreFoundBeforeResultsOfAnEarlierRunAreTouched) {
  const auto ball = [](const std::string& height) {
    return "cardan: 1\nbodies:\n  ball: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {position: [0, 0, " + height +
           "]}}}\n  box: {mass: 10, inertia: [2, 2, 2], hinge: {type: free, to: world}}\ndevices:\n  tip: {type: contact, from: ball, "
           "from_shape: sphere, from_radius: 10 cm, to: box, to_shape: box, to_size: [1, 1, 1], stiffness: 2 kN/m, at_depth: 1 mm}\n";
  };
  write(ball("70 cm"));
  const json tip = describe()["devices"][0]["parameters"];
  const json given = {{{"name", "from_shape"}, {"value", "sphere"}},  {{"name", "from_radius"}, {"value", "0.1 m"}},
                      {{"name", "to_shape"}, {"value", "box"}},       {{"name", "to_size"}, {"value", "[1, 1, 1] m"}},
                      {{"name", "stiffness"}, {"value", "2000 N/m"}}, {{"name", "at_depth"}, {"value", "0.001 m"}}};
  EXPECT_EQ(tip, given);
  EXPECT_TRUE(has(run({"describe", "."}).out, "to_shape box, to_size [1, 1, 1] m, stiffness 2000 N/m")) << run({"describe", "."}).out;
  ASSERT_EQ(run({"run", ".", "--out", "o", "--quiet"}).exit_code, 0);
  const auto results = [&] { return file_text(folder_ / "o/run.h5") + file_text(folder_ / "o/summary.json"); };
  const std::string before = results();
  write(ball("45 cm"));
  for (const std::vector<std::string>& command : {std::vector<std::string>{"check", "."}, {"run", ".", "--out", "o"}}) {
    const Finished f = run(command);
    EXPECT_EQ(f.exit_code, 3);
    EXPECT_TRUE(has(f.err, "N0501") && has(f.err, "device tip (contact): evaluate: the shapes are deeper in each other")) << f.err;
  }
  EXPECT_TRUE(results() == before);
}

TEST_F(Physics, SingularStartsAreFoundByCheck) {
  write("cardan: 1\nbodies:\n  p: {type: particle, mass: 1, hinge: {type: revolute, to: world, axis: [0, 0, 1]}}\n");
  const Finished particle = check();
  EXPECT_EQ(particle.exit_code, 3);
  EXPECT_TRUE(has(particle.err, "N0107")) << particle.err;

  const std::string orbit =
      "cardan: 1\ngravity: {central: {mu: 398600.4418 km^3/s^2}}\nbodies:\n  bus: {mass: 60 kg, inertia: [9, 9, 9], com: [0, 0, 0.1], "
      "hinge: {type: free, to: world";
  write(orbit + "}}\n");
  const Finished centre = check();
  EXPECT_EQ(centre.exit_code, 2);
  EXPECT_TRUE(has(centre.err, "C0402") && has(centre.err, "body bus is at the centre of gravity.central")) << centre.err;
  EXPECT_EQ(run({"run", ".", "--out", "o"}).exit_code, 2) << "before anything is written";
  write(orbit + ", initial: {position: [7000 km, 0, 0], velocity: [0, 7.5 km/s, 0]}}}\n");
  EXPECT_EQ(check().exit_code, 0);
}

TEST_F(Physics, EventsAreLookedAtByCheck) {
  write("cardan: 1\nbodies:\n  p: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\n",
        "local v = vehicle \"v.yaml\"\nlocal p = v:node \"p\"\nmission { duration = 1 }\n"
        "event { name = \"far\", when = function(t) return p:position()[1] - 1 end, action = function() end }\n");
  const Finished f = check();
  EXPECT_EQ(f.exit_code, 2) << f.out;
  EXPECT_TRUE(has(f.err, "scenario.lua:4")) << f.err;
}

/// A run would end with them after its last step. What the run has yet to set is no error.
TEST_F(Physics, ChecksAndFiguresThatFailAreFoundByCheck) {
  write("cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world}}\n",
        R"(local sat = vehicle "v.yaml"
mission { duration = 1 }
local seen, calls = {}, 0
check { name = "1", below = 2, value = function() return sat:hinge("a"):rate(7) end }
check { name = "2", below = 2, value = function() return sat:body("b"):mass() end }
check { name = "3", below = 2, value = function() return vec.nrom { 1, 2, 3 } end }
check { name = "4", below = 2, value = function() return sat:body("a"):rate() end }
figure { name = "5", value = function() return sat:hinge("a"):rat() end }
check { name = "6", below = 2, value = function() return seen.last - seen.first end }
check { name = "7", below = 2, value = function() return seen.last end }
check { name = "8", below = 2, value = function() return 0 / 0 end }
check { name = "9", below = 2, value = function() return vec.norm(seen.place) end }
figure { name = "10", value = function() calls = calls + 1 return calls end }
controller { name = "once", rate = "1 Hz", step = function() if mission.time() > 0 then seen = { first = 0, last = 1, place = { 1, 0, 0 } } end end }
)");
  const Finished looked = check();
  EXPECT_EQ(looked.exit_code, 0);
  for (const char* part : {"check \"1\" fails at the start: unknown name", "scenario.lua:4", "check \"2\" fails at the start: unknown body",
                           "scenario.lua:5", "attempt to call a nil value (field 'nrom')", "scenario.lua:6", "got 3 values",
                           "scenario.lua:7", "figure \"5\" fails at the start: unknown name", "scenario.lua:8", "5 warnings"})
    EXPECT_TRUE(has(looked.err, part)) << part << "\n" << looked.err;
}

TEST_F(Physics, ControllersThatNeverGetThroughAreRefused) {
  write("cardan: 1\nbodies:\n  p: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\n",
        "vehicle \"v.yaml\"\nmission { duration = 600 }\ncontroller { name = \"fast\", rate = \"1 GHz\", step = function() end }\n");
  const Finished f = check();
  EXPECT_EQ(f.exit_code, 2);
  EXPECT_TRUE(has(f.err, "C0301") && has(f.err, "6e+11") && has(f.err, "scenario.lua:3")) << f.err;
  write(file_text(folder_ / "v.yaml"), replaced(file_text(folder_ / "scenario.lua"), "1 GHz", "100 kHz"));
  EXPECT_EQ(codes(), "W0501 ");
}

TEST_F(Physics, RatesThatClosedLoopsGiveABodyInOrbitAreToldWhereNobodyCanMeanThem) {
  const auto docked = [&](const std::string& of_b, const std::string& mission, int arm = 1) {
    write(
        fmt::format(
            "cardan: 1\ngravity: {{central: {{mu: 398600.4418 km^3/s^2}}}}\nbodies:\n  a: {{mass: 300, inertia: [100, 120, 90], nodes: "
            "{{port: "
            "{{position: [{0}, 0, 0]}}}}, hinge: {{type: free, to: world, initial: {{position: [6878 km, 0, 0], velocity: [0, 7612.6, 0], "
            "angular_velocity: [0.01, 0.02, 0.03]}}}}}}\n  b: {{mass: 200, inertia: [40, 50, 60], nodes: {{port: {{position: [-{0}, 0, "
            "0]}}}}, "
            "hinge: {{type: free, to: world, initial: {{position: [{1}, 0, 0]{2}}}}}}}\nloops: {{dock: {{type: ball, from: a.port, to: "
            "b.port}}}}\n",
            arm, 6878000 + 2 * arm, of_b),
        "vehicle \"v.yaml\"\nmission { duration = 1 }\n" + mission);
  };
  docked("", "");
  const Finished f = check();
  EXPECT_EQ(f.exit_code, 0);
  EXPECT_TRUE(has(f.err, "W0302") && has(f.err, "at: bodies.b.hinge") && has(f.err, "b.wz begins with")) << f.err;
  docked(", velocity: [0, 7612.63, -0.02]", "");
  EXPECT_EQ(codes(), "");
  EXPECT_TRUE(has(check().err, "its ends are counted from the origin of the world")) << "the run alone told it";
  docked(", velocity: [0, 7613.2, -0.4]", "", 20);
  EXPECT_EQ(codes(), "");
  EXPECT_FALSE(has(check().err, "its ends are counted from the origin of the world")) << "1.5e-9 m are less than 1e-10 of 20 m";
  docked("", "initial { b = { velocity = { 0, 7612.63, -0.02 }, angular_velocity = { 0, 0, 0 } } }\n");
  EXPECT_EQ(codes(), "") << "of another start than that of the mission";
}

TEST_F(Physics, APullThatLacksTermsOfALongBodyIsToldOf) {
  const auto told = [&](const std::string& gradient, const std::string& hinge, const std::string& field = "") {
    write(
        "cardan: 1\nfields: {earth: {type: zonal_harmonics, mu: 398600.4418 km^3/s^2, radius: 6378.137 km, J2: 1.08262982e-3}}\ngravity: " +
            (field.empty() ? "{central: {mu: 398600.4418 km^3/s^2, gradient: " + gradient + "}}"
                           : "{field: " + field + ", gradient: " + gradient + "}") +
            R"(
bodies:
  low: {mass: 3000, inertia: [100, 100, 100], hinge: {type: free, to: world, initial: {position: [7000 km, 0, 0]}}}
  high: {mass: 1000, inertia: [10, 10, 10], hinge: )" +
            hinge + "}\n",
        "vehicle \"v.yaml\"\nmission { duration = 1 }\n");
    const Finished f = check();
    EXPECT_EQ(f.exit_code, 0) << f.err;
    return f.err;
  };
  const std::string locked = "{type: locked, to: {body: low, position: [200 km, 0, 0]}}";
  const std::string text = told("true", locked);  // sqrt(3000 * 1000) / 4000 of 200 km, 7050 km from the centre
  const auto is_told = [](const std::string& answer) {
    return has(answer, "W0301") && has(answer, "a radius of gyration of 8.66e+04 m: its pull") && has(answer, "2e-06 of the weight");
  };
  EXPECT_TRUE(is_told(text)) << text;
  EXPECT_TRUE(is_told(told("true", locked, "earth")));  // J2 is 1e-3 of it
  for (const char* field : {"", "earth"})               // 4.3 km: 2e-10
    EXPECT_FALSE(has(told("true", "{type: locked, to: {body: low, position: [10 km, 0, 0]}}", field), "W0301"));
  EXPECT_FALSE(has(told("false", locked), "W0301"));
  EXPECT_FALSE(has(told("true", "{type: free, to: world, initial: {position: [0, 7000 km, 0]}}"), "W0301"));
  EXPECT_FALSE(has(told("true", "{type: prismatic, axis: [1, 0, 0], to: low, initial: {displacement: 200 km}}"), "W0301"));
}

TEST_F(Physics, AMethodThatTakesNoLoopsIsToldOfOneThatTheMissionMayClose) {
  const auto told = [&](const std::string& settings) {
    write(R"(cardan: 1
bodies:
  a: {mass: 1 kg, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world}}
loops:
  catch: {type: locked, from: a, to: world, open: true}
)",
          "vehicle \"v.yaml\"\nmission { duration = 1, " + settings + " }\n");
    const Finished f = check();
    EXPECT_EQ(f.exit_code, 0) << f.err;
    return f.err + f.out;
  };
  const auto by = [](const std::string& method, const char* more = "") {
    return "integrator = { method = \"" + method + "\"" + more + " }";
  };
  for (const char* method : {"exponential", "multirate", "variational"}) {
    const std::string text = told(by(method, method[0] == 'v' ? ", step = 1e-3" : ""));
    EXPECT_TRUE(has(text, "W0501") && has(text, fmt::format("until the mission closes it, and {} takes no closed loops", method))) << text;
  }
  EXPECT_TRUE(has(told("dynamics = \"diagonalised\""), "until the mission closes it, and diagonalised dynamics takes no closed loops"));
  for (const char* method : {"auto", "dopri5"}) EXPECT_FALSE(has(told(by(method)), "W0501")) << method;
}

TEST_F(Physics, APartOfComponentModesIsOfLevelZero) {
  // Held at one node: 10 kg with their centre at x = 1 m, and two modes with the node at rest, of a modal mass of 1 kg, at 3 and 5 rad/s.
  std::ofstream(folder_ / "n.csv") << "name, x, y, z\nadapter, 0, 0, 0\n";
  std::ofstream(folder_ / "M.mtx")
      << "%%MatrixMarket matrix coordinate real symmetric\n8 8 12\n1 1 10\n2 2 10\n3 3 10\n4 4 0.5\n5 5 12\n6 6 12\n"
         "6 2 10\n5 3 -10\n7 7 1\n8 8 1\n7 3 2\n7 5 -2.5\n";
  std::ofstream(folder_ / "K.mtx") << "%%MatrixMarket matrix coordinate real symmetric\n8 8 2\n7 7 9\n8 8 25\n";
  const auto part = [&](int level) {
    write(fmt::format(R"(cardan: 1
bodies:
  part:
    type: modal_flexible
    level: {}
    modal:
      matrices: {{nodes: n.csv, mass: M.mtx, stiffness: K.mtx, component_modes: 2}}
      modes: {{count: 2}}
    hinge: {{type: free, to: world}}
)",
                      level),
          "vehicle \"v.yaml\"\nmission { duration = 1 }\n");
  };
  part(1);
  const Finished refused = check();
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(has(refused.err, "error[C0321]") && has(refused.err, "--> ./v.yaml:5:12") && has(refused.err, "at: bodies.part.level"))
      << refused.err;
  part(0);
  const json description = describe();
  EXPECT_NEAR(description["modes"][0]["audit"][0]["frequency_hz"].get<double>(), 3.0 / (2 * std::numbers::pi), 1e-12);
  // Flying freely the first mode carries some of the part with it: w^2 = 9 / (1 - P* M^-1 P), P = (2 N, -2.5 N m) per m/s^2 of it.
  const double determinant = 10.0 * 12.0 - 10.0 * 10.0, carried = (12.0 * 4.0 + 10.0 * 6.25 - 2.0 * 10.0 * 5.0) / determinant;
  EXPECT_NEAR(description["system_modes"]["modes"][0]["frequency_hz"].get<double>(),
              3.0 / std::sqrt(1.0 - carried) / (2 * std::numbers::pi), 1e-9);
  EXPECT_NEAR(description["system_modes"]["modes"][1]["frequency_hz"].get<double>(), 5.0 / (2 * std::numbers::pi), 1e-9);
  EXPECT_EQ(run({"run", "."}).exit_code, 0);
}

/// By rows alone, and by the end that the command line gives: what is looked at before a run is that run.
TEST_F(Physics, RunsThatNeverGetThroughAreRefused) {
  const std::string vehicle = "cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\n";
  write(vehicle);
  for (const auto& line : {std::vector<std::string>{"run", ".", "--until", "1e99", "--out", "out"},
                           {"campaign", ".", "--runs", "2", "--until", "1e99", "--out", "out"},
                           {"precision", ".", "--until", "1e99", "--out", "out"},
                           {"check", ".", "--set", "mission.duration=1e99 s"}}) {
    const Finished refused = run(line);
    EXPECT_EQ(refused.exit_code, 2) << line[0];
    for (const char* part : {"C0301", "at: mission.output", "at most 1e+10 rows in a run", "1e+100 of them in 1e+99 s"})
      EXPECT_TRUE(has(refused.err, part)) << part << "\n" << refused.err;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  EXPECT_EQ(run({"campaign", ".", "--runs", "2", "--until", "-1", "--out", "out"}).exit_code, 2);
  write(vehicle, kBoomMission + "controller { name = 'fast', rate = '10 kHz', step = function() end }\n");
  EXPECT_EQ(run({"run", ".", "--until", "1e-3", "--out", "out"}).exit_code, 0);
  const Finished ticks = run({"run", ".", "--until", "1e7", "--out", "out"});
  EXPECT_EQ(ticks.exit_code, 2);
  EXPECT_TRUE(has(ticks.err, "at most 1e+10 ticks in a run") && has(ticks.err, "1e+11 of them in 1e+07 s")) << ticks.err;
}

TEST_F(Physics, DevicesThatNeverGetThroughOrNeverBegin) {
  const auto sampled = [&](const std::string& when) {
    write("cardan: 1\nbodies:\n  p: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\ndevices:\n  gyro: {type: imu, at: p, " +
              when + "}\n",
          "vehicle \"v.yaml\"\nmission { duration = 600 }\n");
  };
  sampled("rate: 1 GHz");
  const Finished f = check();
  EXPECT_EQ(f.exit_code, 2);
  EXPECT_TRUE(has(f.err, "C0301") && has(f.err, "devices.gyro.rate") && has(f.err, "6e+11")) << f.err;
  sampled("rate: 100 kHz");
  EXPECT_EQ(codes(), "W0501 ");
  sampled("rate: 100 Hz, offset: 601 s");
  EXPECT_EQ(codes(), "W0303 ");
  sampled("rate: 100 Hz, offset: 600 s");
  EXPECT_EQ(codes(), "");
}

TEST_F(Physics, DevicesThatPushNothing) {
  const auto between = [&](const std::string& type, const std::string& from, const std::string& to) {
    write("cardan: 1\nbodies:\n  p: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\ndevices:\n  d: {type: " + type +
              ", from: " + from + ", to: " + to + "}\n",
          "vehicle \"v.yaml\"\nmission { duration = 1 }\n");
    return has(check().err, "W0303");
  };
  for (const char* type : {"cable, stiffness: 9, length: 1", "bushing, stiffness: [1, 1, 1], turn_stiffness: [1, 1, 1]"}) {
    EXPECT_TRUE(between(type, "world", "world")) << type;
    EXPECT_TRUE(between(type, "p", "p")) << type;
    EXPECT_FALSE(between(type, "p", "world")) << type;
  }
}

// A slide of 1 kg on 1e4 N/m: 100 rad/s, classic Runge-Kutta is stable on the imaginary axis up to 2 sqrt(2).
TEST_F(Physics, AFixedStepThatIsTooLongForASpringIsToldBeforeTheRunWithOneThatWorks) {
  const auto with_step = [&](const char* step, int rate = 1) {
    write(
        "cardan: 1\nbodies:\n  slide:\n    mass: 1\n    inertia: [1, 1, 1]\n    hinge: {type: prismatic, axis: [1, 0, 0], to: world, "
        "initial: "
        "{displacement: 0.01}, spring: {stiffness: 1e4}}\n",
        std::string("vehicle \"v.yaml\"\nmission { duration = 3, integrator = { method = \"rk4\", step = ") + step +
            " }, output = { rate = " + std::to_string(rate) + " } }\n");
  };
  const auto largest = [&] {
    const Finished f = run({"run", ".", "--out", "o", "--quiet"});
    EXPECT_EQ(f.exit_code, 0) << f.err;
    double most = 0.0;
    for (const double x : Hdf5File::open(folder_ / "o/run.h5").read_doubles("/channels/hinges/slide/displacement").values)
      most = std::max(most, std::abs(x));
    return most;
  };
  const std::string told = "the spring of slide.rate swings at 15.9 Hz: rk4 is unstable with steps above 0.0283 s";
  with_step("0.03");
  const Finished checked = check();
  EXPECT_EQ(checked.exit_code, 0);
  EXPECT_TRUE(has(checked.out, "1 warning") && has(checked.err, "W0401") && has(checked.err, told) && has(checked.err, "0.028 s at most"))
      << checked.out << checked.err;
  EXPECT_GT(largest(), 0.1);
  // Of 110 rad/s 0.02571 s: with 0.026 s, as near, it would be unstable still.
  EXPECT_TRUE(has(run({"check", ".", "--set", "bodies.slide.hinge.spring.stiffness=12100"}).err, "a step of 0.025 s at most"));
  with_step("0.5", 100);
  EXPECT_FALSE(has(check().err, "W0401")) << "rows each 0.01 s cut the steps";
  EXPECT_LE(largest(), 0.01 * (1 + 1e-9));
  with_step("0.028");
  EXPECT_FALSE(has(check().err, "W0401"));
  EXPECT_LE(largest(), 0.01);
}

/// Two vehicles in orbit and a stiff spring between them: 1e-12 asks for more digits than their places have; the target on the chaser has
/// them.
TEST_F(Physics, StepsThatRoundingSetsAreTold) {
  const auto told = [&](const std::string& inboard, const std::string& place, const std::string& speed) {
    write(
        "cardan: 1\nbodies:\n  chaser: {mass: 500, inertia: [200, 220, 180], hinge: {type: free, to: world}}\n  target: {mass: 800, "
        "inertia: [400, 420, 380], "
        "hinge: {type: free, to: " +
            inboard + "}}\ndevices:\n  link: {type: spring_damper, from: chaser, to: target, stiffness: 1e7, rest: 0.99}\n",
        "vehicle \"v.yaml\"\nmission { duration = 0.005, integrator = { method = \"dop853\", relative = 1e-12 }, output = { rate = 200 } "
        "}\n"
        "initial { chaser = { position = { 7e6, 0, 0 }, velocity = { 0, 7500, 0 } }, target = { position = { " +
            place + ", 0, 0 }, velocity = { 0, " + speed + ", 0 } } }\n");
    const Finished f = run({"run", ".", "--out", "o"});
    EXPECT_EQ(f.exit_code, 0) << f.err;
    return f.err;
  };
  const std::string far = told("world", "7000001", "7500");
  EXPECT_TRUE(has(far, "warning[W0404]") && has(far, "rounding and not accuracy sets the steps of dop853") &&
              has(far, "hinge: {type: free, to: TARGET}"))
      << far;
  EXPECT_FALSE(has(told("chaser", "1", "0"), "W0404"));
}

/// A contact swings: an implicit method is better where that is damped out, and follows it as well where it is not.
TEST_F(Physics, WhatSwingsIsNotGivenAMethodForWhatDecays) {
  write(R"(cardan: 1
gravity: {uniform: [0, 0, -9.81]}
bodies:
  ball: {mass: 1, inertia: [0.004, 0.004, 0.004], hinge: {type: free, to: world, initial: {position: [0, 0, 0.09999], velocity: [0.1, 0, 0], angular_velocity: [0, 0.2, 0.1]}}}
devices:
  floor: {type: contact, from: ball, from_shape: sphere, from_radius: 0.1, to: world, to_shape: plane, stiffness: 1e9, restitution: 0.5, speed: 0.1}
)",
        "vehicle \"v.yaml\"\nmission { duration = 5, integrator = { relative = 1e-8 }, output = { rate = 10 } }\n");
  const Finished f = run({"run", ".", "--out", "o"});
  EXPECT_EQ(f.exit_code, 0) << f.err;
  EXPECT_TRUE(has(f.err, "warning[W0401]") && has(f.err, "fastest is what devices push with")) << f.err;
  EXPECT_TRUE(has(f.err, "\"cvode_bdf\" where it is damped out; where it swings on that follows it as well: a softer law")) << f.err;
}

/// What acts between vehicles on one tree is counted from the one that carries the other, also where only initial{} says that they are far
/// from the world's origin, and nothing pulls there: same steps as beside the origin.
TEST_F(Physics, WhatInitialPutsFarAwayKeepsItsDigits) {
  const auto steps = [&](const std::string& start) {
    write(
        "cardan: 1\nbodies:\n  chaser: {mass: 500, inertia: [200, 220, 180], nodes: {hook: {position: [0.7, 0.1, -0.2]}}, "
        "hinge: {type: free, to: world}}\n  target: {mass: 800, inertia: [400, 420, 380], nodes: {eye: {position: [-0.3, 0.2, 0.1]}}, "
        "hinge: {type: free, to: chaser, initial: {position: [1.5, 0, 0]}}}\ndevices:\n  link: {type: spring_damper, from: chaser.hook, "
        "to: target.eye, stiffness: 1e7, rest: 0.6}\n",
        "vehicle \"v.yaml\"\nmission { duration = 0.2, integrator = { method = \"dop853\", relative = 1e-12 } }\n"
        "initial { chaser = { rate = { 0.1, -0.2, 0.3 }, " +
            start + " } }\n");
    const Finished f = run({"run", ".", "--out", "o"});
    EXPECT_EQ(f.exit_code, 0) << f.err;
    EXPECT_FALSE(has(f.err, "W0404")) << f.err;
    const std::size_t told = f.out.find(" steps, ");
    EXPECT_NE(told, std::string::npos) << f.out;
    return std::atof(f.out.c_str() + f.out.rfind('\n', told) + 1);
  };
  const double beside = steps("velocity = { 0, 0, 0 }");
  EXPECT_NEAR(steps("position = { 7e6, -2e6, 1e6 }"), beside, 0.05 * beside);
  EXPECT_NEAR(steps("position = { 7e6, -2e6, 1e6 }, velocity = { 1000, 7000, -2000 }"), beside, 0.05 * beside);
}

// The same slide: the iteration of a variational step is given 60 attempts, which suffice up to 1.5 of step times frequency.
TEST_F(Physics, AVariationalStepThatIsTooLongToBeSolvedIsToldBeforeTheRun) {
  const auto told_and_exit = [&](const char* method, const char* step) {
    write(
        "cardan: 1\nbodies:\n  slide:\n    mass: 1\n    inertia: [1, 1, 1]\n    hinge: {type: prismatic, axis: [1, 0, 0], to: world, "
        "initial: {displacement: 0.01}, spring: {stiffness: 1e4}}\n",
        std::string("vehicle \"v.yaml\"\nmission { duration = 3, integrator = { method = \"") + method + "\", step = " + step +
            " }, output = { rate = 1 } }\n");
    return std::pair(has(check().err, "W0401"), run({"run", ".", "--out", "o", "--quiet"}).exit_code);
  };
  for (const auto& [method, good, bad] : {std::tuple{"variational", "0.0149", "0.0155"}, std::tuple{"variational4", "0.0219", "0.0235"}}) {
    EXPECT_EQ(told_and_exit(method, good), std::pair(false, 0)) << method;
    EXPECT_EQ(told_and_exit(method, bad), std::pair(true, 3)) << method;
  }
}

// Ports have a fault from the start on, sensors have ticked, what takes a signal has not.
TEST_F(Physics, TheFirstTickOfAControllerIsThatOfARun) {
  write(
      "cardan: 1\nbodies:\n  p: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {angular_velocity: [0, 0, 0.1]}}}\n"
      "devices:\n  gyro: {type: imu, at: p, rate: 10 Hz}\n  law: {type: lua/law, rate: 10 Hz, inputs: {spin: gyro.rate_z}}\n",
      "device { type = 'lua/law', inputs = { spin = 'rad/s' }, outputs = { torque = 'N m' }, tick = function(a) return { torque = -3 * "
      "a.spin } end }\n"
      "local sat = vehicle 'v.yaml'\nmission { duration = 1 }\nlocal gyro, law = sat:device 'gyro', sat:device 'law'\n"
      "gyro:fault { port = 'rate_z', scale = 2 }\n"
      "controller { name = 'c', rate = '10 Hz', step = function(t)\n"
      "  if t == 0 then assert(gyro:get 'rate_z' == 0.2) assert(law:get 'torque' == 0) end\nend }\n");
  EXPECT_EQ(run({"run", ".", "--out", "o", "--quiet"}).exit_code, 0);
  const Finished f = check();
  EXPECT_EQ(f.exit_code, 0) << f.err;
}

TEST_F(Physics, ResultsThatFillADiskAreToldOf) {
  write("cardan: 1\nbodies:\n  p: {mass: 1, inertia: [1, 1, 1], hinge: {type: free, to: world}}\n",
        "vehicle \"v.yaml\"\nmission { duration = 1e6, output = { rate = 1000 } }\n");
  EXPECT_EQ(codes(), "W0502 ");
}

/// Time, three of the hinge, three ledgers, thirteen of the node, six of the reaction, two of the signal: 28 numbers of 8 bytes a row. It
/// was guessed from the states, 6 numbers.
TEST_F(Physics, NodesReactionsAndSignalsCountInWhatResultsTake) {
  for (const auto& [rate, told] : {std::pair("8928", ""), {"8929", "W0502 "}}) {
    write(
        "cardan: 1\nbodies:\n  p:\n    mass: 1\n    inertia: [1, 1, 1]\n    nodes: {tip: {position: [1, 0, 0]}}\n"
        "    hinge: {type: prismatic, axis: [1, 0, 0], to: world}\n",
        fmt::format("vehicle 'v.yaml'\nsignals {{ law = {{ components = {{ 'a', 'b' }} }} }}\n"
                    "mission {{ duration = 1000, output = {{ rate = {}, nodes = {{ 'p.tip' }}, reactions = {{ 'p' }} }} }}\n",
                    rate));
    EXPECT_EQ(codes(), told) << rate;
  }
}

// ---- documents and settings ----

TEST_F(Physics, TheFirstVehicleOfTheDocumentRunsWithABareMission) {
  const std::string page = file_text(kSource + "/docs/scenario.md");
  const std::size_t from = page.find("```yaml\n") + 8, to = page.find("```", from);
  write(page.substr(from, to - from), "vehicle \"v.yaml\"\nmission { duration = 10 }\n");
  const Finished f = run({"run", ".", "--out", "o"});
  EXPECT_EQ(f.exit_code, 0) << f.err;
  EXPECT_EQ(codes(), "");
}

TEST_F(Physics, AnOverrideTakesThePathOfTheMessages) {
  write(boom("cantilever", 4, "{type: locked, to: hub.mount}"));
  for (const char* key : {"bodies.hub.mass=400 kg", "vehicle.bodies.hub.mass=400 kg"})
    EXPECT_EQ(describe({"--set", key})["masses"]["bodies"][0]["mass"], 400.0) << key;
  const Finished wrong = run({"check", ".", "--set", "bodies.hub.mass=-1"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_TRUE(has(wrong.err, "at: bodies.hub.mass")) << wrong.err;
}

// ---- rates of the modes are recorded ----

TEST_F(Physics, TheEnergyOfAVibrationFollowsFromTheResults) {
  write(replaced(replaced(boom("cantilever", 2, "{type: locked, to: world}", "{E: 120 GPa, rho: 1600}", "      damping: 0\n"),
                          "    modal:\n", "    initial: {eta: [0.01, 0]}\n    modal:\n"),
                 "  hub: {mass: 300 kg, inertia: [60, 75, 80], nodes: {mount: {position: [0.5, 0, 0]}}, hinge: {type: free, to: world}}\n",
                 ""),
        "vehicle \"v.yaml\"\nmission { duration = 2, integrator = { method = \"dopri5\", relative = 1e-10 }, output = { rate = 10 } }\n");
  const Finished f = run({"run", ".", "--out", "o"});
  ASSERT_EQ(f.exit_code, 0) << f.err;
  const Hdf5File file = Hdf5File::open(folder_ / "o/run.h5");
  const auto eta = file.read_doubles("/channels/modes/boom/eta").values, etadot = file.read_doubles("/channels/modes/boom/etadot").values;
  const double w = 2 * std::numbers::pi * describe()["modes"][0]["audit"][0]["frequency_hz"].get<double>();
  ASSERT_EQ(eta.size(), etadot.size());
  ASSERT_GT(eta.size(), 20u);
  for (std::size_t i = 0; i < eta.size(); i += 2)  // a mass-normalised mode by itself: (eta'^2 + w^2 eta^2) / 2; tolerance of the run
    EXPECT_NEAR(etadot[i] * etadot[i] + w * w * eta[i] * eta[i], w * w * 1e-4, 1e-6 * w * w * 1e-4);
}

}  // namespace
}  // namespace cardan
