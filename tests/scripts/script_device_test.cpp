// device{...}: types of devices whose functions the script gives.
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr char kVehicle[] =
    "cardan: 1\nbodies:\n  bus: {mass: 10, inertia: [2, 2, 2], hinge: {type: free, to: world, initial: {rate: [0, 0, 0.2]}}}\n"
    "  arm: {mass: 1, inertia: [0.1, 0.1, 0.1], hinge: {type: prismatic, to: bus, axis: [1, 0, 0], initial: {displacement: 0.3}}}\n";

/// `devices` of the vehicle, what the script has before it, and after it.
Finished run(const TemporaryFolder& dir, const std::string& devices, const std::string& before, const std::string& after,
             const std::vector<std::string>& arguments = {"run", ".", "--quiet", "--out", "out"}) {
  write(dir / "vehicle.yaml", kVehicle + ("devices:\n" + devices));
  write(dir / "scenario.lua", before + "\nlocal sat = vehicle 'vehicle.yaml'\n" + after);
  return run_program(arguments, dir.path());
}

/// A controller with a state: what it gives is held between ticks, and it is resumed with the same bits.
TEST(ScriptDevices, AreSampledHeldAndResumed) {
  const TemporaryFolder dir;
  const Finished first =
      run(dir,
          "  gyro: {type: imu, at: bus, rate: 10 Hz}\n"
          "  damper: {type: lua/damper, at: bus, rate: 10 Hz, gain: 3 N m s/rad, inputs: {speed: gyro.rate_z}}\n"
          "  wheel: {type: momentum_wheel, at: bus, inertia: 0.05, inputs: {torque: damper.torque}}\n",
          "device { type = 'lua/damper', mounts = { at = 'node' }, params = { gain = { 1, 'N m s/rad' } }, inputs = { speed = 'rad/s' },\n"
          "  outputs = { torque = 'N m' }, memory = { ticks = 0 },\n"
          "  tick = function(a, dt) assert(dt == 0.1 and #a.at.specific_force == 3); return { torque = a.gain * a.speed, ticks = a.ticks + "
          "1 } end }",
          "mission { duration = 2, checkpoint = { period = 1 } }\n"
          "check { name = 'ticks', value = function() return sat:device('damper'):get 'ticks' end, equal = { 21, tolerance = 0.1 } }\n"
          "check { name = 'slow', unit = 'rad/s', value = function() return select(3, sat:body('bus'):rate()) end, below = 0.05 }\n");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const Finished resumed = run_program({"run", "--quiet", "--resume", "out/run.h5", "--at", "1", "--out", "again"}, dir.path());
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  const Finished same = run_program({"diff", "out", "again"}, dir.path());
  EXPECT_EQ(same.exit_code, 0) << same.out << same.err;
}

/// Lines of its trial, with numbers that are made up, stood before those of the run.
TEST(ScriptDevices, PrintInTheRunAlone) {
  const TemporaryFolder dir;
  const Finished done =
      run(dir, "  clock: {type: lua/clock, rate: 1 Hz}\n",
          "device { type = 'lua/clock', outputs = { now = 's' }, tick = function(a) print('at', a.t) return { now = a.t } end }",
          "mission { duration = 2 }\n", {"run", ".", "--no-report", "--out", "out"});
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(done.out.substr(0, done.out.find("\n\n")), "at\t0.0\nat\t1.0\nat\t2.0") << done.out;
}

/// As the page has it, with the device that its last line describes.
TEST(ScriptDevices, TheOneOfTheDocumentsRuns) {
  const std::string page = file_text(CARDAN_SOURCE_DIR "/docs/scenario_lua.md");
  const auto from = page.find("device { type ="), to = page.find("local sat", from), described = page.find("damper: {", to);
  const TemporaryFolder dir;
  const Finished done =
      run(dir, "  gyro: {type: imu, at: bus, rate: 10 Hz}\n  " + page.substr(described, page.find('\n', described) - described) + "\n",
          page.substr(from, to - from),
          "mission { duration = 2 }\n"
          "check { name = 'ticks', value = function() return sat:device('damper'):get 'ticks' end, equal = { 21 } }\n");
  EXPECT_EQ(done.exit_code, 0) << done.err;
}

/// Inside of the right-hand side: a spring of the script on a slide swings at the frequency of the one that is built in.
TEST(ScriptDevices, MayActInsideOfAStep) {
  const TemporaryFolder dir;
  const std::string spring =
      "device { type = 'lua/spring', in_step = true, mounts = { at = 'hinge' }, params = { k = { 1, 'N/m' } }, outputs = { force = 'N' },\n"
      "  states = { work = 'J' },\n"
      "  evaluate = function(a) local f = -a.k * a.at.q; return { at = f, force = f, work = f * a.at.v } end }";
  const Finished done = run(dir, "  spring: {type: lua/spring, at: arm, k: 20 N/m}\n", spring,
                            "mission { duration = 3, integrator = { relative = 1e-10 } }\n"
                            "initial { bus = { angular_velocity = { 0, 0, 0 } } }\n"
                            "local w = math.sqrt(20 * (1 / 1 + 1 / 10))\n"
                            "check { name = 'swing', value = function() return math.abs(sat:hinge('arm'):q() - 0.3 * math.cos(3 "
                            "* w)) end, below = 1e-7 }\n"
                            "check { name = 'work', value = function() return math.abs(sat:device('spring'):get 'work' - 10 * (0.09 - "
                            "sat:hinge('arm'):q() ^ 2)) end, below = 1e-7 }\n");
  EXPECT_EQ(done.exit_code, 0) << done.err << file_text(dir / "out/summary.json");
  const Finished told = run_program({"describe", "."}, dir.path());
  EXPECT_NE(told.out.find("lua/spring: in the right-hand side"), std::string::npos) << told.out;
}

/// What reads alone may read a hinge whose motion is given, inside of a step: the work of a constant force over its rate, and its angle.
TEST(ScriptDevices, ReadHingesWhoseMotionIsGiven) {
  const TemporaryFolder dir;
  const std::string vehicle =
      "cardan: 1\nbodies:\n  bus: {mass: 10, inertia: [2, 2, 2], hinge: {type: free, to: world}}\n"
      "  arm: {mass: 1, inertia: [0.1, 0.1, 0.1], hinge: {type: revolute, to: bus, axis: [1, 0, 0], prescribed: true, initial: {rate: "
      "0.5}}}\n"
      "devices: {way: {type: lua/way, at: arm}}\n";
  const auto script = [](const char* mounts, const char* more) {
    return std::string("device { type = 'lua/way', in_step = true, mounts = { at = ") + mounts +
           " }, states = { way = 'rad', square = 'rad^2 s' },\n  evaluate = function(a) return { way = a.at.v, square = a.at.q ^ 2" + more +
           " } end }\nlocal sat = vehicle 'vehicle.yaml'\n"
           "sat:hinge('arm'):profile { hold = '0.5 rad/s' }\n"
           "mission { duration = 4, integrator = { relative = 1e-10 } }\n"
           "check { name = 'way', value = function() return sat:device('way'):get 'way' end, equal = { 2, tolerance = 1e-8 } }\n"
           "check { name = 'square', value = function() return sat:device('way'):get 'square' end, equal = { 16 / 3, tolerance = 1e-8 } "
           "}\n";
  };
  write(dir / "vehicle.yaml", vehicle);
  write(dir / "scenario.lua", script("{ reads = 'hinge' }", ""));
  const Finished done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(done.exit_code, 0) << done.err << done.out;
  write(dir / "scenario.lua", script("'hinge'", ""));
  const Finished pushes = run_program({"check", "."}, dir.path());
  EXPECT_TRUE(has(pushes.err, "error[C0401]") && has(pushes.err, "{reads = \"hinge\"}")) << pushes.err;
  write(dir / "scenario.lua", script("{ reads = 'hinge' }", ", at = 1"));
  const Finished both = run_program({"check", "."}, dir.path());
  EXPECT_TRUE(both.exit_code == 2 && has(both.err, "\"at\"")) << both.err;
}

/// A drag and a coil of the script on one body, those that are built in on another: they move alike to the last bit.
TEST(ScriptDevices, ReadFieldsWhereTheyAre) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml",
        "cardan: 1\n"
        "gravity: {field: earth}\n"
        "fields:\n"
        "  earth: {type: zonal_harmonics, mu: 398600.4418 km^3/s^2, radius: 6378.137 km, J2: 1.08262982e-3}\n"
        "  air: {type: exponential_atmosphere, density: 2.8e-9 kg/m^3, height: 400 km}\n"
        "  wind: {type: co_rotating_wind}\n"
        "  geomagnetic: {type: dipole, axis: [0.1, -0.2, 0.9]}\n"
        "bodies:\n"
        "  one: {mass: 100, inertia: [10, 12, 9], hinge: {type: free, to: world}}\n"
        "  other: {mass: 100, inertia: [10, 12, 9], hinge: {type: free, to: world}}\n"
        "devices:\n"
        "  drag: {type: drag, at: one, air: air, wind: wind, area: 3}\n"
        "  coils: {type: magnetorquer, at: one, field: geomagnetic, max_moment: 100}\n"
        "  drag_of_script: {type: lua/drag, at: other, air: air, wind: wind, area: 3}\n"
        "  coils_of_script: {type: lua/coils, at: other, B: geomagnetic, pull: earth}\n");
  write(
      dir / "scenario.lua",
      "device { type = 'lua/drag', in_step = true, mounts = { at = 'node', air = 'density', wind = { field = 'wind', at = 'at', optional = "
      "true } },\n"
      "  params = { area = 'm^2' },\n"
      "  evaluate = function(a)\n"
      "    local u, s = {}, 0\n"
      "    for i = 1, 3 do u[i] = a.at.velocity[i] - a.wind[i]; s = s + u[i] ^ 2 end\n"
      "    local f = -0.5 * 2.2 * a.area * a.air * math.sqrt(s)\n"
      "    return { at = { force = { f * u[1], f * u[2], f * u[3] } } }\n"
      "  end }\n"
      "device { type = 'lua/coils', in_step = true, mounts = { at = 'node', B = 'magnetic', pull = 'gravity', sun = { field = 'light', "
      "optional = true } },\n"
      "  outputs = { g = 'm/s^2', light = 'W/m^2' },\n"
      "  evaluate = function(a)\n"
      "    return { g = vec.norm(a.pull), light = vec.norm(a.sun), at = { moment = vec.cross({ 10, -20, 5 }, a.B) } }\n"
      "  end }\n"
      "local sat = vehicle 'vehicle.yaml'\n"
      "for _, b in ipairs { 'one', 'other' } do\n"
      "  initial { [b] = { position = { 6878e3, 0, 0 }, velocity = { 0, 5400, 5400 }, rate = { 0.01, 0.02, -0.01 } } }\n"
      "end\n"
      "mission { duration = 300 }\n"
      "local coils, start = sat:device 'coils', sat:device('coils_of_script'):get 'g'\n"
      "controller { name = 'moments', period = 10, step = function() coils:set('moment_x', 10) coils:set('moment_y', -20) "
      "coils:set('moment_z', 5) end }\n"
      "local function apart(what)\n"
      "  local a, b = { sat:body('one')[what](sat:body 'one') }, { sat:body('other')[what](sat:body 'other') }\n"
      "  return vec.norm(vec.sub(a, b))\n"
      "end\n"
      "check { name = 'position', unit = 'm', value = function() return apart 'position' end, equal = { 0 } }\n"
      "check { name = 'rate', unit = 'rad/s', value = function() return apart 'rate' end, equal = { 0 } }\n"
      "check { name = 'turned', unit = 'rad/s', value = function() return vec.norm { sat:body('one'):rate() } end, above = 0.026 }\n"
      "check { name = 'pull', unit = 'm/s^2', value = function() return start end, equal = { 3.986004418e14 / 6878e3 ^ 2 * (1 + 1.5 * "
      "1.08262982e-3 * (6378.137 / 6878) ^ 2), tolerance = 1e-12 } }\n");
  const Finished done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(done.exit_code, 0) << done.out << done.err << (done.err.empty() ? file_text(dir / "out/summary.json") : "");
  EXPECT_TRUE(has(run_program({"describe", "."}, dir.path()).out, "read by drag, drag_of_script"));
}

TEST(ScriptDevices, ThatAreNotPureAreRefused) {
  const struct {
    const char *device, *told;
  } cases[] = {
      {"local n = 0\ndevice { type = 'lua/x', in_step = true, outputs = { y = '1' }, evaluate = function(a) n = n + 1 return { y = a.t } "
       "end }",
       "a variable that changes in a call: n = 0 (number)"},
      {"local m = { n = 0 }\ndevice { type = 'lua/x', memory = { k = 0 }, tick = function(a) m.n = m.n + 1 return { k = a.k } end }",
       "a variable that changes in a call: m.n = 0 (number)"},
      {"device { type = 'lua/x', in_step = true, outputs = { y = '1' }, evaluate = function(a) return { y = math.random() } end }",
       "evaluate is a function of its arguments"},
      {"device { type = 'lua/x', in_step = true, outputs = { y = '1' }, evaluate = function(a) return { z = 1 } end }",
       "a table with y = a number"},
      {"device { type = 'lua/x', in_step = true, outputs = { y = '1' }, evaluate = function(a) return a.t end }",
       "a table of numbers by their names"},
      {"device { type = 'lua/x', in_step = true, evaluate = function(a) error 'no luck' end }", "no luck"},
      {"device { type = 'lua/x', evaluate = function(a) return {} end }", "`evaluate` and `in_step = true` together"},
      {"device { type = 'lua/x' }", "a function tick(a, dt), or evaluate(a) with in_step = true"},
      {"device { type = 'lua/x', states = { z = '1' }, tick = function(a) return {} end }", "`memory` in a device that is sampled"},
      {"device { type = 'imu', tick = function(a) return {} end }", "a type that is not taken yet"},
      {"device { type = 'lua/x', inputs = { u = 'furlong' }, tick = function(a) return {} end }", "a unit: rad/s, N m, 1"},
      {"device { type = 'lua/x', params = { u = { 30, 'deg' } }, tick = function(a) return {} end }",
       "a unit of SI, in which functions get all numbers"},
      {"local m = { deep = { { n = 0 } } }\ndevice { type = 'lua/x', tick = function(a) m.deep[1].n = m.deep[1].n + 1 return {} end }",
       "a variable that changes in a call: m.deep.1.n = 0 (number)"},
      {"device { type = 'lua/x', memory = { count = 0 }, tick = function(a) return { cuont = a.count + 1 } end }",
       "did you mean \"count\""},
      {"device { type = 'lua/x', in_step = true, mounts = { at = 'hinge' }, evaluate = function(a) return { force = 1 } end }",
       "numbers of at"},
      {"device { type = 'lua/x', mounts = { air = 'density' }, tick = function(a) return {} end }",
       "a field beside a mount that is a node, where it is read"},
      {"device { type = 'lua/x', mounts = { a = 'node', b = 'node', air = 'density' }, tick = function(a) return {} end }",
       "{field = ..., at = the node where it is read}: a or b"},
      {"device { type = 'lua/x', mounts = { a = 'node', air = { field = 'densitiy' } }, tick = function(a) return {} end }",
       "did you mean \"density\""},
      {"device { type = 'lua/x', in_step = true, mounts = { a = 'node', air = 'density' }, evaluate = function(a) return { air = 1 } end }",
       "numbers of a"},
      {"device { type = 'lua/x', inputs = { u = 1 }, outputs = { u = 1 }, tick = function(a) return { u = 1 } end }", "a name of its own"}};
  for (const auto& c : cases) {
    const TemporaryFolder dir;
    const Finished told = run(dir, "  wheel: {type: momentum_wheel, at: bus, inertia: 0.05}\n", c.device, "mission { duration = 1 }\n");
    EXPECT_EQ(told.exit_code, 2) << c.device;
    EXPECT_NE(told.err.find(c.told), std::string::npos) << c.told << " in\n" << told.err;
    EXPECT_NE(told.err.find("scenario.lua:"), std::string::npos) << told.err;
  }
}

/// A parameter without a value of its own is asked of the vehicle.
TEST(ScriptDevices, HaveVectorsOfManyPorts) {  // of ten and more the order of their names was another one
  const TemporaryFolder dir;
  const Finished done = run(dir, "  many: {type: lua/many, rate: 10 Hz}\n",
                            "local ins = {} for i = 1, 12 do ins['u_' .. i] = '1' end\n"
                            "device { type = 'lua/many', inputs = ins, outputs = { y = '1' }, tick = function(a) return { y = a.u_2 + 10 * "
                            "a.u_12 } end }",
                            "mission { duration = 1 }\n"
                            "local list = {} for i = 1, 12 do list[i] = i end\n"
                            "controller { name = 'c', rate = '10 Hz', step = function() sat:device('many'):set('u', list) end }\n"
                            "check { name = 'y', value = function() return sat:device('many'):get 'y' end, equal = { 122 } }\n");
  EXPECT_EQ(done.exit_code, 0) << done.err;
}

TEST(ScriptDevices, HaveParametersThatTheVehicleGives) {
  const TemporaryFolder dir;
  const std::string type =
      "device { type = 'lua/x', params = { k = 'N/m' }, outputs = { y = 'N/m' }, tick = function(a) return { y = a.k } end }";
  const Finished without = run(dir, "  x: {type: lua/x, rate: 1 Hz}\n", type, "mission { duration = 1 }\n");
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_NE(without.err.find("devices.x"), std::string::npos) << without.err;
  EXPECT_NE(without.err.find("k"), std::string::npos) << without.err;
  const Finished with = run(dir, "  x: {type: lua/x, rate: 1 Hz, k: 2 kN/m}\n", type,
                            "mission { duration = 1 }\ncheck { name = 'k', unit = 'N/m', value = function() return sat:device('x'):get 'y' "
                            "end, equal = { 2000, tolerance = 1e-9 } }\n");
  EXPECT_EQ(with.exit_code, 0) << with.err;
}

/// What fails in the run is told at its line, and nothing but what it is handed may be read.
TEST(ScriptDevices, ThatFailInTheRunAreTold) {
  const struct {
    const char *body, *told;
  } cases[] = {{"if a.t > 0.5 and a.t < 0.9 then error 'too late' end return { at = 0 }", "too late"},
               {"if a.t > 0.5 and a.t < 0.9 then return { at = bus:position() } end return { at = 0 }", "what it is handed"},
               {"if a.t > 0.5 and a.t < 0.9 then return { at = 0 / 0 } end return { at = 0 }", "a finite number for at"}};
  for (const auto& c : cases) {
    const TemporaryFolder dir;
    const Finished told =
        run(dir, "  x: {type: lua/x, at: arm}\n",
            std::string("device { type = 'lua/x', in_step = true, mounts = { at = 'hinge' }, evaluate = function(a) ") + c.body + " end }",
            "bus = sat:body 'bus'\nmission { duration = 1 }\n");
    EXPECT_EQ(told.exit_code, 3) << told.err;
    EXPECT_NE(told.err.find(c.told), std::string::npos) << told.err;
    EXPECT_NE(told.err.find("scenario.lua:1"), std::string::npos) << told.err;
  }
}

}  // namespace
}  // namespace cardan
