// sat:change{...}: the vehicle becomes another one in the midst of a run.
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

Finished run(const TemporaryFolder& dir, const std::string& rest, const std::vector<std::string>& more = {}) {
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
name: a wheel on the world
bodies:
  wheel:
    mass: 2 kg
    com: [0, 0, 0]
    inertia: {xx: 0.3, yy: 0.3, zz: 0.3, xy: 0, xz: 0, yz: 0}
    hinge: {type: revolute, to: world, axis: [0, 0, 1]}
)yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 2, output = { rate = "10 Hz" }, checkpoint = { period = "0.5 s" } }
local wheel = sat:hinge "wheel"
)lua" + rest);
  std::vector<std::string> arguments = {"run", ".", "--quiet", "--out", "out"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_program(arguments, dir.path());
}

const std::string kDriven = R"lua(
wheel:force(0.1)
local memory = persist { before = 0.0, mass = 0.0 }
phase { name = "light", duration = 1, exit_ = function()
  memory.before, memory.mass = wheel:v(), sat:mass()
  sat:change { ["bodies.wheel.inertia.zz"] = "0.5 kg m^2", ["bodies.wheel.mass"] = 7 }
end }
phase { name = "heavy", duration = 1 }
figure { name = "before", value = function() return memory.before end }
figure { name = "after", value = function() return wheel:v() end }
figure { name = "gain", value = function() return sat:mass() - memory.mass end }
)lua";

double figure(const json& summary, const std::string& name) {
  for (const json& f : summary.at("figures"))
    if (f.at("name") == name) return f.at("value");
  throw std::out_of_range(name);
}

/// A constant torque tau: the rate grows by tau t / J, J = 0.3, and 0.5 from 1 s on; exact for the method to round-off.
TEST(AVehicleThatChanges, MovesOnAsTheNewOne) {
  const TemporaryFolder dir;
  const Finished done = run(dir, kDriven);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const json summary = summary_of(dir / "out");
  EXPECT_NEAR(figure(summary, "before"), 0.1 / 0.3, 1e-14);
  EXPECT_NEAR(figure(summary, "after"), 0.1 / 0.3 + 0.1 / 0.5, 1e-14);
  EXPECT_NEAR(figure(summary, "gain"), 5.0, 1e-14);
}

TEST(AVehicleThatChanges, IsRepeatedWithTheSameBitsAndNotResumedLater) {
  const TemporaryFolder dir;
  ASSERT_EQ(run(dir, kDriven).exit_code, 0);
  const Finished again = run_program({"run", "--again", "out/run.h5", "--quiet", "--out", "again"}, dir.path());
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(json(channels_of(dir / "out")).dump(), json(channels_of(dir / "again")).dump());
  const Finished early = run_program({"run", "--resume", "out/run.h5", "--at", "0.5", "--quiet", "--out", "early"}, dir.path());
  ASSERT_EQ(early.exit_code, 0) << early.err;
  EXPECT_EQ(json(channels_of(dir / "out")).dump(), json(channels_of(dir / "early")).dump());
  const Finished late = run_program({"run", "--resume", "out/run.h5", "--at", "1.5", "--quiet", "--out", "late"}, dir.path());
  EXPECT_EQ(late.exit_code, 2);
  EXPECT_NE(late.err.find("another vehicle"), std::string::npos) << late.err;
}

TEST(AVehicleThatChanges, AnswersToWhatCannotBe) {
  const struct {
    const char *line, *says;
  } cases[] = {{"sat:change { ['bodies.wheel.mas'] = '3 kg' }", "mas"},
               {"sat:change { ['bodies.wheel.mass'] = '3 m' }", "kg"},
               {"sat:change { ['bodies.wheel.mass'] = '-3 kg' }", "mass"},
               {"sat:change { ['mission.duration'] = 3 }", "bodies., gravity. or devices."},
               {"sat:change { 3 }", "key paths"},
               {"sat:change 'mass'", "table"},
               {"sat:change { ['bodies.wheel.hinge.type'] = 'prismatic' }", "C0403"}};
  for (const auto& c : cases) {
    const TemporaryFolder dir;
    const Finished done = run(dir, c.line);
    EXPECT_EQ(done.exit_code, 2) << c.line;
    EXPECT_NE(done.err.find(c.says), std::string::npos) << c.line << "\n" << done.err;
    EXPECT_NE(done.err.find("scenario.lua:5"), std::string::npos) << c.line << "\n" << done.err;
    EXPECT_FALSE(fs::exists(dir / "out/run.h5")) << c.line;
  }
}

}  // namespace
}  // namespace cardan
