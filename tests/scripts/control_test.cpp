// control in scripts: gains of linear models, and what is refused.
#include <gtest/gtest.h>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

/// A hub that a motor turns, and a boom on a spring.
void write_vehicle(const TemporaryFolder& dir) {
  write(dir / "vehicle.yaml", R"(cardan: 1
bodies:
  hub: {mass: 100, inertia: [30, 30, 30], hinge: {type: revolute, to: world, axis: [0, 0, 1]}}
  boom: {mass: 5, com: [1, 0, 0], inertia: [0.1, 2, 2], hinge: {type: revolute, to: hub, axis: [0, 0, 1], spring: {stiffness: 20, damping: 0.2}}}
)");
}
Finished run_script(const TemporaryFolder& dir, const char* command, const std::string& script) {
  write_vehicle(dir);
  write(dir / "scenario.lua", "local sat = vehicle 'vehicle.yaml'\n" + script);
  return run_program({command, "."}, dir.path());
}

/// Gains designed by the linear model of the vehicle close the loop of the vehicle: ten seconds of small motion are powers of Ad - Bd K,
/// with the signs, names and units that the model has. A filter's gain is that of the dual regulator.
TEST(Control, ClosesTheLoopThatItDesigned) {
  const TemporaryFolder dir;
  const Finished run = run_script(dir, "run", R"(
mission { duration = 10, output = { rate = "10 Hz" }, integrator = { relative = 1e-11, absolute = 1e-16 } }
initial { hub = { angle = "2e-6 rad", rate = "0 rad/s" }, boom = { angle = "-1e-6 rad", rate = "3e-6 rad/s" } }
local dt, model = 0.1, sat:linearize { inputs = { "hub.angle" }, outputs = { "hub.angle" } }
local Ad, Bd = control.discretise(model.A, model.B, dt)
local K, X = control.dlqr(Ad, Bd, { 1, 1, 1, 1 }, 1e-3)
assert(K:rows() == 1 and K:cols() == 4 and K["hub.angle"]["boom.rate"] == K[1][4])
assert(((Ad - Bd * K):t() * X * (Ad - Bd * K) + matrix { { 1, 0, 0, 0 }, { 0, 1, 0, 0 }, { 0, 0, 1, 0 }, { 0, 0, 0, 1 } } + 1e-3 * K:t() * K - X):norm() < 1e-10 * X:norm())
for _, pole in ipairs(control.poles(Ad - Bd * K, dt)) do assert(pole.re < 0 and pole.damping > 0) end
local known, again = control.poles(model.A), control.poles(Ad, dt)
assert(#known == 4 and math.abs(known[4].frequency - again[4].frequency) < 1e-9 and math.abs(known[4].damping - again[4].damping) < 1e-9)

local L, P = control.kalman(model.A, model.C, { 0, 0, 1e-4, 1e-4 }, { 1e-6 })
local LT, PT = control.lqr(model.A:t(), model.C:t(), { 0, 0, 1e-4, 1e-4 }, 1e-6)
assert((L - LT:t()):norm() <= 1e-13 * L:norm() and (P - PT):norm() <= 1e-13 * P:norm())
local M, Pd = control.dkalman(Ad, model.C, { 0, 0, 1e-4, 1e-4 }, 1e-6)  -- P C' (C P C' + V)^-1, P before a reading
local s = Pd[1][1] + 1e-6
for i = 1, 4 do assert(math.abs(M[i][1] - Pd[i][1] / s) < 1e-12) end
local after = Pd - M * (model.C * Pd)
assert((Ad * after * Ad:t() + matrix { { 0, 0, 0, 0 }, { 0, 0, 0, 0 }, { 0, 0, 1e-4, 0 }, { 0, 0, 0, 1e-4 } } - Pd):norm() < 1e-10 * Pd:norm())

local hub, boom = sat:hinge "hub", sat:hinge "boom"
local function state() return vector { hub:angle(), boom:angle(), hub:rate(), boom:rate() } end
local x = vector { 2e-6, -1e-6, 0, 3e-6 }
controller { name = "regulator", rate = "10 Hz", step = function(t)
  if t > 0 then x = (Ad - Bd * K) * x end
  hub:torque(-(K * state())[1])
end }
check { name = "as designed", value = function() return (state() - x):norm() / 2e-6 end, below = 1e-6 }
check { name = "it moved", value = function() return x:norm() / 2e-6 end, within = { 1e-4, 0.8 } }
)");
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

/// A base that is shaken and what stands on it by a spring and a damper: transmissibility (k + i c w) / (k - m w^2 + i c w) [Den Hartog],
/// from the acceleration of the one to that of the other; and a lag at ticks, (1 - a) / (z - a).
TEST(Control, TellsWhatComesThrough) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"(cardan: 1
bodies:
  base: {type: particle, mass: 9, hinge: {type: prismatic, to: world, axis: [0, 0, 1], prescribed: true}}
  mass: {type: particle, mass: 2, nodes: {top: {}}, hinge: {type: prismatic, to: base, axis: [0, 0, 1], spring: {stiffness: 800, damping: 6}}}
)");
  write(dir / "scenario.lua", R"(
local sat = vehicle "vehicle.yaml"
mission { duration = 1 }
local model = sat:linearize { inputs = { "base.rate" }, outputs = { "mass.top:acceleration.z", "base:acceleration.z" } }
local m, k, c = 2, 800, 6
for _, f in ipairs { 0.3, 3.1, 3.2, 20 } do
  local w = 2 * math.pi * f
  local gain, phase = control.response(model.A, model.B, model.C, model.D, f)
  local num, den = { k, c * w }, { k - m * w ^ 2, c * w }
  local known = math.sqrt(num[1] ^ 2 + num[2] ^ 2) / math.sqrt(den[1] ^ 2 + den[2] ^ 2)
  local lag = math.atan(num[2], num[1]) - math.atan(den[2], den[1])
  assert(math.abs(gain[1][1] - known) < 1e-12 * known and math.abs(phase[1][1] - lag) < 1e-12, f)
  assert(math.abs(gain["base:acceleration.z"][1] - 1) < 1e-12 and math.abs(phase[2][1]) < 1e-12, "what is given")
end
local a, dt, f = 0.8, 0.01, 7
local gain, phase = control.response(matrix { { a } }, matrix { { 1 - a } }, matrix { { 1 } }, nil, f, dt)
local re, im = math.cos(2 * math.pi * f * dt) - a, math.sin(2 * math.pi * f * dt)
assert(math.abs(gain[1][1] - (1 - a) / math.sqrt(re ^ 2 + im ^ 2)) < 1e-14 and math.abs(phase[1][1] + math.atan(im, re)) < 1e-14)
)");
  const Finished run = run_program({"check", "."}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

/// A call spends what its work is: a sweep of 300 frequencies over 60 states, by hand 300 solves of 120 unknowns, is within the budget of
/// one function, and so is a regulator of 150 states. Lags 1 / (i w + k / 10), each by itself.
TEST(Control, TakesManyStatesAndFrequenciesInOneCall) {
  const TemporaryFolder dir;
  const Finished run = run_script(dir, "run", R"(
mission { duration = "0.1 s", output = { rate = "10 Hz" } }
local function lags(n)
  local A, B, C = {}, {}, { {} }
  for i = 1, n do
    A[i], B[i], C[1][i] = {}, { 1 }, 1
    for j = 1, n do A[i][j] = i == j and -i / 10 or 0 end
  end
  return matrix(A), matrix(B), matrix(C)
end
check { name = "sweep", equal = { 0, tolerance = 1e-12 }, value = function()
  local A, B, C = lags(60)
  local off = 0
  for f = 1, 300 do
    local gain = control.response(A, B, C, nil, f / 50)
    local re, im, w = 0, 0, 2 * math.pi * f / 50
    for k = 1, 60 do re, im = re + k / 10 / (k * k / 100 + w * w), im - w / (k * k / 100 + w * w) end
    off = math.max(off, math.abs(gain[1][1] / math.sqrt(re * re + im * im) - 1))
  end
  return off
end }
check { name = "poles", equal = { 150, tolerance = 0 }, value = function() return #control.poles((lags(150))) end }
check { name = "regulator", equal = { 150, tolerance = 0 }, value = function()
  local A, B = lags(150)
  return control.lqr(A, B, 1, 1):cols()
end }
)");
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(Control, RefusesWhatHasNoMeaning) {
  struct {
    const char *call, *expected;
  } constexpr kRefused[] = {
      {"control.lqr(matrix{{0, 1}}, matrix{{1}}, 1, 1)", "A: a square matrix"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{1}}, 1, 1)", "B of control.lqr"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {{1, 2}, {0, 1}}, 1)", "Q: a symmetric matrix"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {1, -1}, 1)", "Q: a matrix whose eigenvalues are not below 0"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {1, 1}, 0)", "R: a matrix whose eigenvalues are above 0"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {1, 1, 1}, 1)", "Q of control.lqr, the diagonal"},
      {"control.lqr(matrix{{0, 1}, {0, 0/0}}, matrix{{0}, {1}}, {1, 1}, 1)", "A: a matrix of finite numbers"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {0, 1}, 1)", "by which feedback can stabilise what they see"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {0, 1}, 1)", "no weight of Q sees?"},
      {"control.lqr(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, {1, 1}, 1e-32)", "times as much R: it is too small beside Q"},
      {"control.kalman(matrix{{0, 0}, {1, 0}}, matrix{{0, 1}}, {1, 1}, 1e-32)", "times as much V: it is too small beside W"},
      {"control.kalman(matrix{{0, 1}, {0, 0}}, matrix{{0, 1}}, {0, 1}, 1)", "by which a filter can follow what they show"},
      {"control.discretise(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, 0)", "dt: a time above 0 [s]"},
      {"control.discretise(matrix{{1e4}}, matrix{{1}}, 1)", "a system that stays within the range of numbers over dt"},
      {"control.poles(matrix{{0, 1}})", "A: a square matrix"},
      {"control.response(matrix{{0, 1}, {0, 0}}, matrix{{0}, {1}}, matrix{{1}}, nil, 1)", "C of control.response"},
      {"control.response(matrix{{1}}, matrix{{1}}, matrix{{1}}, nil, -1)", "frequency: a number not below 0 [Hz]"},
      {"control.response(matrix{{0}}, matrix{{1}}, matrix{{1}}, nil, 0)", "0 Hz, that of a pole"},
      {"control.dlqr()", "A of control.dlqr"},
  };
  const TemporaryFolder dir;
  for (const auto& [call, expected] : kRefused) {
    const Finished run = run_script(dir, "check", std::string("mission { duration = 1 }\n") + call);
    EXPECT_EQ(run.exit_code, 2) << call << run.out;
    EXPECT_NE(run.err.find(expected), std::string::npos) << call << "\n" << run.err;
    EXPECT_NE(run.err.find("scenario.lua:3"), std::string::npos) << call << "\n" << run.err;
  }
}

}  // namespace
}  // namespace cardan
