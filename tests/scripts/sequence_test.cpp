// Plans that are written from top to bottom: when each step happens, what is told of it, and what is refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/io/hdf5_file.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

const std::string kBegin = R"lua(
local sat = vehicle "vehicle.yaml"
local rod = sat:hinge "rod"
local m = persist { told = {} }
local function tell(what) m.told[#m.told + 1] = what end
)lua";

/// The script is right if its checks pass: `expect(name, is, wanted)` compares at the end.
const std::string kEnd = R"lua(
local function same(a, b)
  if type(a) ~= "table" then return a == b end
  for i = 1, math.max(#a, #b) do if a[i] ~= b[i] then return false end end
  return true
end
for i, w in ipairs(wanted) do
  check { name = w[1], value = function()
    local is = w[2]()
    local good = same(is, w[3])
    if not good then print(w[1], type(is) == "table" and table.unpack(is) or is) end
    return good and 1 or 0
  end, equal = { 1 } }
end
)lua";

Finished run_with(const TemporaryFolder& dir, const std::string& text) {
  make_scenario(dir, text);
  return run_program({"run", ".", "--out", "out"}, dir.path());
}
void expect_good(const std::string& text) {
  const TemporaryFolder dir;
  const Finished run = run_with(dir, kBegin + text + kEnd);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_EQ(run.err, "");
}

TEST(Sequences, WaitsEndExactlyAtTheirInstants) {
  expect_good(R"lua(
mission { duration = "12 s", output = { rate = "1 Hz" } }
sequence { name = "tenths", run = function()
  for k = 1, 100 do wait "0.1 s" if mission.time() ~= k / 10 then tell("tenths " .. k) end end
  at "11 s" tell(mission.time())
  wait(1 / 3) wait(1 / 3) wait(1 / 3) tell(mission.time())
end }
sequence { name = "thirds", run = function()
  wait(0) at(0)
  for k = 1, 30 do wait(1 / 3) if k % 3 == 0 and mission.time() ~= k / 3 then tell("thirds " .. k) end end
end }
local wanted = { { "times", function() return m.told end, { 11, 12 } } }
)lua");
}

/// Three plans and a controller at the same tenths: no step is a rounding error long.
TEST(Sequences, MeetTicksInOneStep) {
  const TemporaryFolder dir;
  const Finished run = run_with(dir, R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = "10 s", output = { rate = "10 Hz" }, integrator = { method = "rk4", step = 1 } }
for _, name in ipairs { "a", "b", "c" } do
  sequence { name = name, run = function() for k = 1, 100 do wait "0.1 s" end end }
end
sequence { name = "halves", run = function() for k = 1, 20 do wait_until(function() return k < 0 end, { rate = "10 Hz", timeout = "0.5 s" }) end end }
controller { name = "law", rate = "10 Hz", step = function() end }
)lua");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(summary_of(dir / "out")["steps"], 100);
}

TEST(Sequences, OfOneInstantGoOnInTheOrderOfTheirDeclarationBeforeControllers) {
  expect_good(R"lua(
mission { duration = "2 s", output = { rate = "1 Hz" } }
controller { name = "law", rate = "1 Hz", step = function(t) tell("law " .. t) end }
local b
sequence { name = "a", run = function() tell "a0" wait "1 s" tell "a1" b:start() tell(b:state()) end }
b = sequence { name = "b", start = false, run = function() tell(mission.phase()) wait(0) tell("b" .. mission.time()) wait "1 s" tell "b2" end }
sequence { name = "c", run = function() tell "c0" wait "1 s" tell "c1" mission.enter "second" wait "1 s" tell "c2" end }
phase { name = "first" }
phase { name = "second" }
local wanted = { { "order", function() return m.told end,
  { "a0", "c0", "law 0.0", "a1", "ready", "first", "b1.0", "c1", "law 1.0", "b2", "c2", "law 2.0" } } }
)lua");
}

/// A pendulum from rest: where it passes the vertical, by a wait as by an event; looked at, at the next tick.
TEST(Sequences, ConditionsAreLocatedOrLookedAt) {
  expect_good(R"lua(
mission { duration = "6 s", output = { rate = "10 Hz" }, integrator = { relative = 1e-11 } }
event { name = "down", when = function() return rod:angle() - 0.1 end, action = function(t) m.events = m.events or {} m.events[#m.events + 1] = t end }
sequence { name = "located", run = function()
  for k = 1, 4 do
    if not wait_until(function() return rod:angle() - 0.1 end, { timeout = "10 s" }) then tell "late" end
    tell(mission.time())
  end
end }
sequence { name = "sides", run = function()
  wait_until(function() return rod:angle() - 0.1 end, { direction = "falling" })
  m.falling = mission.time()
  wait_until(function() return rod:angle() - 0.1 end, { direction = "rising" })
  m.rising = mission.time()
end }
sequence { name = "looked at", run = function()
  wait_until(function() return rod:angle() < 0.1 end, { rate = "4 Hz" })
  m.looked = mission.time()
end }
local function at_events() local d = 0 for i = 1, 4 do d = math.max(d, math.abs(m.told[i] - m.events[i])) end return d < 1e-9 and #m.told == 4 end
local wanted = {
  { "as the event", at_events, true },
  { "sides", function() return m.falling == m.told[1] and m.rising == m.told[2] end, true },
  { "tick", function() return m.looked == math.ceil(4 * m.told[1]) / 4 end, true } }
initial { rod = { angle = "60 deg" } }
)lua");
}

/// At rest the rate is zero, and its next zero is half a period later; what rises and is at zero has risen. Where a zero was located
/// rounding decides nothing: what has risen falls half a period later.
TEST(Sequences, WaitForTheNextZero) {
  expect_good(R"lua(
mission { duration = "12 s", output = { period = "12 s" }, integrator = { relative = 1e-11 } }
initial { rod = { angle = "5 deg" } }
event { name = "turns", when = function() return rod:rate() end, action = function(t) m.turns = m.turns or {} m.turns[#m.turns + 1] = t end }
event { name = "turns up", direction = "rising", when = function() return rod:rate() end, action = function(t) m.up = m.up or {} m.up[#m.up + 1] = t end }
m.each, m.rising = {}, {}
sequence { name = "each", run = function() while #m.each < 8 do wait_until(function() return rod:rate() end) m.each[#m.each + 1] = mission.time() end end }
sequence { name = "rising", run = function()
  wait_until(function() return rod:rate() end, { direction = "rising" })
  tell(mission.time())
  wait_until(function() return rod:rate() end, { direction = "falling" })
  tell(mission.time())
  wait "0.1 s"
  while #m.rising < 8 do
    wait_until(function() return rod:rate() end, { direction = "rising" })
    m.rising[#m.rising + 1] = mission.time()
    wait_until(function() return 1e-3 * rod:rate() end, { direction = "falling" })
    m.rising[#m.rising + 1] = mission.time()
  end
end }
local function flat(t) if t < 1.25 then return t - 1.25 elseif t < 1.250001 then return 0 end return math.sin(math.pi * (t - 1.250001)) end
sequence { name = "flat", run = function()
  wait_until(flat, { direction = "rising" })
  tell(math.abs(mission.time() - 1.25) <= 1e-6)
  wait_until(flat, { direction = "falling" })
  m.flat = mission.time()
end }
local function apart(a, b, n) local d = #b >= n and 0 or 1 for i = 1, n do d = math.max(d, math.abs(a[i] - b[i])) end return d < 1e-10 end
local wanted = { { "at rest", function() return m.told end, { 0, 0, true } },
  { "flat", function() return math.abs(m.flat - 2.250001) < 1e-9 end, true },
  { "each", function() return apart(m.each, m.turns, 8) end, true }, { "in turn", function() return apart(m.rising, m.turns, 8) and math.abs(m.up[2] - m.rising[3]) < 1e-10 end, true } }
)lua");
}

/// To which side a number has passed that was waited for from either: there it has risen in the same instant, and it has not fallen.
TEST(Sequences, KnowToWhichSideANumberHasPassed) {
  expect_good(R"lua(
mission { duration = "6 s", output = { period = "6 s" } }
for name, sign in pairs { up = 1, down = -1 } do
  local function x(t) return sign * (t - 1.3) end
  sequence { name = name, run = function()
    wait_until(x)
    m[name] = { math.abs(mission.time() - 1.3) < 1e-9 }
    local now = mission.time()
    table.insert(m[name], wait_until(x, { direction = sign > 0 and "rising" or "falling", timeout = "1 s" }))
    table.insert(m[name], mission.time() == now)
    table.insert(m[name], wait_until(x, { direction = sign > 0 and "falling" or "rising", timeout = "1 s" }))
  end }
end
local wanted = { { "up", function() return m.up end, { true, true, true, false } }, { "down", function() return m.down end, { true, true, true, false } } }
)lua");
}

/// Within the first step after a wait has begun: after one that changed nothing, at the zero of another condition, after a timeout.
TEST(Sequences, ZerosThatComeAtOnceAreFound) {
  expect_good(R"lua(
mission { duration = "6 s", output = { period = "6 s" }, checkpoint = { never = true }, integrator = { initial_step = 0.5, relative = 1e-4 } }
local function soon(after)
  local begun = mission.time()
  local held = wait_until(function(t) return t - begun - after end, { timeout = "1 s" })
  tell(held and math.abs(mission.time() - begun - after) < 1e-12 or mission.time())
end
sequence { name = "a", run = function()
  wait "1 s"
  soon(1e-4) soon(2e-4) soon(1e-4)
  tell(wait_until(function() return rod:angle() + 100 end, { timeout = "0.1 s" }))
  soon(1e-4)
  wait_until(function() return rod:angle() end)
  soon(1e-4) soon(1e-4)
end }
initial { rod = { angle = "60 deg" } }
local wanted = { { "found", function() local t = {} for i, x in ipairs(m.told) do t[i] = tostring(x) end return t end,
  { "true", "true", "true", "false", "true", "true", "true" } } }
)lua");
}

TEST(Sequences, ATimeoutIsAnInstantAndEndsThePlanOtherwise) {
  expect_good(R"lua(
mission { duration = "10 s", output = { rate = "1 Hz" } }
local function never() return rod:angle() + 100 end
sequence { name = "goes on", run = function()
  wait "0.1 s"
  tell(wait_until(never, { timeout = "1.2 s" })) tell(mission.time())
  tell(wait_until(function() return false end, { rate = "10 Hz", timeout = "0.05 s" })) tell(mission.time())
  tell(wait_until(function() return mission.time() >= 2 end, { rate = "2 Hz", timeout = "0.65 s" })) tell(mission.time())
  tell(wait_until(function() return 1 end, { direction = "rising" })) tell(mission.time())
end }
local plan = sequence { name = "aborts", run = function()
  at "3 s"
  wait_until(never, { timeout = "1 s", otherwise = function() tell("aborts " .. mission.time()) wait "2 s" tell("safe " .. mission.time()) end })
  tell "not here"
end }
local wanted = { { "order", function() local t = {} for i, x in ipairs(m.told) do t[i] = tostring(x) end return t end,
  { "false", "1.3", "false", "1.35", "true", "2.0", "true", "2.0", "aborts 4.0", "safe 6.0" } },
  { "state", function() return plan:state() end, "ended" } }
)lua");
}

TEST(Sequences, AreStoppedStartedAndAsked) {
  expect_good(R"lua(
mission { duration = "10 s", output = { rate = "1 Hz" } }
local a, b
a = sequence { name = "a", run = function() local closes <close> = setmetatable({}, { __close = function() tell("closes " .. mission.time()) end })
  wait "100 s" end }
b = sequence { name = "b", run = function() wait "1 s" b:stop() tell "not here" end }
local c = sequence { name = "c", start = false, run = function() tell("c " .. mission.time()) wait "0.5 s" end }
sequence { name = "watch", run = function()
  wait "1 s" tell(a:state()) tell(b:state()) tell((a:waits_for():gsub(":%d+", ":n"))) tell(c:state())
  wait "1 s" tell(b:state()) a:stop() a:stop() tell(a:state())
  c:start() wait "1 s" tell(c:state()) c:start()
  tell(pcall(c.start, c) and "twice" or "once")
end }
local wanted = { { "order", function() return m.told end,
  { "waiting", "stopped", "100 s (scenario.lua:n)", "idle", "stopped", "closes 2.0", "stopped", "c 2.0", "ended", "once", "c 3.0" } } }
)lua");
}

TEST(Sequences, WhatTheyDoIsInTheResults) {
  const TemporaryFolder dir;
  const Finished run = run_with(dir, R"lua(
local sat = vehicle "vehicle.yaml"
local rod = sat:hinge "rod"
mission { duration = "4 s", output = { rate = "10 Hz" } }
initial { rod = { angle = "60 deg" } }
sequence { name = "plan", run = function()
  wait "1 s"
  at "2 s"
  wait_until(function() return false end, { rate = "1 Hz", timeout = "1 s" })
  wait_until(function() return rod:angle() end, { timeout = "1000 s" })
  print "done"
end }
sequence { name = "stopped", run = function() wait "50 s" end }
sequence { name = "stops", run = function() wait "1 s" end }
)lua");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const Hdf5File file = Hdf5File::open(dir / "out/run.h5");
  const std::vector<std::string> texts = file.read_texts("/run/events/text");
  std::vector<std::string> of_plan;
  for (std::size_t i = 0; i + 1 < texts.size(); i += 2)
    if (texts[i] == "plan") of_plan.push_back(texts[i + 1]);
  const std::vector<std::string> wanted = {
      "begins", "1 s scenario.lua:7", "t = 2 s scenario.lua:8", "timeout of 1 s scenario.lua:9", "zero scenario.lua:10", "ends"};
  EXPECT_EQ(of_plan, wanted);
  EXPECT_EQ(file.read_texts("/run/printed/text"), (std::vector<std::string>{"done", "sequence \"plan\""}));
  EXPECT_TRUE(has(run.err, "W0303")) << run.err;
  EXPECT_TRUE(has(run.err, "it still waited for 50 s (scenario.lua:13)")) << run.err;
}

TEST(Sequences, ThatWaitForConditionsStillAreTold) {
  const TemporaryFolder dir;
  const Finished run = run_with(dir, kBegin + R"lua(
mission { duration = "1 s" }
sequence { name = "a", run = function() wait_until(function() return rod:angle() + 100 end, { timeout = "9 s" }) end }
sequence { name = "b", run = function() wait_until(function() return false end, { rate = "10 Hz" }) end }
sequence { name = "c", start = false, run = function() end }
)lua");
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(has(run.err, "it still waited for a zero that is located, timeout of 9 s (scenario.lua:8)")) << run.err;
  EXPECT_TRUE(has(run.err, "it still waited for a condition that is looked at every 0.1 s (scenario.lua:9)")) << run.err;
  EXPECT_TRUE(has(run.err, "nothing has started it\n  --> ./scenario.lua:10\n  at: sequence \"c\"")) << run.err;
  const std::vector<double> seen = Hdf5File::open(dir / "out/run.h5").read_doubles("/run/warnings/t").values;
  EXPECT_EQ(seen, std::vector<double>(3, 1.0)) << "seen at the end, not before the run";
}

TEST(Sequences, AreListedByCheckAndDescribe) {
  const TemporaryFolder dir;
  make_scenario(dir, kBegin + R"lua(
mission { duration = "1 s" }
phase { name = "first" }
sequence { name = "plan", run = function() print "not yet" assert(mission.phase() == "first") wait_until(function() return rod:angle() + 100 end) end }
sequence { name = "later", start = false, run = function() end }
)lua");
  const Finished check = run_program({"check", "."}, dir.path());
  EXPECT_EQ(check.exit_code, 0) << check.err;
  EXPECT_TRUE(has(check.out, "0 checks, 2 sequences, 1 s")) << check.out;
  const Finished describe = run_program({"describe", "."}, dir.path());
  EXPECT_TRUE(has(describe.out,
                  "sequences (what each waits for next is known as it goes)\n  plan              from the start of the run, waits first "
                  "for a zero that is located (scenario.lua:9)\n"
                  "  later             when it is started\n"))
      << describe.out;
  EXPECT_FALSE(has(describe.out, "not yet"));
}

TEST(Sequences, GoOnAndBeginAnewAtTheWorkbench) {
  const TemporaryFolder dir;
  make_scenario(dir, R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = "20 s" }
plan = sequence { name = "plan", run = function() wait "1 s" wait "1 s" end }
)lua");
  write(dir / "look.lua", R"lua(
local function expect(state, waits) assert(plan:state() == state and plan:waits_for() == waits, plan:state() .. plan:waits_for()) end
sim:run_to(0.5) expect("waiting", "1 s (scenario.lua:4)")
sim:run_to(1.5) expect("waiting", "1 s (scenario.lua:4)")
sim:state { t = 0 } expect("ready", "")
sim:run_to(1.5) plan:stop() expect("stopped", "")
plan:start() expect("ready", "")
sim:run_to(3) sim:run_to(3.5) expect("ended", "")
assert(not pcall(wait, 1))
)lua");
  const Finished look = run_program({"workbench", ".", "--script", "look.lua"}, dir.path());
  EXPECT_EQ(look.exit_code, 0) << look.out << look.err;
}

/// The whole answer to a run with this plan.
std::string answer_to(const std::string& plan, const std::string& more = {}) {
  const TemporaryFolder dir;
  const Finished run =
      run_with(dir, kBegin + "mission { duration = '3 s', budget = { steps = 1e6 } }\n" + more + "local function inner() " + plan +
                        " end\nsequence { name = 'plan', run = function()\n  wait '1 s'\n  inner()\nend }\n");
  EXPECT_EQ(run.exit_code, 3) << run.err;
  return run.err;
}

TEST(Sequences, AnErrorHasTheStackOfThePlan) {
  const std::string error = answer_to("local x = nil + 1");
  EXPECT_TRUE(has(error, "failure[N0303]")) << error;
  EXPECT_TRUE(has(error, "sequence \"plan\"")) << error;
  EXPECT_TRUE(has(error, "scenario.lua:7")) << error;
  EXPECT_TRUE(has(error, "stack:    scenario.lua:7 in function 'inner'  <  scenario.lua:10 in function of line 8")) << error;
  EXPECT_TRUE(has(error, "t = 1 s")) << error;
  const std::string refused = answer_to("sat:hinge 'rot'");
  EXPECT_TRUE(has(refused, "did you mean \"rod\"")) << refused;
  EXPECT_TRUE(has(refused, "scenario.lua:10 in function of line 8")) << refused;
}

TEST(Sequences, ThatNeverWaitAreCaught) {
  const std::string endless = answer_to("while true do wait(0) end");
  EXPECT_TRUE(has(endless, "failure[N0302]")) << endless;
  EXPECT_TRUE(has(endless, "scenario.lua:10 in function of line 8")) << endless;
  const std::string each_other = answer_to("a:start()",
                                           "local a, b a = sequence { name = 'a', start = false, run = function() b:start() end }"
                                           " b = sequence { name = 'b', start = false, run = function() a:start() end }\n");
  EXPECT_TRUE(has(each_other, "failure[N0303]")) << each_other;
  EXPECT_TRUE(has(each_other, "times in one instant")) << each_other;
}

TEST(Sequences, WaitOnlyWhereTheyCan) {
  const auto expect = [](const std::string& plan, const std::string& what, const std::string& more = {}) {
    const std::string error = answer_to(plan, more);
    EXPECT_TRUE(has(error, what)) << plan << "\n" << error;
  };
  expect("coroutine.yield()", "expected: wait, wait_until or at\n  got:      coroutine.yield");
  expect("coroutine.wrap(function() wait(1) end)()", "got:      one from a coroutine within it");
  expect("table.sort({ 2, 1 }, function() wait(1) return true end)", "attempt to yield across a C-call boundary");
  expect("at(0.5)", "expected: a time from now on, 1 s\n  got:      0.5 s");
  expect("wait(-1)", "expected: a time >= 0 s");
  expect("wait '3 kg'", "wait");
  expect(
      "local c <close> = setmetatable({}, { __close = function() error 'it sticks' end }) wait_until(function() return false end, { rate = "
      "1, timeout = 0.1, otherwise = print })",
      "it sticks");
  expect("wait_until(3)", "expected: the function of a condition");
  expect("wait_until(function() return true end)", "expected: a finite number, which is located where it crosses zero\n  got:      true");
  expect("wait_until(function() return 1, 2 end)",
         "expected: a finite number, which is located where it crosses zero\n  got:      2 values");
  expect("wait_until(function() return 1 end, { rate = 1 })", "expected: true or false\n  got:      1");
  expect("wait_until(function() return 1 end, { rate = 1, direction = 'rising' })", "no rate beside it");
  expect("wait_until(function() return 1 end, { otherwise = print })", "a timeout beside it, after which it follows");
  expect("wait_until(function() return rod:reaction() end)", "inside of an event's `when`");
  expect("", "a call from the function of a sequence{...}", "controller { name = 'c', rate = 1, step = function(t) wait(1) end }\n");
}

}  // namespace
}  // namespace cardan
