// Spatial operators in scripts: as on paper, with names and units; what is refused; the same in a mission.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

Finished slew_script(const std::string& text, const std::string& scene = kSlew) {
  const TemporaryFolder dir;
  std::ofstream(dir / "look.lua") << text;
  return run_program({"workbench", scene, "--script", "look.lua"}, dir.path());
}

TEST(OperatorsInScripts, ComposeAsOnPaper) {
  const Finished run = slew_script(R"(
local s = sim:operators()
local n = s:size("hinge")
local vdot = vector({}) ; local numbers = {}
for i = 1, n do numbers[i] = math.sin(i) end
vdot = vector(numbers)
local tau = s.H * s.phi * s.M * s.phi:star() * s.H:star() * vdot
assert((s.mass * vdot - tau):max_abs() < 1e-12 * tau:max_abs())
local back = s.mass:inv() * tau
assert((back - vdot):max_abs() < 1e-11)
local A, B = s.mass:dense(), ((s.I + s.H * s.phi * s.K) * s.D * (s.I + s.H * s.phi * s.K):star()):dense()
assert((A - B):max_abs() < 1e-12 * A:max_abs())
assert(math.abs(s.mass:norm() - A:norm()) < 1e-12 * A:norm())
assert(math.abs(s.mass:eig(2)[1] - A:norm()) < 1e-12 * A:norm())
local J = s:nodes("wing_left.tip", "bus")
assert((s.jacobian:rows()) == s:size("node") and J:cols() == 12)
local L = (J:star() * s.omega * J):dense()          -- J M^-1 J*
local Jd = (J:star() * s.phi:star() * s.H:star()):dense()
local M1 = (s.mass:inv()):dense()
assert((L - Jd * (M1 * Jd:t())):max_abs() < 1e-10 * L:max_abs())
-- the momentum of a motion has the units of one
local p = s.mass * sim:v()
assert(p:labels().units[1] == "N m s" and tau:labels().units[1] == "N m" and tau:labels().names[7] == "wing_left.rate")
assert((s.mass:inv() * tau):labels().units[4] == "m/s^2")
-- sensitivities: d(mass)/d(angle) against a difference
s:along("wing_left.rate")
local d = s.mass_derivative:dense()
local state, h = sim:state(), 1e-3
local function mass_at(x)
  local q = sim:state().q
  q["wing_left.angle"] = q["wing_left.angle"] + x
  sim:state{q = q}
  local A = sim:operators("position").mass:dense()
  sim:state(state)
  return A
end
local difference = (8 * (mass_at(h) - mass_at(-h)) - (mass_at(2 * h) - mass_at(-2 * h))) * (1 / (12 * h))
assert((d - difference):max_abs() < 1e-9 * d:max_abs(), "derivative of the mass matrix")
local sub = s:subtree("wing_left")
assert(sub:size("hinge") == 11)
print(sub, s.mass:inv(), s.phi:star())
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.out,
            "operators of the subtree of wing_left: 1 bodies, hinge space 11, body space 16, 4 nodes\t"
            "(I - K* psi* H*) D^-1 (I - H psi K): hinge x hinge (32 x 32)\tphi*: body x body (62 x 62)\n");
}

TEST(OperatorsInScripts, RefuseWithTheLineOfTheScript) {
  const auto refused = [](const std::string& statement, const std::vector<std::string>& words) {
    const Finished run = slew_script("local s = sim:operators()\n" + statement);
    EXPECT_EQ(run.exit_code, 2) << statement << run.err;
    for (const std::string& word : words) EXPECT_NE(run.err.find(word), std::string::npos) << statement << "\n" << word << "\n" << run.err;
  };
  refused("local x = s.H + s.phi", {"C0902", "look.lua:2", "H + phi", "hinge x body (32 x 62)", "body x body (62 x 62)"});
  refused("local x = s.phi * s.H", {"C0902", "star() may be missing"});
  refused("local x = s.H:inv()", {"C0903"});
  refused("local x = s.Y:dense()", {"C0901", "OperationalSpace", "operational_space()"});
  refused("local x = sim:operators('position').psi:dense()", {"C0901", "Inertia"});
  refused("local x = s.mass * {1, 2}", {"C0902", "a vector of 32", "one of 2"});
  refused("local x = s.phii", {"C0208", "did you mean \"phi\"?"});
  refused("local x = s:subtree('wing')", {"C0201", "wing_left"});
  refused("local x = s:nodes('nowhere')", {"C0202"});
  refused("local x = s.M + sim:operators().M", {"C0902", "different times"});
  refused("s:along('wing_left.angel')", {"C0208", "did you mean \"wing_left.angle\"?"});
  std::string doubling = "local x = s.mass for i = 1, 40 do x = x + x end";  // 2^40 letters
  refused(doubling, {"C0902", "at most 4096 letters", "look.lua:2"});
  refused("local x = s.phi for i = 1, 40 do x = x * (x + x) end", {"C0902", "at most 4096 letters"});
  refused("s:hybrid{zeta = 1, alpha = 2}", {"C0104", "got:      \"alpha\""});  // of several faults the same one is told on every run
  refused("local v = sim:v(); v[1] = 0 / 0; local x = s.mass * v", {"N0108", "finite"});
  refused("local x = s:momentum({0 / 0})", {"C0502"});
  refused("local x = s:subgraph{}", {"C0502"});
  for (const char* k : {"-1", "-100000", "math.mininteger"})
    refused(std::string("local x = s.mass:eig(") + k + ")", {"C0301", "look.lua:2", "1 ... 32 of them", "got:      -"});
  for (const char* call : {"csv()", "csv{}", "csv(3)", "hdf5('a.h5')", "hdf5(nil, 'A')", "hdf5('a.h5', {})"})
    refused(std::string("sim:v():") + call, {"C0502", "look.lua:2", "expected: the name of a"});
  refused("local x = s.I:dense()", {"C0902", "I alone"});
  refused("s:articulate{W = vector(s.D:eig(s:size('hinge')):table())}; local x = s.mass:inv()", {"C0903", "without W"});
  refused("local x = sim:inverse_kinematics{targets = {{node = 'bus', attitude = {0, 0, 0, 0}}}}", {"C0502", "unit quaternion"});
  refused("local x = sim:system_modes{elastic = -1}", {"C0502"});
  refused("local x = sim:linearize{inputs = {'wheel_9.angle'}}", {"C0208"});
}

TEST(OperatorsInScripts, AComponentHasTheSameNamesEverywhere) {
  const Finished run = slew_script(R"(
local s = sim:operators()
local function same(a, b, what) assert(a == b or (a - b):max_abs() == 0, what) end
local function passive(...) return s:passive { ... }:coupling() end
same(passive "wheel_1.rate", passive "wheel_1.angle", "coordinate")
same(passive "wheel_1.rate", passive "wheel_1", "body of one component")
same(passive "bus", s:floating_base():coupling(), "all of a hinge")
same(passive("bus.turn_x", "bus.wy"), passive("bus.wx", "bus.turn_y"), "behind a quaternion")
local function wings(...) s:articulate { free = { ... } } local d = s.D:dense() s:articulate() return d end
same(wings("wing_left.eta"), wings("wing_left.eta_1", "wing_left.etadot_2", "wing_left.eta_3", "wing_left.eta_4", "wing_left.eta_5", "wing_left.eta_6", "wing_left.eta_7",
  "wing_left.eta_8", "wing_left.eta_9", "wing_left.eta_10"), "all modes")
local function plant(...) return sim:linearize { inputs = { ... } }.B end
same(plant "wheel_2.rate", plant "wheel_2.angle", "input")
same(plant "wheel_2", plant "wheel_2.angle", "input by body")
s:along "wheel_1.angle"
local along = s.mass_derivative:dense()
s:along "wheel_1"
same(s.mass_derivative:dense(), along, "along")
local left = sim:vehicle():hinge "wing_left"
assert(left:rate() == left:rate "angle" and left:angle "rate" == left:angle() and left:angle "wing_left.angle" == left:angle(1))
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(OperatorsInScripts, TaskSpaceControlHasItsDrift) {  // Jdot v against a difference of J v along the motion
  const Finished run = slew_script(R"(
local s, v = sim:operators(), sim:v()
local names = sim:q():labels().names
for i, name in ipairs(v:labels().names) do v[i] = name:find "rate$" and 0.1 * math.sin(3 * i) or 0 end  -- joints alone
local task = s:task { nodes = { "hand.tool" }, rows = { 1, 2, 3 } }
local bias = task:bias(v)
assert(#bias == 3 and bias:max_abs() > 1e-3 and bias:labels().units[1] == "rad/s^2")
local start, h = sim:state(), 1e-3
local function rates(x)  -- of the tool, where every joint has moved on by x v; node axes
  local q = sim:state().q
  for i, name in ipairs(names) do if name:find "angle$" then q[i] = q[i] + x * v[(name:gsub("angle", "rate"))] end end
  sim:state { q = q }
  local r = sim:operators():task({ nodes = { "hand.tool" }, rows = { 1, 2, 3 } }):rates(v)
  sim:state(start)
  return r
end
local d = (8 * (rates(h) - rates(-h)) - (rates(2 * h) - rates(-2 * h))) * (1 / (12 * h))
assert((d - bias):max_abs() < 1e-10, tostring(d) .. tostring(bias))  -- rates of 0.3 rad/s: (0.3 h)^4 and rounding over h
local F = task:force_for({ 1, 2, 3 }, bias)
assert((F - task:inertia() * (vector { 1, 2, 3 } - bias)):max_abs() < 1e-13 * F:max_abs())  -- sums in another order
task:require_full_rank()
local twice = s:task { nodes = { "hand.tool", "hand.tool" } }
local ok, why = pcall(twice.require_full_rank, twice)
assert(not ok and tostring(why):find("rank 6 of 12 rows", 1, true), tostring(why))
)",
                                   CARDAN_SOURCE_DIR "/scenarios/02_free_flying_arm");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(OperatorsInScripts, ModesSayWhatTheyAre) {
  const Finished run = slew_script(R"(
local modes = tostring(sim:system_modes { elastic = 2 })
assert(modes:find("10 rigid-body and 2 elastic modes, without weight, of preload with that of devices", 1, true), modes)
assert(modes:find("wing_left %d+ %%") and modes:find("wing_left.eta", 1, true), modes)
for _, pole in ipairs(sim:linearize().poles) do  -- a pole that is zero to rounding has no damping
  assert(pole.frequency > 0.1 and math.abs(pole.damping - 0.01) < 0.01 or pole.frequency < 1e-5 and pole.damping == 0)
end
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

// Shapes hold some 1e-16 of other modes: what damps those is no damping of one that has none.
TEST(OperatorsInScripts, ModesWithoutDampingSaySo) {
  const TemporaryFolder dir;
  std::ofstream(dir / "vehicle.yaml") << R"(
cardan: 1
bodies:
  undamped:
    type: modal_flexible
    modal: {beam: {length: 2 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 5 cm, wall: 1 mm}}}, modes: {count: 40}, damping: 0 %}
    hinge: {type: locked, to: world, at: root}
  damped:
    type: modal_flexible
    modal: {beam: {length: 2 m, material: {E: 70 GPa, rho: 2700}, section: {rectangle: {width: 5 cm, height: 1 cm}}}, modes: {count: 30}, damping: 1 %}
    hinge: {type: locked, to: world, at: root}
)";
  std::ofstream(dir / "look.lua") << "print(sim:system_modes { elastic = 12 })";
  const Finished run = run_program({"workbench", "vehicle.yaml", "--script", "look.lua"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(has(run.out, "  0  undamped 100 %")) << run.out;
  EXPECT_FALSE(has(run.out, "e-")) << run.out;
}

/// What hangs together by signals takes part together: the thruster of the bus, which the encoder of the arm commands.
TEST(OperatorsInScripts, APartHasTheDevicesThatItsOwnAreConnectedTo) {
  const TemporaryFolder dir;
  std::ofstream(dir / "vehicle.yaml") << R"(
cardan: 1
bodies:
  bus: {mass: 5, inertia: [1, 1, 1], hinge: {type: free, to: world}}
  arm: {mass: 1, inertia: [0.1, 0.1, 0.1], hinge: {type: revolute, axis: [0, 0, 1], to: bus}}
devices:
  jet: {type: thruster, at: bus, thrust: 2, specific_impulse: 200 s, direction: [0, 1, 0], inputs: {command: reading.valid}}
  reading: {type: encoder, at: arm, rate: 1 Hz}
  gyro: {type: momentum_wheel, at: bus, inertia: 0.01}
)";
  std::ofstream(dir / "look.lua") << R"(
local arm = sim:operators():subtree "arm"
assert(arm:linearize { outputs = { "jet:thrust" } }.C:rows() == 1)
assert(not pcall(arm.linearize, arm, { outputs = { "gyro:rate" } }))
)";
  const Finished run = run_program({"workbench", "vehicle.yaml", "--script", "look.lua"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

// Two cranks and a bar that stays level: a pendulum. One of three hinges is independent, the others are seen.
TEST(OperatorsInScripts, AnalysesTakeClosedLoops) {
  const TemporaryFolder dir;
  std::ofstream(dir / "vehicle.yaml") << R"(
cardan: 1
gravity: {uniform: [0, -9.81, 0]}
bodies:
  left: {mass: 1.3, com: [0.25, 0, 0], inertia: [0.001, 0.03, 0.03], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {angle: -90 deg}}}
  right: {mass: 1.3, com: [0.25, 0, 0], inertia: [0.001, 0.03, 0.03], hinge: {type: revolute, axis: [0, 0, 1], to: {body: world, position: [0.8, 0, 0]}, initial: {angle: -90 deg}}}
  bar: {mass: 2.1, com: [0.4, 0, 0], inertia: [0.01, 0.2, 0.2], hinge: {type: revolute, axis: [0, 0, 1], to: {body: left, position: [0.5, 0, 0]}, initial: {angle: 90 deg}}}
loops:
  pin: {type: point, from: {body: right, position: [0.5, 0, 0]}, to: {body: bar, position: [0.8, 0, 0]}}
)";
  std::ofstream(dir / "scenario.lua") << R"(
local sat = vehicle "vehicle.yaml"
mission { duration = "0.1 s", output = { rate = "10 Hz" } }
local weight, inertia = 9.81 * (2.1 * 0.5 + 2 * 1.3 * 0.25), 2.1 * 0.25 + 2 * (0.03 + 1.3 * 0.0625)
local lin = sat:linearize { inputs = { "left.angle" }, outputs = { "left.angle", "right.angle", "bar.angle", "left.rate", "bar.rate" } }
assert(#lin.state_names == 2 and lin.A:rows() == 2 and lin.drift:max_abs() < 1e-12)
assert(math.abs(2 * math.pi * lin.poles[1].frequency - math.sqrt(weight / inertia)) < 1e-11)
assert(math.abs(lin.A(2, 1) + weight / inertia) < 1e-11 and math.abs(math.abs(lin.B(2, 1)) - 1 / inertia) < 1e-12)
local to = lin.C(1, 1)
for i, row in ipairs { { to, 0 }, { to, 0 }, { -to, 0 }, { 0, to }, { 0, -to } } do
  assert(math.abs(lin.C(i, 1) - row[1]) < 1e-12 and math.abs(lin.C(i, 2) - row[2]) < 1e-12, lin.output_names[i])
end
local c = sat:closed_system()
assert(c:mobility() == 1 and #c:independent() == 1 and c:motions():cols() == 1)
assert((c:respond { 1, 0, 0 } * inertia - vector { 1, 1, -1 }):max_abs() < 1e-12)
local side = c:task { nodes = { "bar" }, rows = { 4 } }                      -- hanging, its end moves sideways on a circle of 0.5 m
assert(math.abs(side:inertia()(1, 1) - inertia / 0.25) < 1e-11)
for actuator, sign in pairs { left = 1, right = 1, bar = -1 } do
  local found = c:inverse_dynamics({ 0.7, 0.7, -0.7 }, { actuator })
  assert(found.missing:max_abs() < 1e-12 and math.abs(found.tau[actuator .. ".rate"] - 0.7 * sign * inertia) < 1e-12)
end
assert(math.abs(c:inverse_dynamics({ 0.7, 0.7, -0.7 }, {}).missing:max_abs() - 0.7 * inertia) < 1e-12)
local ok, why = pcall(c.respond, c, { 1 })
assert(not ok and tostring(why):find("3", 1, true), tostring(why))
assert(math.abs(c:log_det() - math.log(inertia)) < 1e-12 and c:log_det_gradient():rows() == 1 and c:log_det_gradient():max_abs() < 1e-12)
local nu = c:nu { 0.7, 0.7, -0.7 }
assert(math.abs(nu[1] ^ 2 - 0.49 * inertia) < 1e-12 and (c:velocity(nu) - vector { 0.7, 0.7, -0.7 }):max_abs() < 1e-12)
assert(math.abs(math.abs(c:eps({ 2, 0, 0 })[1]) - 2 / math.sqrt(inertia)) < 1e-12 and c:coriolis(nu):max_abs() < 1e-12)
assert(c:open_tree().mass:dense():rows() == 3)
local s = sat:operators()                                                    -- of the tree of compound bodies
local one = s:compounds()[1]
assert(#s:compounds() == 1 and #one.bodies == 3 and one.home == "world" and one.loops[1] == "pin" and one.independent[1] == s:names()[1])
assert(s:size("hinge") == 1 and s:size("rate") == 3 and s:size("body") == 18)
assert(((s.X * s.mass:inv() * s.X:star()) * vector { 1, 0, 0 } * inertia - vector { 1, 1, -1 }):max_abs() < 1e-12)
assert((s.mass * s.mass:inv() - s.I):norm() < 1e-13 and math.abs(s:log_det() - math.log(inertia)) < 1e-12)
s:along(s:names()[1])
assert(s.mass_derivative:norm() < 1e-12 and s.dX:norm() < 1e-12)             -- a parallelogram
ok, why = pcall(s.momentum, s, { 1, 0, 0 })
assert(not ok and tostring(why):find("closed_system() has the analyses", 1, true), tostring(why))
local d = sat:derivatives()
assert(math.abs(math.abs(d.vdot_q(1, 1)) - weight / inertia) < 1e-11 and d.vdot_v:max_abs() < 1e-12 and math.abs(d.vdot_tau(1, 3) + 1 / inertia) < 1e-12)
assert(d.tau_q == nil and sat:derivatives("bar").vdot:max_abs() < 1e-11)     -- it hangs, whatever its mass
sat:hinge("left"):torque(0.7)                                                -- v' = 0.7 / inertia, in which the bar has m r^2 and a crank its J
assert(math.abs(sat:derivatives("bar").vdot(1, 1) + 0.7 * 0.25 / inertia ^ 2) < 1e-11)
assert(math.abs(sat:derivatives("left").vdot(1, 7) + 0.7 / inertia ^ 2) < 1e-11)
sat:hinge("left"):torque(0)
local found = sat:inverse_kinematics { targets = { { node = "bar", position = { 0.5 * math.sin(0.4), -0.5 * math.cos(0.4), 0 } } } }
assert(found.reached and (found.q - vector { 0.4 - math.pi / 2, 0.4 - math.pi / 2, math.pi / 2 - 0.4 }):max_abs() < 1e-9, found.message)
initial(found.initial)
assert((sim:q() - found.q):max_abs() < 1e-12 and sim:v():max_abs() < 1e-12)
)";
  const Finished run = run_program({"check", "scenario.lua"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(OperatorsInScripts, StandInAMissionToo) {  // inertia from the operators: a pendulum as a critically damped oscillator of 2 rad/s
  const TemporaryFolder dir;
  std::ofstream(dir / "scenario.lua") << R"(
local sat = vehicle "vehicle.yaml"
mission { title = "shaped", duration = "2 s", output = { rate = "2 Hz" } }
initial { rod = { angle = "30 deg" } }
local rod = sat:hinge "rod"
controller { name = "shape", rate = "500 Hz", step = function()
  local s = sat:operators("position")
  local tau = s.mass * vector { -4 * rod:angle() - 4 * rod:rate() }
  rod:torque(tau[1] + 2 * 9.81 * 0.5 * math.sin(rod:angle()))
  assert(#sim:v() == 1 and not pcall(sim.run_to, sim, 3) and not pcall(sim.state, sim, { t = 0 }))
end }
check { name = "angle", value = function() return rod:angle() end, equal = { math.rad(30) * 5 * math.exp(-4), tolerance = 1e-3 } }
)";
  std::ofstream(dir / "vehicle.yaml") << file_text(CARDAN_SOURCE_DIR "/tests/scripts/missions/pendulum/vehicle.yaml");
  const Finished run = run_program({"run", "scenario.lua"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(OperatorsInScripts, AnalysesAgreeWithTheLetters) {
  const Finished run = slew_script(R"(
local s, v = sim:operators(), sim:v()
local n = s:size("hinge")
local function near(a, b, what, tolerance) assert((a - b):max_abs() <= (tolerance or 1e-11) * b:max_abs(), what) end
local numbers = {}
for i = 1, n do numbers[i] = math.cos(i) end
local x = vector(numbers)
-- operational space
local J = s:nodes("wing_left.tip", "bus"):star() * s.phi:star() * s.H:star()
local compliance = s:compliance("wing_left.tip", "bus")
near(compliance, (J * s.mass:inv() * J:star()):dense(), "compliance", 1e-10)
local task = s:task { nodes = { "bus" } }
near(task:inertia() * task:compliance(), matrix { {1,0,0,0,0,0}, {0,1,0,0,0,0}, {0,0,1,0,0,0}, {0,0,0,1,0,0}, {0,0,0,0,1,0}, {0,0,0,0,0,1} }, "inertia", 1e-9)
near(task:rates(x), s:nodes("bus"):star() * (s.phi:star() * (s.H:star() * x)), "rates")
near(s:nodes("bus"):star() * (s.phi:star() * (s.H:star() * task:consistent_inverse { 1, 2, 3, 4, 5, 6 })), vector { 1, 2, 3, 4, 5, 6 }, "J J#", 1e-9)
assert(task:rank() == 6 and s:task { nodes = { "bus" }, rows = { 4 } }:rows() == 1)
local u = { 0, 0, 0, 1, 0, 0 }
assert(math.abs(s:effective_inertia("bus", u) * s:compliance("bus")(4, 4) - 1) < 1e-12)
-- momentum and mass properties
assert(math.abs(s:mass_properties().mass - sim:vehicle():mass()) < 1e-9)
near(s:momentum_matrix("com") * x, s:momentum(x, "com"), "momentum")
local shared = s:momentum_sharing(x)
for part, from in pairs { angular = 1, linear = 4 } do -- what each body has along the total
  for i = 1, #shared[part] do
    local along, square = 0, 0
    for k = from, from + 2 do along, square = along + shared.bodies(k, i) * shared.total[k], square + shared.total[k] ^ 2 end
    assert(math.abs(shared[part][i] - along / square) < 1e-12 * shared[part]:max_abs(), part)
  end
end
-- hybrid: everything free is forward dynamics, by M
local h = s:hybrid { tau = s.mass * x }
near(h.vdot, x, "hybrid", 1e-9)
local base = s:floating_base()
local still = base:velocities(x)                       -- at zero momentum
assert(s:momentum(still, "com"):max_abs() < 1e-9 * s:momentum(x, "com"):max_abs())
near(base:velocities(x, s.mass * x), x, "velocities that have these momenta", 1e-9)
-- what an equilibrium leaves alone keeps its rates
local moving = sim:v()
moving["wing_right.etadot_2"] = 0.3
sim:state { v = moving }
assert(sim:equilibrium({ move = { "wing_left.eta" } }).initial.wing_right.etadot[2] == 0.3)
-- log det, diagonalised velocities
local d = s:diagonalised()
local nu = d:nu(x)
assert(math.abs(nu:dot(nu) - x:dot(s.mass * x)) < 1e-10 * nu:dot(nu))
near(d:velocity(nu), x, "velocity", 1e-10)
assert(math.abs(nu:dot(d:coriolis(x))) < 1e-10 * nu:norm() * d:coriolis(x):norm())
assert(#s:log_det_gradient() == n and s:reflected_inertia().others_locked[1] > 0)
-- studies about the state
local modes = sim:system_modes { elastic = 2 }
assert(modes.n_rigid == 10 and modes.complete and modes.frequency[modes.first_elastic] > 0.1)  -- six and four wheels; the drives are given
local lin = sim:linearize { inputs = { "wheel_1.angle" }, outputs = { "bus:rate" } }
assert(lin.A:rows() == 2 * n and lin.B:cols() == 1 and lin.C:rows() == 3)
local D = sim:derivatives()
assert(D.tau_q:rows() == n and D.vdot_tau(1, 1) > 0)
assert(sim:derivatives("bus").tau:cols() == 10 and sim:derivatives("wing_left").tau:cols() == 10)
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(OperatorsInScripts, AnalysesOfAPart) {
  const Finished run = slew_script(R"(
local function near(a, b, what, tolerance) assert((a - b):max_abs() <= (tolerance or 1e-11) * b:max_abs(), what) end
local whole = sim:operators()
near(whole:derivatives().vdot_q, sim:derivatives().vdot_q, "derivatives")
near(whole:linearize { inputs = { "bus:force" } }.B, sim:linearize { inputs = { "bus:force" } }.B, "linear model")
for _, s in ipairs { whole, whole:subtree "wing_left", whole:path("wing_left", "wheel_1") } do
  local n, numbers = s:size "hinge", {}
  for i = 1, n do numbers[i] = math.sin(i) end
  local x, zero = vector(numbers), vector(numbers) * 0
  -- by the sweeps, and by the letters
  local f = s:interbody_forces { v = zero, vdot = x } - s:interbody_forces { v = zero, vdot = zero }
  near(f, s.phi * (s.M * (s.phi:star() * (s.H:star() * x))), "inter-body forces", 1e-10)
  near(s.H * s:interbody_forces { v = x, vdot = zero }, s:bias(x), "bias", 1e-10)
  assert(s:interbody_forces():labels().units[4] == "N" and #s:interbody_forces() == s:size "body")
  local d = s:derivatives()
  assert(d.tau_q:rows() == n and d.tau_q:cols() == n and d.vdot_tau:rows() == n)
  local lin = s:linearize { outputs = { "wing_left.tip:acceleration" } }
  assert(lin.A:rows() == 2 * n and lin.C:rows() == 3 and lin.state_names[n + 1] == s:names()[1])
  assert(s:diagonalised():coriolis(x):max_abs() >= 0 and s:derivatives("wing_left").tau:cols() == 10)
end
local wing = whole:subtree "wing_left"
local modes = wing:system_modes { elastic = 2 }
assert(modes.kinetic:rows() == 1 and modes.frequency[modes.first_elastic] > 0.01)
local r = wing:inverse_kinematics { targets = { { node = "wing_left.tip", position = { 3, 4, 5 }, rows = { 6 } } }, starts = 1 }
assert(#r.q == #sim:q() and (r.q - sim:q()):max_abs() < 7)
for i, name in ipairs(r.q:labels().names) do assert(r.q[i] == sim:q()[i] or name == "wing_left.angle", name) end
)");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  for (const auto& [statement, code] : std::vector<std::pair<std::string, std::string>>{{"linearize{inputs = {'bus:force'}}", "C0208"},
                                                                                        {"linearize{outputs = {'wheel_1.rate'}}", "C0208"},
                                                                                        {"derivatives('bus')", "C0201"},
                                                                                        {"bias({1, 2})", "C0502"},
                                                                                        {"interbody_forces{w = 1}", "C0104"}}) {
    const Finished refused = slew_script("local x = sim:operators():subtree('wing_left'):" + statement);
    EXPECT_EQ(refused.exit_code, 2) << statement << refused.err;
    EXPECT_NE(refused.err.find(code), std::string::npos) << statement << "\n" << refused.err;
    EXPECT_NE(refused.err.find("look.lua:1"), std::string::npos) << statement << "\n" << refused.err;
  }
}

TEST(OperatorsInScripts, InverseKinematicsOfTheArm) {
  const Finished run = slew_script(R"(
local hand = sim:vehicle():node "hand.tool"
local x, y, z = hand:position()
local w, a, b, c = hand:attitude()
local arm = { "link_1.rate", "link_2.rate", "link_3.rate", "link_4.rate", "link_5.rate", "link_6.rate", "hand.rate" }
local target = { node = "hand.tool", position = { x + 0.2, y - 0.3, z + 0.1 }, attitude = { w, a, b, c } }
local r = sim:inverse_kinematics { targets = { target }, free = arm, limits = { ["link_2.angle"] = { -2, 2 } } }
assert(r.reached and r.residual < 1e-11, r.message)
sim:state { q = r.q }
local X, Y, Z = hand:position()
assert(math.abs(X - x - 0.2) < 1e-10 and math.abs(Y - y + 0.3) < 1e-10 and math.abs(Z - z - 0.1) < 1e-10)
local far = sim:inverse_kinematics { targets = { { node = "hand.tool", position = { 50, 0, 0 } } }, free = arm, starts = 2 }
assert(not far.reached and far.residual > 40 and far.message:find("cannot be reached"))
assert(not pcall(sim.inverse_kinematics, sim, { targets = { { node = "hand.tool" } } }))
)",
                                   CARDAN_SOURCE_DIR "/scenarios/02_free_flying_arm");
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(OperatorsInScripts, TaskSpaceControlOfAFreeFlyingArm) {  // its checks: the tool stays within 0.1 mm of its line
  const TemporaryFolder dir;
  const Finished run = run_program({"run", CARDAN_SOURCE_DIR "/scenarios/02_free_flying_arm", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

}  // namespace
}  // namespace cardan
