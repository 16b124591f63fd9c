// Devices as a mission has them: channels, commands and readings in Lua, a run that is resumed, and what is answered to a wrong name.
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kSeeds = CARDAN_SOURCE_DIR "/tests/fuzz/seeds";

void make_device_scenario(const TemporaryFolder& dir, const std::string& rest) {
  fs::copy(kSeeds + "/devices.yaml", dir / "vehicle.yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 1, output = { rate = "20 Hz" }, checkpoint = { period = "0.25 s" } }
)lua" + rest);
}

TEST(DevicesInScripts, AreCommandedReadAndResumed) {
  const TemporaryFolder dir;
  make_device_scenario(dir, R"lua(
local motor, imu, wheel = sat:device "motor", sat:device "imu", sat:device "wheel"
controller { name = "c", rate = "10 Hz", step = function(t) motor:set("voltage", 2 - imu:get "rate_z" + 0.1 * wheel:get "momentum") end }
figure { name = "warm", value = function() return motor:get "current" end }
)lua");
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out", "--check-against-reference"}, dir.path());
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto whole = channels_of(dir / "out");
  for (const char* channel :
       {"devices/motor/voltage", "devices/motor/current", "devices/imu/rate_z", "devices/stay/tension", "devices/catch/closed"})
    EXPECT_TRUE(whole.count(std::string("/channels/") + channel) == 1) << channel;
  const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", "0.5", "--quiet", "--out", "again"}, dir.path());
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(json(whole).dump(), json(channels_of(dir / "again")).dump());
}

/// A controller reads what sensors tell of this very instant, and controllers of one instant are called as they are declared: what the
/// first commands the next one reads.
TEST(DevicesInScripts, AreReadAtTheSameInstantByControllersInTheirOrder) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  bus: {mass: 10, inertia: [2, 2, 2], hinge: {type: free, to: world}}
devices:
  gyro: {type: imu, at: bus, rate: 10 Hz}
  wheel: {type: momentum_wheel, at: bus, inertia: 0.05}
)yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 2 }
local gyro, wheel, bus = sat:device "gyro", sat:device "wheel", sat:body "bus"
local seen = persist { ticks = 0, late = 0, moved = 0, last = 0.0, wrong = 0, order = "" }
controller { name = "z", rate = "10 Hz", step = function(t)
  local told, truth = gyro:get "rate_z", select(3, bus:rate())
  if told ~= truth then seen.late = seen.late + 1 end
  if told ~= seen.last then seen.moved = seen.moved + 1 end
  seen.last, seen.ticks, seen.order = told, seen.ticks + 1, seen.order .. "z"
  wheel:set("torque", 0.1 + t)
end }
controller { name = "a", rate = "10 Hz", step = function(t)
  if wheel:get "torque" ~= 0.1 + t then seen.wrong = seen.wrong + 1 end
  seen.order = seen.order .. "a"
end }
controller { name = "m", rate = "5 Hz", step = function() seen.order = seen.order .. "m" end }
figure { name = "ticks", value = function() return seen.ticks end }
figure { name = "moved", value = function() return seen.moved end }
figure { name = "late", value = function() return seen.late end }
figure { name = "wrong", value = function() return seen.wrong end }
figure { name = "in order", value = function() return seen.order == ("zamza"):rep(10) .. "zam" and 1 or 0 end }
)lua");
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::map<std::string, double> figures;
  const json summary = summary_of(dir / "out");
  for (const json& f : summary.at("figures")) figures[f.at("name")] = f.at("value");
  EXPECT_EQ(figures, (std::map<std::string, double>{{"ticks", 21}, {"moved", 20}, {"late", 0}, {"wrong", 0}, {"in order", 1}}));
}

/// Ports with the names rate_x, rate_y, rate_z are the vector rate: connected, commanded and read as one; an imu says when a rate is beyond
/// its range, and whoever takes that and does not ask is told of.
TEST(DevicesInScripts, HaveVectorsAndSayWhetherTheyHold) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  bus: {mass: 10, inertia: [2, 2, 2], hinge: {type: free, to: world, initial: {rate: [0.1, 0.2, 0.3], position: [7, 0, 0]}}}
devices:
  gyro: {type: imu, at: bus, rate: 10 Hz, gyro_range: 0.35 rad/s}
  tight: {type: imu, at: bus, rate: 10 Hz, gyro_range: 0.25 rad/s}
  copy: {type: lua/copy, rate: 10 Hz, inputs: {rate: gyro.rate}}
  coils: {type: magnetorquer, at: bus, field: earth, max_moment: 5, inputs: {moment: [1 A m^2, 2, 3]}}
fields:
  earth: {type: dipole, strength: 50}
)yaml");
  write(dir / "scenario.lua", R"lua(
device { type = "lua/copy", inputs = { rate_x = "rad/s", rate_y = "rad/s", rate_z = "rad/s" }, outputs = { sum = "rad/s" },
  tick = function(a) return { sum = a.rate_x + 10 * a.rate_y + 100 * a.rate_z } end }
local sat = vehicle "vehicle.yaml"
mission { duration = 1 }
local gyro, tight, coils = sat:device "gyro", sat:device "tight", sat:device "coils"
local seen = persist { x = 0.0, y = 0.0, z = 0.0, valid = true, always = false, beyond = false, moment = 0.0, before = 0.0 }
controller { name = "c", rate = "10 Hz", step = function(t)
  local w, m = gyro:get "rate", coils:get "moment"
  if t == 0 then seen.before = m[1] + 10 * m[2] + 100 * m[3] end
  seen.x, seen.y, seen.z, seen.valid, seen.always = w[1], w[2], w[3], gyro:valid "rate", gyro:valid "valid"
  seen.beyond = not tight:valid "rate_x" and tight:get "rate_z" == 0.25
  coils:set("moment", { 0.5, 0.25, 0.125 })
  m = coils:get "moment"
  seen.moment = m[1] + 10 * m[2] + 100 * m[3]
end }
figure { name = "rate", value = function() return seen.x + 10 * seen.y + 100 * seen.z end }
figure { name = "copied", value = function() return sat:device "copy":get "sum" end }
figure { name = "beyond", value = function() return seen.beyond and 1 or 0 end }
figure { name = "before", value = function() return seen.before end }
figure { name = "moment", value = function() return seen.moment end }
figure { name = "holds", value = function() return (seen.valid and seen.always) and 1 or 0 end }
)lua");
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::map<std::string, double> figures;
  const json summary = summary_of(dir / "out");
  for (const json& f : summary.at("figures")) figures[f.at("name")] = f.at("value");
  EXPECT_EQ(figures["copied"], figures["rate"]);
  EXPECT_NEAR(figures["rate"], 0.1 + 10 * 0.2 + 100 * 0.3, 0.1);  // of a sphere that coils turn a little
  EXPECT_EQ(figures["beyond"], 1.0);
  EXPECT_EQ(figures["before"], 321.0);
  EXPECT_EQ(figures["moment"], 15.5);
  EXPECT_EQ(figures["holds"], 1.0);
  const Finished check = run_program({"check", "."}, dir.path());
  EXPECT_NE(
      (check.out + check.err).find("copy takes gyro.rate_x, gyro.rate_y, gyro.rate_z and not gyro.valid, which says whether that holds"),
      std::string::npos)
      << check.out << check.err;
}

/// The scenario's last line is the fault: its place, what was expected, what was got.
TEST(DevicesInScripts, AnswerToWrongNames) {
  const struct {
    const char *line, *at, *expected, *got;
  } cases[] = {
      {"sat:device 'whel'", "vehicle:device", "a device of the vehicle: ", "\"whel\""},
      {"sat:device('motor'):set('volts', 2)", "device motor", "one of: voltage", "\"volts\""},
      {"sat:device('motor'):get('volts')", "device motor", "one of: torque, voltage, current", "\"volts\""},
      {"sat:device('imu'):set('rate_x', 2)", "device imu", "nothing: a imu has no such numbers", "\"rate_x\""},
      {"sat:device('wheel'):set('torque', 2)", "torque of device wheel", "an input that is not connected", "one that another device gives"},
      {"sat:device('motor'):set('voltage', 0 / 0)", "voltage of device motor", "a finite number", "nan"}};
  for (const auto& c : cases) {
    const TemporaryFolder dir;
    make_device_scenario(dir, c.line);
    const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
    EXPECT_EQ(run.exit_code, 2) << c.line;
    for (const std::string& text :
         {std::string("scenario.lua:4"), std::string("at: ") + c.at, std::string("expected: ") + c.expected, std::string(c.got)})
      EXPECT_NE(run.err.find(text), std::string::npos) << text << " in\n" << run.err;
    EXPECT_FALSE(fs::exists(dir / "out/run.h5")) << c.line;
  }
}

}  // namespace
}  // namespace cardan
