// sat:change{...}: the vehicle becomes another one in the midst of a run.
#include <gtest/gtest.h>

#include <cmath>
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

TEST(AVehicleThatChanges, IsRepeatedAndResumedWithTheSameBits) {
  const TemporaryFolder dir;
  ASSERT_EQ(run(dir, kDriven).exit_code, 0);
  const std::string all = json(channels_of(dir / "out")).dump();
  const Finished again = run_program({"run", "--again", "out/run.h5", "--quiet", "--out", "again"}, dir.path());
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(json(channels_of(dir / "again")).dump(), all);
  for (const char* at : {"0.5", "1", "1.5"}) {  // before, in the instant of the change, after it
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", at, "--quiet", "--out", "resumed"}, dir.path());
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all) << at;
  }
}

/// Initial rates are those of the described vehicle also for a change that comes after the checkpoint of a change.
TEST(AVehicleThatChanges, IsResumedBetweenTwoChanges) {
  const TemporaryFolder dir;
  const std::string again = R"lua(
event { name = "lighter", once = true, direction = "rising", when = function(t) return t - 1.7 end, action = function()
  sat:change { ["bodies.wheel.inertia.zz"] = "0.4 kg m^2" }
end }
)lua";
  ASSERT_EQ(run(dir, kDriven + again, {"--set", "bodies.wheel.hinge.initial={rate: 0.2}"}).exit_code, 0);
  const std::string all = json(channels_of(dir / "out")).dump();
  const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", "1.5", "--quiet", "--out", "resumed"}, dir.path());
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all);
}

/// A change that shifts the numbers of nodes, of devices and of their states: handles that were taken before mean what they meant. Each
/// channel has, before and after, what a run without the change has; friction of 1e-12 N m and a node that carries nothing move nothing.
TEST(AVehicleThatChanges, KeepsTheHandlesThatWereTakenBefore) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  bus: {mass: 50, inertia: [9, 8, 7], nodes: {hook: {position: [0.5, 0, 0]}, rim: {position: [0, 0.5, 0]}}, hinge: {type: free, to: world}}
  arm: {mass: 2, inertia: [0.1, 0.3, 0.3], nodes: {tip: {position: [1, 0, 0]}}, hinge: {type: revolute, to: bus.hook, axis: [0, 0, 1]}}
  boom:
    type: modal_flexible
    modal: {beam: {length: 3 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 2 cm, wall: 1 mm}}}, modes: {count: 2}}
    hinge: {type: locked, to: bus.rim, at: root}
devices:
  gyro: {type: imu, at: arm.tip, rate: 10 Hz}
  motor: {type: dc_motor, at: arm, constant: 0.3, resistance: 1.5, inductance: 0.1, inputs: {voltage: 0.2}}
  wheel: {type: momentum_wheel, at: bus.rim, axis: [0, 1, 0], inertia: 0.05, initial: {momentum: 2}}
)yaml");
  const std::string script = R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 2, integrator = { relative = 1e-10 } }
initial { bus = { wx = 0.1, wy = 0.3, wz = -0.2 }, arm = { rate = 0.4 } }
local bus, arm, tip, rim, boom = sat:body "bus", sat:hinge "arm", sat:node "arm.tip", sat:node "bus.rim", sat:modes "boom"
local gyro, motor, wheel, push = sat:device "gyro", sat:device "motor", sat:device "wheel", sat:node("arm.tip"):load {}
local memory = persist { passes = 0, angle = 0.0 }
event { name = "passes", when = function() return arm:angle() - 0.7 end, action = function()
  memory.passes, memory.angle = memory.passes + 1, arm:angle()
end }
local heard = signals { ["own/heard"] = { components = { "wx", "wy", "wz", "angle", "tip_x", "tip_y", "tip_z", "rim_x", "rim_y", "rim_z", "eta_1",
  "eta_2", "rate_z", "current", "momentum", "passes", "passed" } } }
controller { name = "c", rate = "10 Hz", step = function(t)
  if t == 1 then CHANGE end
  motor:set("voltage", 0.2 + 0.1 * t)
  wheel:set("torque", 0.05 * t)
  push:set(0, 0, 0.01 * t, 0.1, 0, 0)
  local wx, wy, wz = bus:rate()
  local x, y, z = tip:position()
  local u, v, w = rim:position()
  heard["own/heard"](wx, wy, wz, arm:angle(), x, y, z, u, v, w, boom:eta(1), boom:eta(2), gyro:get "rate_z", motor:get "current", wheel:get "momentum",
    memory.passes, memory.angle)
end }
)lua";
  const auto heard = [&](const std::string& change, const std::string& out) {
    write(dir / "scenario.lua", replaced(script, "CHANGE", change));
    const Finished done = run_program({"run", ".", "--quiet", "--out", out}, dir.path());
    EXPECT_EQ(done.exit_code, 0) << done.err;
    auto channels = channels_of(dir / out);
    return channels["/channels/own/heard"];
  };
  const std::vector<double> plain = heard("", "plain");
  const std::vector<double> changed = heard(
      "sat:change { ['bodies.bus.nodes'] = '{a_new_one: {position: [0.1, 0.2, 0.3]}, hook: {position: [0.5, 0, 0]}, rim: {position: [0, "
      "0.5, "
      "0]}}', ['devices.a_spring'] = '{type: lugre_friction, at: arm, coulomb: 1e-12, stiffness: 1e-9}' }",
      "changed");
  ASSERT_EQ(plain.size(), 21u * 17u);
  ASSERT_EQ(changed.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i)  // the method starts anew at the change: ten times its tolerance
    EXPECT_NEAR(changed[i], plain[i], 1e-9 * (1.0 + std::abs(plain[i]))) << "row " << i / 17 << ", component " << i % 17;
  EXPECT_EQ(changed[20 * 17 + 15], 1.0) << "the event comes after the change";
}

/// With other masses the nearest start that closes a loop is another one, by rounding or by far: what is given is the same.
TEST(AVehicleThatChanges, MayHaveAStartThatWasFound) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  a: {mass: 2, inertia: [1, 1, 1], hinge: {type: free, to: world, initial: {wx: 0.3}}}
  b: {mass: 1, inertia: [1, 1, 1], com: [0.1, 0.2, 0], hinge: {type: free, to: world}}
loops:
  pin: {type: point, from: {body: a, position: [1, 0, 0]}, to: {body: b, position: [0, 1, 0.3]}}
)yaml");
  const auto ends = [&](const std::string& change) {
    write(dir / "scenario.lua",
          "local sat = vehicle 'vehicle.yaml' mission { duration = 0.2, checkpoint = { period = '0.05 s' } }\n"
          "phase { name = 'light', duration = 0.1, exit_ = function() sat:change { " +
              change + " } end }\n");
    return run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  };
  const Finished done = ends("['bodies.b.mass'] = '2 kg'");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const std::string all = json(channels_of(dir / "out")).dump();
  const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", "0.15", "--quiet", "--out", "resumed"}, dir.path());
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all);
  const Finished begun = ends("['bodies.a.hinge.initial'] = '{wx: 0.4}'");
  EXPECT_EQ(begun.exit_code, 3);
  EXPECT_NE(begun.err.find("a run begins once"), std::string::npos) << begun.err;
}

TEST(AVehicleThatChanges, TakesAllValuesOfACallOrNone) {  // what stood before the one that contradicts was kept
  const TemporaryFolder dir;
  const Finished done = run(dir, R"lua(
wheel:force(0.1)
phase { name = "light", duration = 1, exit_ = function()
  sat:change { ["bodies.wheel.mass"] = 7 }
  assert(not pcall(sat.change, sat, { ["bodies.wheel.inertia.zz"] = 0.5, ["bodies.wheel.mass"] = 8 }))
end }
phase { name = "heavy", duration = 1 }
figure { name = "after", value = function() return wheel:v() end }
)lua");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  EXPECT_NEAR(figure(summary_of(dir / "out"), "after"), 0.2 / 0.3, 1e-14);
}

TEST(AVehicleThatChanges, AnswersToWhatCannotBe) {
  const struct {
    const char *line, *says;
  } cases[] = {{"sat:change { ['bodies.wheel.mas'] = '3 kg' }", "mas"},
               {"sat:change { ['bodies.wheel.mass'] = '3 m' }", "kg"},
               {"sat:change { ['bodies.wheel.mass'] = '-3 kg' }", "mass"},
               {"sat:change { ['mission.duration'] = 3 }", "one of the keys cardan, name"},
               {"sat:change { 3 }", "key paths"},
               {"sat:change 'mass'", "table"},
               {"sat:change { ['bodies.wheel.hinge.initial'] = '{angle: 1}' }", "C0403"},
               {"sat:change { ['bodies.wheel.hinge.type'] = 'prismtic' }", "prismatic"}};
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
