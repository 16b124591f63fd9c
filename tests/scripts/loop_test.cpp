// What a mission asks of a loop and gives it: sat:loop.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

/// A mass that flies about the ground on a string, hauled in at 0.4 m/s; a cam with its follower; an arm beside them.
constexpr const char* kHauled = R"yaml(
cardan: 1
bodies:
  mass: {mass: 2 kg, inertia: [1, 1, 1], hinge: {type: translational, to: world, initial: {x: 1 m, vy: 1.5 m/s}}}
  cam: {mass: 1 kg, inertia: [1, 1, 1.5], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {rate: 1 rad/s}}}
  follower: {mass: 1 kg, inertia: [1, 1, 1], hinge: {type: prismatic, axis: [0, 0, 1], to: world}}
  arm: {mass: 1 kg, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {rate: 1 rad/s}}}
loops:
  string: {type: distance, from: world, to: mass, length: 1 m, prescribed: true}
  lift: {type: coupling, offset: 0.1, terms: {follower: 1}, functions: [{of: {cam: 2}, sine: -0.1}]}
)yaml";

// r = 1 - 0.4 t, r^2 theta' = 1.5; the string pulls with m (theta'^2 r - r'') = 4.5 / r^3, whatever else of the vehicle changes.
TEST(LoopsOfAMission, TellWhatTheyAreAndDoAlsoBeyondAChangeOfTheVehicle) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", kHauled);
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 1, integrator = { method = "dop853", relative = 1e-12 } }
local string, lift, cam, seen = sat:loop "string", sat:loop "lift", sat:hinge "cam", 0
string:profile { hold = "-0.4 m/s" }
local function near(what, got, want) assert(math.abs(got - want) < 1e-8, what .. ": " .. got .. " and " .. want) end
phase { name = "loose", duration = 0.55, exit_ = function() sat:lock "arm" end }
phase { name = "locked", duration = 0.45 }
controller { name = "look", rate = "5 Hz", step = function(t)
  local r, rate = string:length()
  near("length", r, 1 - 0.4 * t)
  near("rate", rate, -0.4)
  near("pull", string:multiplier(), -4.5 / r ^ 3)
  local offset = lift:offset()
  near("offset", offset, 0.1)
  near("follower", sat:hinge("follower"):q(), 0.1 + 0.1 * math.sin(2 * cam:angle()))
  local _, _, _, fx, fy = string:reaction()
  near("reaction", (fx * fx + fy * fy) ^ 0.5, 4.5 / r ^ 3)
  seen = seen + 1
end }
check { name = "looks", value = function() return seen end, within = { 5, 7 } }
)lua");
  const Finished f = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(f.exit_code, 0) << f.out << f.err;
}

// A gear of two to one: what would open it is refused and leaves the state alone, rates that are not given follow.
TEST(LoopsAtTheWorkbench, StayClosedWhateverStateIsSet) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  motor: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {rate: 2}}}
  drum: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world}}
  lever: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world}}
loops:
  gear: {type: coupling, terms: {motor: 1, drum: -2}}
)yaml");
  write(dir / "look.lua", R"lua(
local function refused(given, what)
  local before, ok, why = sim:state(), pcall(sim.state, sim, given)
  assert(not ok and tostring(why):find("C1103", 1, true) and tostring(why):find(what, 1, true), tostring(why))
  local after = sim:state()
  assert(after.q == before.q and after.v == before.v)
end
refused({ q = { 0.1, 0, 0 } }, "sim:state.q")
refused({ v = { 1, 1, 0 } }, "sim:state.v")
sim:state { q = { 0.4, 0.2, 3 } }
local v = sim:v()
assert(math.abs(v[1] - 2) < 1e-14 and math.abs(v[2] - 1) < 1e-14)
sim:state { v = { 4, 2, 7 } }
assert(sim:v()[3] == 7)
sim:state { q = { 0.4, 0.2, 5 } }
assert(sim:v()[3] == 7 and sim:q()[3] == 5)
)lua");
  const Finished f = run_program({"workbench", "vehicle.yaml", "--script", "look.lua"}, dir.path());
  EXPECT_EQ(f.exit_code, 0) << f.out << f.err;
}

// What the mission gives stays, the rest of a slider-crank follows, as if the vehicle gave it; a load that is made after it changes
// nothing.
TEST(LoopsOfAMission, AreClosedFromInitialValuesOfTheMission) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  crank: {mass: 2, inertia: [1, 1, 1], nodes: {pin: {position: [0.2, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: world}}
  rod: {mass: 1, inertia: [1, 1, 1], nodes: {end: {position: [0.7, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: crank.pin}}
  block: {mass: 3, inertia: [1, 1, 1], hinge: {type: prismatic, axis: [1, 0, 0], to: world}}
loops:
  pin: {type: revolute, axis: [0, 0, 1], from: rod.end, to: block}
)yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 0.1 }
initial { crank = { angle = "50 deg" } }
initial { crank = { rate = -1.5 } }
sat:node("rod.end"):load {}
local function near(what, got, want) assert(math.abs(got - want) < 1e-12, what .. ": " .. got .. " and " .. want) end
local a = math.rad(50)
local b = -math.asin(0.2 * math.sin(a) / 0.7)                     -- of the rod against the ground
local db = -0.2 * math.cos(a) * -1.5 / (0.7 * math.cos(b))
near("rod", sat:hinge("rod"):angle(), b - a)
near("its rate", sat:hinge("rod"):rate(), db + 1.5)
near("block", sat:hinge("block"):q(), 0.2 * math.cos(a) + 0.7 * math.cos(b))
near("its rate", sat:hinge("block"):rate(), 0.2 * math.sin(a) * 1.5 - 0.7 * math.sin(b) * db)
near("crank", sat:hinge("crank"):angle(), a)
)lua");
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  const Finished told = run_program({"describe", ".", "--json"}, dir.path());
  ASSERT_EQ(told.exit_code, 0) << told.err;
  std::vector<std::string> moved;
  const nlohmann::json description = nlohmann::json::parse(told.out);
  for (const auto& x : description["loops"]["moved"]) moved.push_back(x["name"]);
  EXPECT_EQ(moved, (std::vector<std::string>{"rod.angle", "rod.rate", "block.displacement", "block.rate"}));
}

// Two bodies that fly through the origin of the world are caught there, by what rounding leaves of the way: each goes on about the pin as
// momentum about it says, m v d / (J + m d^2), and one without inertia stands.
TEST(LoopsOfAMission, CatchAtTheOriginOfTheWorld) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  body: {mass: 2, com: [0, 0.05, 0], inertia: [1, 1, 0.1], hinge: {type: free, to: world, initial: {position: [-1, 0, 0], velocity: [0.7, 0, 0]}}}
  grain: {type: particle, mass: 2, hinge: {type: translational, to: world, initial: {position: [-1, 0, 0], velocity: [0.3, 0, 0]}}}
loops:
  pin: {type: point, from: world, to: body, open: true}
  trap: {type: point, from: world, to: grain, open: true}
)yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = "4 s" }
for loop, name in pairs { pin = "body", trap = "grain" } do
  local hinge = sat:hinge(name)
  event { name = loop, once = true, direction = "rising", when = function() return (hinge:q("x")) end, action = function() sat:close(loop) end }
end
check { name = "turns", unit = "rad/s", value = function() return sat:hinge("body"):v("wz") end,
        equal = { -2 * 0.7 * 0.05 / (0.1 + 2 * 0.05 ^ 2), tolerance = 1e-9 } }
check { name = "stands", unit = "m/s", below = 1e-12, value = function() return math.abs(sat:hinge("grain"):v("vx")) end }
)lua");
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

// A jack of one length beside a slide that is given to move: what is told is by how much they contradict each other, and no number that is
// none.
TEST(LoopsOfAMission, AreToldByHowMuchGivenMotionsContradictEachOther) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  bus: {mass: 10, inertia: [3, 4, 5], nodes: {a: {position: [0, 1, 0]}}, hinge: {type: free, to: world}}
  slider: {mass: 2, inertia: [1, 1, 1], hinge: {type: prismatic, axis: [1, 0, 0], to: bus, prescribed: true}}
loops:
  jack: {type: distance, from: bus.a, to: slider, length: 1, prescribed: true}
)yaml");
  write(dir / "scenario.lua", R"lua(
local v = vehicle "vehicle.yaml"
mission { duration = "2 s" }
v:hinge("slider"):profile { sine = { amplitude = 0.1, frequency = 0.5, phase = math.pi / 2 } }
v:loop("jack"):profile { hold = 1 }
)lua");
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 3) << run.out;
  EXPECT_NE(run.err.find("failure[N0601]: a loop cannot be kept closed\n"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("  row 1 of loop jack: residual 0.0001, "), std::string::npos) << run.err;
}

// Crank and block are given such that no rod joins them: a vehicle that is refused, but for a mission that says where the block is.
TEST(LoopsOfAMission, MayCloseAVehicleWhoseOwnStartDoesNot) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  crank: {mass: 2, inertia: [1, 1, 1], nodes: {pin: {position: [0.2, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {angle: 1, rate: 1.5}}}
  rod: {mass: 1, inertia: [1, 1, 1], nodes: {end: {position: [0.7, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: crank.pin}}
  block: {mass: 3, inertia: [1, 1, 1], hinge: {type: prismatic, axis: [1, 0, 0], to: world, initial: {displacement: 5}}}
loops:
  pin: {type: line, from: rod.end, to: block}
  jack: {type: distance, from: {body: world, position: [0, -1, 0]}, to: block, length: 2, prescribed: true, open: true}
)yaml");
  const std::string begin = "local sat = vehicle 'vehicle.yaml' mission { duration = 0.1, checkpoint = { period = '0.05 s' } }\n";
  const auto ends = [&](const std::string& script, std::vector<std::string> command) {
    write(dir / "scenario.lua", begin + script);
    return run_program(command, dir.path());
  };
  for (const std::string before :
       {"", "sat:node('rod.end'):load {}", "sat:hinge('crank'):torque(0)", "sim:linearize {}", "initial { crank = { rate = 1 } }"}) {
    const Finished f = ends(before, {"check", "."});
    EXPECT_EQ(f.exit_code, 2) << before;
    EXPECT_NE(f.err.find("C1103"), std::string::npos) << f.err;
  }
  const std::string rescue = R"lua(
sat:node("rod.end"):load {}
local a = 1
local x = 0.2 * math.cos(a) + math.sqrt(0.49 - (0.2 * math.sin(a)) ^ 2)
initial { block = { displacement = x } }
sat:node("crank.pin"):load {}
local function near(what, got, want) assert(math.abs(got - want) < 1e-12, what .. ": " .. got .. " and " .. want) end
near("crank", sat:hinge("crank"):angle(), a)
near("its rate", sat:hinge("crank"):rate(), 1.5)
near("block", sat:hinge("block"):q(), x)
near("rod", sat:hinge("rod"):angle(), -a - math.asin(0.2 * math.sin(a) / 0.7))
assert(math.abs(sat:hinge("block"):rate()) > 0.1)
phase { name = "light", duration = 0.05, exit_ = function() sat:change { ["bodies.block.mass"] = "2 kg" } end }
check { name = "closed", unit = "m", below = 1e-12, value = function() return sat:node("rod.end"):position() - sat:hinge("block"):q() end }
)lua";
  const Finished run = ends(rescue, {"run", ".", "--quiet", "--out", "out"});
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  const Finished again = run_program({"run", "--again", "out/run.h5", "--quiet", "--out", "again"}, dir.path());
  EXPECT_EQ(again.exit_code, 0) << again.err;
  const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--quiet", "--out", "on"}, dir.path());
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
}

// Of a hinge that is given in part the rest is what the vehicle says, not where the assembler put it for the vehicle's own start.
TEST(LoopsOfAMission, KeepWhatTheVehicleSaysOfAHingeThatIsGivenInPart) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  puck: {mass: 2, inertia: [1, 1, 1], hinge: {type: planar, axes: [[1, 0, 0], [0, 1, 0]], to: world}}
loops:
  string: {type: distance, from: {body: world, position: [-1, 0, 0]}, to: puck, length: 2}
)yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 0.1 }
assert(math.abs(sat:hinge("puck"):q("x") - 1) < 1e-12)
initial { puck = { y = math.sqrt(3) } }
assert(math.abs(sat:hinge("puck"):q("x")) < 1e-12 and math.abs(sat:hinge("puck"):q("y") - math.sqrt(3)) < 1e-12)
)lua");
  const Finished f = run_program({"check", "."}, dir.path());
  EXPECT_EQ(f.exit_code, 0) << f.out << f.err;
}

// One report of the three solutions, with flexible bodies, wheels and redundant rows among the vehicles.
TEST(LoopsOfAMission, AreSolvedInThreeWaysThatDescribeCompares) {
  for (const char* scenario : {"04_capture_and_berth", "05_wing_deployment", "06_six_strut_platform", "07_rocker_bogie"}) {
    const Finished f = run_program({"describe", CARDAN_SOURCE_DIR "/scenarios/" + std::string(scenario), "--forms", "--json"}, ".");
    ASSERT_EQ(f.exit_code, 0) << f.err;
    const nlohmann::json loops = nlohmann::json::parse(f.out)["loops"];
    if (loops["all"].empty()) continue;  // closed by the mission
    ASSERT_EQ(loops["forms"]["all"].size(), 3U);
    for (const auto& form : loops["forms"]["all"]) {
      ASSERT_FALSE(form.contains("refused")) << scenario << form;
      for (const char* what : {"vdot", "multipliers", "reactions"}) EXPECT_LE(form[what].get<double>(), 1e-10) << scenario << form;
    }
  }
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", kHauled);
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml'\nmission { duration = 1 }\n");
  const Finished text = run_program({"describe", ".", "--forms"}, dir.path());
  EXPECT_NE(text.out.find("differences at this state: v' from that of the dense twin"), std::string::npos) << text.out << text.err;
}

/// Runs a mission that asks `value` at its end, and what it printed.
double run_with(const std::string& vehicle, const char* duration, const char* value, std::string& err) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", vehicle);
  write(dir / "scenario.lua",
        fmt::format(
            "local sat = vehicle 'vehicle.yaml'\nmission {{ duration = {}, integrator = {{ method = 'dop853', relative = 1e-11 }} }}\n"
            "check {{ name = 'value', value = function() return {} end, unit = 'rad', above = -100 }}\n",
            duration, value));
  const Finished checked = run_program({"check", "."}, dir.path()), done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(done.exit_code, 0) << done.err;
  EXPECT_EQ(checked.exit_code, 0) << checked.err;
  EXPECT_EQ(checked.err.find("W0302") == std::string::npos, done.err.find("W0302") == std::string::npos) << checked.err << done.err;
  err = checked.err + done.err;
  return done.exit_code == 0 ? nlohmann::json::parse(file_text(dir / "out/summary.json"))["checks"][0]["value"].get<double>() : 0.0;
}

/// A second component that stands still changes nothing: of a hinge whose components are all prescribed the profiles are the rates of the
/// start, of one as of two.
TEST(LoopsOfAMission, BeginWithTheRatesOfGivenMotionsOfSeveralComponents) {
  const auto start = [](const std::string& hinge, const std::string& second) {
    const TemporaryFolder dir;
    write(dir / "vehicle.yaml", R"(cardan: 1
bodies:
  boom: {mass: 10, inertia: [1, 1, 1], nodes: {eye: {position: [2, 0, 0.3]}}, hinge: {)" +
                                    hinge + R"(, to: world, prescribed: true}}
  load: {mass: 10, inertia: [1, 1, 1], nodes: {eye: {position: [0, 0, 0.5]}}, hinge: {type: translational, to: world, initial: {position: [2, 0, -3.2]}}}
  ball: {mass: 1, com: [0, 0, -1], inertia: [0.1, 0.1, 0.1], hinge: {type: revolute, to: load, axis: [0, 1, 0], initial: {angle: 0.3}}}
loops:
  rope: {type: distance, from: boom.eye, to: load.eye, length: 3, prescribed: true}
)");
    write(dir / "scenario.lua", "local s = vehicle 'vehicle.yaml'\nmission { duration = 1e-9 }\ns:hinge('boom'):profile { hold = 0.2 }\n" +
                                    second +
                                    "s:loop('rope'):profile { hold = -0.1 }\nlocal seen = {}\n"
                                    "controller { name = 'look', rate = '1 Hz', step = function() seen = { s:hinge('load'):v('vx'), "
                                    "s:hinge('load'):v('vz'), s:hinge('ball'):rate() } end }\n"
                                    "for i = 1, 3 do figure { name = tostring(i), value = function() return seen[i] end } end\n");
    const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.err, "");
    const auto summary = nlohmann::json::parse(file_text(dir / "out/summary.json"));
    std::vector<double> out;
    for (const auto& f : summary["figures"]) out.push_back(f["value"]);
    return out;
  };
  const std::vector<double> one = start("type: revolute, axis: [0, 1, 0]", ""),
                            two = start("type: universal, axes: [[0, 1, 0], [1, 0, 0]]",
                                        "s:hinge('boom'):profile { component = 2, hold = 0 }\n");
  ASSERT_EQ(one.size(), 3u);
  ASSERT_EQ(two.size(), 3u);
  EXPECT_NEAR(one[1], -0.3, 1e-14) << "the eye goes down at 0.4 m/s, and the rope in at 0.1 m/s";
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(one[i], two[i], 1e-14) << i;
}

/// Of a vehicle file every key may be given by the script, as by --set: `loop_form` and `assembly` as what is below `bodies`.
TEST(LoopsOfAMission, AreClosedAsTheScriptAsks) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"(cardan: 1
bodies:
  crank: {mass: 1, inertia: [1, 1, 1], nodes: {pin: {position: [0.2, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {angle: 1.0}}}
  coupler: {mass: 1, inertia: [1, 1, 1], nodes: {pin: {position: [0.45, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: crank.pin}}
  rocker: {mass: 1, inertia: [1, 1, 1], nodes: {pin: {position: [0.4, 0, 0]}}, hinge: {type: revolute, axis: [0, 0, 1], to: {body: world, position: [0.5, 0, 0]}, initial: {angle: 1.5861694896029515}}}
loops:
  close: {type: revolute, from: coupler.pin, to: rocker.pin, axis: [0, 0, 1]}
)");
  const auto described = [&](const std::string& values) {
    write(dir / "scenario.lua", "vehicle('vehicle.yaml', " + values + ") mission { duration = 1 }");
    const Finished run = run_program({"describe", ".", "--json"}, dir.path());
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return nlohmann::json::parse(run.out);
  };
  for (const char* form : {"multipliers", "embedding"})
    EXPECT_EQ(described(fmt::format("{{ loop_form = '{}' }}", form))["loops"]["form"], form);
  EXPECT_EQ(described("{ ['vehicle.loop_form'] = 'multipliers' }")["loops"]["form"], "multipliers") << "as --set names it";
  EXPECT_EQ(described("{ name = \"a crank's own\", ['gravity.uniform'] = { 0, '-9.81 m/s^2', 0 } }")["vehicle"], "a crank's own");
  // Which hinge stays: the other one of the two is moved.
  for (const auto& [held, moved] : {std::pair("crank", "rocker"), std::pair("rocker", "crank")}) {
    const auto moves =
        described(fmt::format("{{ ['assembly.hold'] = {{ '{}' }}, ['bodies.crank.hinge.initial.angle'] = 1.02 }}", held))["loops"]["moved"];
    EXPECT_EQ(std::ranges::count_if(moves, [&](const auto& m) { return m["name"] == std::string(moved) + ".angle"; }), 1) << moves;
    EXPECT_EQ(std::ranges::count_if(moves, [&](const auto& m) { return m["name"] == std::string(held) + ".angle"; }), 0) << moves;
  }
  write(dir / "scenario.lua", "vehicle('vehicle.yaml', { loop_frm = 'embedding' }) mission { duration = 1 }");
  const Finished wrong = run_program({"check", "."}, dir.path());
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_TRUE(has(wrong.err, "error[C0104]") && has(wrong.err, "scenario.lua:1") && has(wrong.err, "loop_form")) << wrong.err;
  // Each text of an array is one entry, whatever is in it.
  for (const auto& [entries, got] : {std::pair("'0, 0', 1", "a list of 2 values"), std::pair("\"0'\", 0, 1", "\"0'\"")}) {
    write(dir / "scenario.lua",
          fmt::format("vehicle('vehicle.yaml', {{ ['gravity.uniform'] = {{ {} }} }}) mission {{ duration = 1 }}", entries));
    const Finished split = run_program({"check", "."}, dir.path());
    EXPECT_EQ(split.exit_code, 2) << entries;
    EXPECT_TRUE(has(split.err, fmt::format("got:      {}", got))) << split.err;
  }
}

/// Closed as it is given, for all digits of the axis of its rocker: a form, and the last number of that axis.
constexpr double kAxis = 0.8931005991147437;
constexpr const char* kAskewFourBar = R"yaml(
cardan: 1
loop_form: {}
gravity: {{uniform: [1, -2, -9]}}
bodies:
  crank: {{mass: 1, com: [-0.0932548484890117, 0.0360716828780630, -0.0015384822507710], inertia: [0.004, 0.004, 0.004], nodes: {{pin: {{position: [-0.1699713469662966, 0.1113001951933768, -0.0874644123033253]}}}}, hinge: {{type: revolute, to: world, axis: [-0.1750308924916958, -0.4144098291962274, 0.8931005991147437], initial: {{angle: 0, rate: 2.0}}}}}}
  coupler: {{mass: 1.5, com: [-0.1565907639566137, 0.1560846178037298, 0.0417363717702876], inertia: [0.03, 0.03, 0.03], nodes: {{pin: {{position: [-0.3385944030588934, 0.2520007413572225, 0.2131427331905407]}}}}, hinge: {{type: revolute, to: crank.pin, axis: [-0.1750308924916958, -0.4144098291962274, 0.8931005991147437], initial: {{angle: 0}}}}}}
  rocker: {{mass: 1.2, com: [-0.1903111822410608, -0.0323410143920956, -0.0523040409729499], inertia: [0.02, 0.02, 0.02], nodes: {{pin: {{position: [-0.3881616379849888, -0.0825323008139415, -0.0661387032753894]}}}}, hinge: {{type: revolute, to: {{body: world, position: [-0.1204041120402012, 0.4458332373645409, 0.1918170241626048]}}, axis: [-0.1750308924916958, -0.4144098291962274, {:.17g}], initial: {{angle: 0}}}}}}
loops:
  close: {{type: revolute, from: coupler.pin, to: rocker.pin, axis: [-0.1750308924916958, -0.4144098291962274, 0.8931005991147437]}}
)yaml";

// Places, lengths and axes are typed with so many digits. Rows that others imply then stay open by the rest, told before the run, and all
// else moves as with exact numbers: three parallel legs, of which no posture but those in line closes the third; a four-bar whose far pin
// is out of its plane; a door whose second hinge is beside the line of the first; a four-bar that stands askew, closed, of whose axes one
// is turned by so little (rows that others imply but for that held it altogether).
TEST(LoopsOfAMission, LeaveRowsOpenThatOthersImplyByWhatNumbersWereTypedWith) {
  struct Scene {
    const char *vehicle, *duration, *value;
    double exact;  // the number in it
    const char* told;
    double off = 5e-7;
  };
  const Scene scenes[] = {
      {R"yaml(
cardan: 1
loop_form: {}
gravity: {{uniform: [0.4, -9, 0]}}
bodies:
  base: {{mass: 30, inertia: [1, 1, 1], hinge: {{type: locked, to: world}}}}
  leg_1: {{mass: 1, com: [0, 0.2, 0], inertia: [0.01, 0.01, 0.01], nodes: {{t: {{position: [0, 0.5, 0]}}}}, hinge: {{type: revolute, axis: [0, 0, 1], to: base, initial: {{angle: 0.3, rate: 0.5}}}}}}
  leg_2: {{mass: 1, com: [0, 0.2, 0], inertia: [0.01, 0.01, 0.01], nodes: {{t: {{position: [0, 0.5, 0]}}}}, hinge: {{type: revolute, axis: [0, 0, 1], to: {{body: base, position: [0.5, 0, 0]}}, initial: {{angle: 0.3, rate: 0.5}}}}}}
  leg_3: {{mass: 1, com: [0, 0.2, 0], inertia: [0.01, 0.01, 0.01], nodes: {{t: {{position: [0, 0.5, 0]}}}}, hinge: {{type: revolute, axis: [0, 0, 1], to: {{body: base, position: [1, 0, 0]}}, initial: {{angle: 0.3, rate: 0.5}}}}}}
  plate: {{mass: 1, com: [0.5, 0.1, 0], inertia: [0.05, 0.05, 0.05], hinge: {{type: revolute, axis: [0, 0, 1], to: leg_1.t, initial: {{angle: -0.3, rate: -0.5}}}}}}
loops:
  second: {{type: point, from: leg_2.t, to: {{body: plate, position: [0.5, 0, 0]}}}}
  third: {{type: point, from: leg_3.t, to: {{body: plate, position: [{:.17g}, 0, 0]}}}}
)yaml",
       "0.4", "sat:hinge('leg_1'):angle()", 1.0, "row 2, along y is open by"},
      {R"yaml(
cardan: 1
loop_form: {}
bodies:
  crank: {{mass: 1, com: [0.1, 0, 0], inertia: [0.001, 0.004, 0.004], nodes: {{pin: {{position: [0.2, 0, 0]}}}}, hinge: {{type: revolute, to: world, axis: [0, 0, 1], initial: {{angle: 1.0, rate: 2.0}}}}}}
  coupler: {{mass: 1.5, com: [0.225, 0, 0], inertia: [0.001, 0.03, 0.03], nodes: {{pin: {{position: [0.45, 0, 0]}}}}, hinge: {{type: revolute, to: crank.pin, axis: [0, 0, 1], initial: {{angle: -0.45922944670301813}}}}}}
  rocker: {{mass: 1.2, com: [0.2, 0, 0], inertia: [0.001, 0.02, 0.02], nodes: {{pin: {{position: [0.4, 0, 0]}}}}, hinge: {{type: revolute, to: {{body: world, position: [0.5, 0, {:.17g}]}}, axis: [0, 0, 1], initial: {{angle: 1.5861694896029515}}}}}}
loops:
  close: {{type: revolute, from: coupler.pin, to: rocker.pin, axis: [0, 0, 1]}}
)yaml",
       "3", "sat:hinge('crank'):angle()", 0.0, "close: row 5, along z is open by"},
      {R"yaml(
cardan: 1
loop_form: {}
bodies:
  door: {{mass: 10, com: [0.4, 0, 1], inertia: [3, 4, 1.5], nodes: {{top: {{position: [{:.17g}, 0, 1.8]}}}}, hinge: {{type: revolute, to: world, axis: [0, 0, 1], initial: {{angle: 30 deg, rate: 1.0}}}}}}
loops:
  above: {{type: revolute, from: {{body: world, position: [0, 0, 1.8]}}, to: door.top, axis: [0, 0, 1]}}
)yaml",
       "3", "sat:hinge('door'):angle()", 0.0, "above: row 3, along x is open by"},
      {kAskewFourBar, "3", "sat:hinge('crank'):angle()", kAxis, "close: row 2, rotation about y holds by a scaled pivot of", 1e-7},
  };
  for (const Scene& scene : scenes) {
    std::string err;
    const auto run = [&](const char* form, double off) {
      return run_with(fmt::format(fmt::runtime(scene.vehicle), form, scene.exact + off), scene.duration, scene.value, err);
    };
    const double exact = run("auto", 0.0);
    EXPECT_EQ(err, "");
    for (const auto& [form, off] : {std::pair("auto", 1e-9), std::pair("auto", scene.off), std::pair("embedding", scene.off),
                                    std::pair("multipliers", scene.off), std::pair("dae", scene.off)}) {
      EXPECT_NEAR(run(form, off), exact, 10.0 * off) << form << "\n" << scene.vehicle;
      EXPECT_NE(err.find(scene.told), std::string::npos) << form << "\n" << err;
      EXPECT_EQ(err.find("W0402"), std::string::npos) << form << "\n" << err;
    }
  }
}

// What chooses rows by itself refuses such a vehicle before the run and leaves the results alone; an axis that is off by more is told from
// nothing that holds on purpose, and the warning says what it may be.
TEST(LoopsOfAMission, WhoseRowsAreLeftOpenAreRefusedByTheTwinAndHoldWhereTheyAreOffByMore) {
  const TemporaryFolder dir;
  write(dir / "scenario.lua", "vehicle 'vehicle.yaml'\nmission { duration = 0.1 }\n");
  write(dir / "vehicle.yaml", fmt::format(kAskewFourBar, "auto", kAxis + 1e-7));
  EXPECT_EQ(run_program({"run", ".", "--quiet", "--out", "out"}, dir.path()).exit_code, 0);
  const std::string before = file_text(dir / "out/summary.json");
  const Finished refused = run_program({"run", ".", "--quiet", "--out", "out", "--check-against-reference"}, dir.path());
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  for (const char* part : {"C0401", "vehicle.yaml:9", "loops that close but for rounding", "more digits of lengths, places and axes"})
    EXPECT_NE(refused.err.find(part), std::string::npos) << part << "\n" << refused.err;
  EXPECT_EQ(file_text(dir / "out/summary.json"), before);
  const std::string off = fmt::format(kAskewFourBar, "auto", kAxis + 3e-3);
  write(dir / "vehicle.yaml", off);
  const Finished told = run_program({"check", "."}, dir.path());
  EXPECT_EQ(told.exit_code, 2) << told.err;
  EXPECT_NE(told.err.find("where other rows should imply these, places or axes are off by more than 1e-4 of the loop"), std::string::npos)
      << told.err;
  write(dir / "vehicle.yaml", std::string(off).replace(off.find("rate: 2.0"), 9, "rate: 0.0"));
  const Finished held = run_program({"run", ".", "--out", "out"}, dir.path());
  EXPECT_EQ(held.exit_code, 0) << held.err;
  for (const char* part : {"W0308", "if other rows should imply it, more digits of places and axes"})
    EXPECT_NE(held.err.find(part), std::string::npos) << part << "\n" << held.err;
}

/// A mechanism as programs for drawings have it: bodies in the axes of the world as it stands there, hinges at points and about axes, all
/// printed with so many decimals; askew and away from the origin, so that no number is short.
struct Drawn {
  struct Part {
    const char *name, *on;
    Eigen::Vector3d point, axis;
  };
  std::vector<Part> parts;
  struct Join {
    const char *name, *from, *to;
    Eigen::Vector3d point, axis;
  };
  std::vector<Join> joins;

  std::string printed(int decimals, bool given) const {
    const Eigen::Matrix3d R = Eigen::Quaterniond(0.7, 0.3, -0.5, 0.4).normalized().toRotationMatrix();
    const auto text = [&](const Eigen::Vector3d& x) {
      return fmt::format("[{:.{}f}, {:.{}f}, {:.{}f}]", x.x(), decimals, x.y(), decimals, x.z(), decimals);
    };
    const auto place = [&](const Eigen::Vector3d& x) -> Eigen::Vector3d { return R * x + Eigen::Vector3d(0.13, -0.21, 0.17); };
    const auto is_world = [](const char* name) { return std::string_view(name) == "world"; };
    const auto node = [&](const char* body, const Eigen::Vector3d& point) {
      if (is_world(body)) return fmt::format("{{body: world, position: {}}}", text(place(point)));
      const Part& part = *std::ranges::find_if(parts, [&](const Part& p) { return std::string_view(p.name) == body; });
      return fmt::format("{{body: {}, position: {}}}", body, text(R * (point - part.point)));
    };
    std::string out = "cardan: 1\ngravity: {uniform: [1, -2, -9]}\nbodies:\n";
    double mass = 0.9;
    for (const Part& p : parts) {
      const bool driven = &p == parts.data();
      out += fmt::format("  {}: {{mass: {}, com: {}, inertia: [0.02, 0.021, 0.019], hinge: {{type: revolute, to: {}, axis: {}{}}}}}\n",
                         p.name, mass, text(R * Eigen::Vector3d(0.06, 0.05 * mass, -0.04)), node(p.on, p.point), text(R * p.axis),
                         given    ? (driven ? ", initial: {angle: 0, rate: 1}" : ", initial: {angle: 0}")
                         : driven ? ", initial: {rate: 1}"
                                  : "");
      mass += 0.35;
    }
    out += "loops:\n";
    for (const Join& j : joins)
      out += fmt::format("  {}: {{type: revolute, from: {}, to: {}, axis: {}}}\n", j.name, node(j.from, j.point), node(j.to, j.point),
                         text(R * j.axis));
    return out;
  }
};

/// Where the fourth pin of a four-bar is: b from P, c from D.
Eigen::Vector2d fourth(const Eigen::Vector2d& P, const Eigen::Vector2d& D, double b, double c) {
  const Eigen::Vector2d way = D - P;
  const double l = way.norm(), along = (b * b - c * c + l * l) / (2.0 * l);
  return P + along / l * way + std::sqrt(b * b - along * along) / l * Eigen::Vector2d(-way.y(), way.x());
}

// Drawings with micrometres, and with hundredths of millimetres: a four-bar, a door on three hinges, a plate on three parallel legs, axes
// through one point, each with more rows than hold it. What moves is that of all digits within some of the last; with `initial` of all
// hinges, which leaves loops open by as much, and without.
TEST(LoopsOfAMission, AsDrawingsHaveThemMoveAsWithAllDigits) {
  const Eigen::Vector3d z(0, 0, 1);
  const Eigen::Vector2d P(0.2 * std::cos(1.0), 0.2 * std::sin(1.0)), E = fourth(P, {0.5, 0}, 0.45, 0.4), leg(0.0887, 0.2866);
  const auto at = [](const Eigen::Vector2d& p, double height) { return Eigen::Vector3d(p.x(), p.y(), height); };
  const Eigen::Vector3d a(0, 0, 1), b = Eigen::Vector3d(0.5, 0.1, 1).normalized(), c = Eigen::Vector3d(0.7, 0.8, 0.9).normalized(),
                                    d = Eigen::Vector3d(-0.2, 0.9, 1).normalized();
  const Drawn drawn[] = {
      {{{"crank", "world", {0, 0, 0.03}, z}, {"coupler", "crank", at(P, -0.07), z}, {"rocker", "world", {0.5, 0, 0.05}, z}},
       {{"close", "coupler", "rocker", at(E, 0.02), z}}},
      {{{"crank", "world", {0, 0, 0}, z}}, {{"middle", "world", "crank", {0, 0, 0.9}, z}, {"above", "world", "crank", {0, 0, 1.8}, z}}},
      {{{"crank", "world", {0, 0, 0.03}, z},
        {"second", "world", {0.5, 0, -0.02}, z},
        {"third", "world", {1.1, 0.5, 0.04}, z},
        {"plate", "crank", at(leg, 0.01), z}},
       {{"two", "second", "plate", at(leg + Eigen::Vector2d(0.5, 0), 0.06), z},
        {"three", "third", "plate", at(leg + Eigen::Vector2d(1.1, 0.5), -0.03), z}}},
      {{{"crank", "world", 0.3 * a, a}, {"first", "crank", 0.35 * b, b}, {"next", "first", 0.3 * c, c}},
       {{"close", "next", "world", 0.4 * d, d}}},
  };
  for (const Drawn& mechanism : drawn) {
    // The legs go on to where two are nearly in line: which row counts there would matter, were rows not reconciled.
    const bool legs = mechanism.parts.size() == 4;
    std::string err;
    const auto run = [&](int decimals, bool given) {
      return run_with(mechanism.printed(decimals, given), legs ? "2" : "0.4", "sat:hinge('crank'):angle()", err);
    };
    const double exact = run(15, true);
    EXPECT_EQ(err, "");
    for (const int decimals : {10, 8, 7, 6, 5})
      for (const bool given : {true, false}) {
        const double digit = std::pow(10.0, -decimals);
        EXPECT_NEAR(run(decimals, given), exact, (legs ? 100.0 : 20.0) * digit) << decimals << "\n" << mechanism.printed(decimals, given);
        EXPECT_NE(err.find("W0302"), std::string::npos) << err;
        EXPECT_EQ(err.find("W0308"), std::string::npos) << err;
      }
  }
}

// A row that only what is heavy could break, beside one of what is light by ten decades, is a row.
TEST(LoopsOfAMission, HoldWhatIsHeavyBesideWhatIsLight) {
  std::string err;
  EXPECT_NEAR(run_with(R"yaml(
cardan: 1
gravity: {uniform: [3, -9, 0]}
bodies:
  heavy: {mass: 100, inertia: [1, 1, 1], hinge: {type: prismatic, axis: [0, 1, 0], to: world}}
  light: {mass: 1e-8, inertia: [1e-9, 1e-9, 1e-9], hinge: {type: prismatic, axis: [1, 0, 0], to: heavy}}
loops:
  close: {type: point, from: light, to: world}
)yaml",
                       "0.5", "sat:hinge('heavy'):rate()", err),
              0.0, 1e-12);
}

}  // namespace
}  // namespace cardan
