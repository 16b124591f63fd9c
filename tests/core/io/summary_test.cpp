#include "core/io/summary.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "core/io/json.hpp"
#include "core/io/sha256.hpp"

namespace cardan {
namespace {

Summary example() {
  Summary s;
  s.scenario = "slew";
  s.checks = {{"pointing", 0.1, 0.2, true, "deg", "after 60 s"}, {"jitter", 1.0 / 3.0, 0.25, false, "arcsec", ""}};
  s.ledger = Ledger{1e-15, 2e-14, 3e-12};
  s.simulated_s = 120.0;
  s.wall_s = 2.5;
  s.cpu_s = 2.25;
  s.rejected = 17;
  s.steps = 1234;
  s.rhs_calls = 5678;
  s.restarts = 9;
  s.jacobian_products = 21, s.preconditioner_setups = 22, s.linear_iterations = 23, s.inner_steps = 24;
  s.integration.by_stop = 31, s.integration.shortest = 1e-3, s.integration.rejected.by_error[1] = 17, s.integration.restarts[1] = 8;
  s.worst = {{"wing.mode 3", 1200}, {"bus.wx", 3}};
  s.figures = {{"final_error_deg", 0.01, "deg"}};
  s.model = {7, 6, 20, 19, 8};
  s.versions = {{"cardan", "0.1.0"}};
  s.verdict = Verdict::failed;
  s.planned_s = 130.0;
  s.warnings.add(Code::stiff_scene, {"mission.integrator.method", {"scenario.lua", 7, 0}}, "stiff", "cvode_bdf", 1.5);
  s.warnings.add(Code::stiff_scene, {"mission.integrator.method", {"scenario.lua", 7, 0}}, "stiff", "cvode_bdf", 2.5);
  s.warnings.add(Code::mission_doubt, {"mission.duration", {}}, "", "");
  return s;
}

TEST(Summary, HasTheKeysThatToolsRelyOn) {
  const Json j = Json::parse(to_json(example()));
  EXPECT_EQ(j["checks"][0]["name"], "pointing");
  EXPECT_EQ(j["checks"][0]["verdict"], "pass");
  EXPECT_EQ(j["checks"][1]["verdict"], "fail");
  EXPECT_EQ(j["checks"][1]["value"].get<double>(), 1.0 / 3.0);  // bit by bit
  EXPECT_EQ(j["checks"][1]["limit"].get<double>(), 0.25);
  EXPECT_EQ(j["ledger"]["linear_momentum"].get<double>(), 1e-15);
  EXPECT_EQ(j["ledger"]["angular_momentum"].get<double>(), 2e-14);
  EXPECT_EQ(j["ledger"]["energy"].get<double>(), 3e-12);
  EXPECT_TRUE(j["ledger"]["undecided"].empty());
  EXPECT_EQ(j["simulated_s"].get<double>(), 120.0);
  EXPECT_EQ(j["wall_s"].get<double>(), 2.5);
  EXPECT_EQ(j["cpu_s"].get<double>(), 2.25);
  EXPECT_EQ(j["rejected"], 17);
  EXPECT_EQ(j["steps"], 1234);
  EXPECT_EQ(j["rhs_calls"], 5678);
  EXPECT_EQ(j["jacobian_products"], 21);
  EXPECT_EQ(j["preconditioner_setups"], 22);
  EXPECT_EQ(j["linear_iterations"], 23);
  EXPECT_EQ(j["inner_steps"], 24);
  EXPECT_EQ(j["integration"]["by_stop"], 31);
  EXPECT_EQ(j["integration"]["shortest"], 1e-3);
  EXPECT_EQ(j["integration"]["rejected_modal"], 17);
  EXPECT_EQ(j["integration"]["restarts_tick"], 8);
  EXPECT_EQ(j["integration"]["worst"][1], Json({{"component", "bus.wx"}, {"steps", 3}}));
  EXPECT_EQ(j["figures"][0]["name"], "final_error_deg");
  EXPECT_EQ(j["model"]["n_modes"], 8);
  EXPECT_EQ(j["versions"]["cardan"], "0.1.0");
  EXPECT_EQ(j["verdict"], "failed");
  EXPECT_EQ(j["planned_s"].get<double>(), 130.0);
  EXPECT_TRUE(j["failure"].is_null());
}

TEST(Summary, TellsTheBalancesWhoseLimitJudgesNothing) {
  Summary s = example();
  s.ledger = Ledger{.undecided = {"linear momentum", "energy"}};
  const Json ledger = Json::parse(to_json(s))["ledger"];
  EXPECT_EQ(ledger["undecided"], (Json{"linear momentum", "energy"}));
  EXPECT_EQ(ledger["verdict"], "pass");
}

TEST(Summary, HasWarningsWithPlaceCountAndTime) {
  const Json w = Json::parse(to_json(example()))["warnings"];
  ASSERT_EQ(w.size(), 2u);
  EXPECT_EQ(w[0]["code"], "W0401");
  EXPECT_EQ(w[0]["about"], "stiff");
  EXPECT_EQ(w[0]["path"], "mission.integrator.method");
  EXPECT_EQ(w[0]["file"], "scenario.lua");
  EXPECT_EQ(w[0]["line"], 7);
  EXPECT_EQ(w[0]["count"], 2);
  EXPECT_EQ(w[0]["t"].get<double>(), 1.5) << "of the first";
  EXPECT_EQ(w[0]["hint"], "cvode_bdf");
  EXPECT_EQ(w[1]["about"], std::string(title_of(Code::mission_doubt)));
  EXPECT_TRUE(w[1]["t"].is_null()) << "before the run";
}

TEST(Summary, TellsTheFailureOfARunThatWasAborted) {
  Summary s = example();
  s.verdict = Verdict::aborted;
  s.failure = RunFailure{Code::step_too_small, 12.5, "", "", "h = 1e-20 s", "", ""};
  const Json j = Json::parse(to_json(s));
  EXPECT_EQ(j["verdict"], "aborted");
  EXPECT_EQ(j["failure"]["code"], "N0201");
  EXPECT_EQ(j["failure"]["t"].get<double>(), 12.5);
}

TEST(Summary, RefusesNumbersThatAreNotFinite) {
  Summary s = example();
  s.checks[1].value = std::numeric_limits<double>::quiet_NaN();
  try {
    to_json(s);
    FAIL();
  } catch (const NumericsError& error) {
    EXPECT_EQ(error.failure().code, Code::not_finite);
    EXPECT_EQ(error.failure().what, "result /checks/1/value");
  }
}

TEST(Json, TellsAnErrorToTools) {
  const Json j = to_json(Diagnostic{Code::unknown_key, {"bodies.bus.mas", {"v.yaml", 3, 5}}, "mass", "mas", "h"});
  EXPECT_EQ(j["code"], "C0104");
  EXPECT_EQ(j["title"], "unknown key");
  EXPECT_EQ(j["at"], "bodies.bus.mas");
  EXPECT_EQ(j["line"], 3);
  EXPECT_EQ(j["column"], 5);
}

// Test vectors of FIPS 180-4 (NIST, "SHA256 examples"): none, one block, two blocks.
TEST(Sha256, MatchesThePublishedExamples) {
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(Sha256, TellsWhenTheFileCannotBeRead) { EXPECT_THROW(sha256_of_file("/nowhere/x"), InputError); }

}  // namespace
}  // namespace cardan
