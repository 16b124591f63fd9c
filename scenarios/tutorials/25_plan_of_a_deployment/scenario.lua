-- A plan from top to bottom: two panels are let go one after the other; the second one is too slow, and the plan takes its other branch. When each
-- step happens is known in closed form (README.md).

local sat = vehicle "vehicle.yaml"
local right, left = sat:hinge "right", sat:hinge "left"

mission {
  title = "a deployment by plan",
  duration = "80 s",
  integrator = { method = "dop853", relative = 1e-11 },
  output = { rate = "10 Hz" },
}

local m = persist { quiet = 0 }

local function abort(panel)
  return function()
    m.aborted = mission.time()
    sat:lock(panel)                                       -- where it is
    wait "5 s"
    mission.enter "safe"
    m.safe = mission.time()
  end
end

local plan = sequence {
  name = "deployment",
  run = function()
    at "10 s"
    sat:unlock "right"
    wait_until(function() return right:angle() end, { direction = "falling", timeout = "30 s", otherwise = abort "right" })
    m.out, m.rate = mission.time(), right:rate()
    sat:lock "right"

    wait_until(function() return m.quiet >= 20 end, { rate = "2 Hz", timeout = "30 s", otherwise = abort "right" })
    m.settled = mission.time()
    sat:unlock "left"
    wait_until(function() return left:angle() - math.rad(2) end, { direction = "falling", timeout = "40 s", otherwise = abort "left" })
    sat:lock "left"
    mission.enter "operations"
  end,
}
phase { name = "deployment" }
phase { name = "operations" }
phase { name = "safe" }

controller {                                              -- what the plan waits for by looking
  name = "telemetry", rate = "10 Hz",
  step = function() if m.out and math.abs(right:rate()) < 1e-6 then m.quiet = m.quiet + 1 end end,
}

-- Hinges on a stand: I a'' + c a' + k a = 0 from rest at 90 deg.
local I, k, c, start = 3.3 + 12 * 0.9 ^ 2, 0.4, 12, math.rad(90)
local w = math.sqrt(k / I)
local out = 10 + math.pi / (2 * w)
local settled = math.ceil(2 * (math.ceil(10 * out) + 19) / 10) / 2     -- 20 ticks of 0.1 s, looked at every 0.5 s
local root = math.sqrt(c * c - 4 * k * I)
local r1, r2 = (-c + root) / (2 * I), (-c - root) / (2 * I)
local function slow(t) return start * (r2 * math.exp(r1 * t) - r1 * math.exp(r2 * t)) / (r2 - r1) end

check { name = "first panel is out", unit = "s", value = function() return m.out end, equal = { out, tolerance = 1e-8 } }
check { name = "its rate there", unit = "rad/s", value = function() return m.rate end, equal = { -w * start, tolerance = 1e-9 } }
check { name = "looked at to the tick", unit = "s", value = function() return m.settled end, equal = { settled } }
check { name = "given up in time", unit = "s", value = function() return m.aborted end, equal = { settled + 40 } }
check { name = "angle where it was given up", unit = "deg", value = function() return math.deg(left:angle()) end, equal = { math.deg(slow(40)), tolerance = 1e-7 } }
check { name = "safe", unit = "s", value = function() return m.safe end, equal = { settled + 45 } }
check { name = "in its last phase", value = function() return mission.phase() == "safe" and plan:state() == "ended" and 1 or 0 end, equal = { 1 } }
