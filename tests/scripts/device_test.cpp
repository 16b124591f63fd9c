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
      {"sat:device('motor'):set('voltage', 0 / 0)", "an input of device of motor", "a finite number", "nan"}};
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
