-- A three-axis-stabilised satellite slews by 30 degrees, rest to rest, on four reaction wheels, and settles, while the drives
-- turn its two flexible wings. The vehicle is in vehicle.yaml; everything that happens is here.

local p = parameters {
  slew_angle = "30 deg",
  slew_axis = { 0.3, 1.0, 0.2 },    -- body axes: mostly pitch, with enough roll and yaw to bend the wings
  slew_time = "240 s",
  settle_time = "160 s",
  wing_turn = "40 deg",             -- how far the drives turn the wings meanwhile
  bandwidth = 0.15,                 -- [rad/s] of the attitude loop; the first bending mode is above it
  damping = 0.9,
  torque_limit = "0.2 N m",         -- of one wheel (data sheet)
}

local sat = vehicle "vehicle.yaml"

mission {
  title = "30 degree slew of a satellite with two flexible wings",
  duration = p.slew_time + p.settle_time,
  integrator = { method = "exponential", relative = 1e-8 },
  output = { rate = "10 Hz", reactions = { "wing_left" }, nodes = { "wing_left.tip" } },
}

local bus = sat:body "bus"
local wheels = {}
for i = 1, 4 do wheels[i] = sat:hinge("wheel_" .. i) end

-- The drives: rate up, turn, rate down; prescribed, so that the torque they need comes out.
local ramp = 20.0
local turn_rate = p.wing_turn / (p.slew_time - ramp)
local drive = { { 0, 0 }, { ramp, turn_rate }, { p.slew_time - ramp, turn_rate }, { p.slew_time, 0 } }
sat:hinge("wing_left"):profile { rate_table = drive }
local opposite = {}
for i, point in ipairs(drive) do opposite[i] = { point[1], -point[2] } end
sat:hinge("wing_right"):profile { rate_table = opposite }

-- Rest-to-rest profile of the angle: a quintic, whose acceleration starts and ends at zero.
local axis = vec.unit(p.slew_axis)
local function reference(t)
  local s = math.min(t / p.slew_time, 1.0)
  local angle = p.slew_angle * s ^ 3 * (10 - 15 * s + 6 * s * s)
  local rate = p.slew_angle / p.slew_time * 30 * s * s * (1 - s) ^ 2
  local accel = p.slew_angle / p.slew_time ^ 2 * 60 * s * (1 - s) * (1 - 2 * s)
  return angle, rate, accel
end

-- Wheel allocation: spin axes in body axes, least-norm shares of a body torque.
local c = 1 / math.sqrt(3)
local spin = { { c, c, c }, { -c, c, c }, { -c, -c, c }, { c, -c, c } }
local inertia = { 10063, 1403, 9742 }   -- [kg m^2] of the whole satellite about its mass centre (`cardan describe`)

local log = signals {
  ["pointing/commanded"] = { components = { "w", "x", "y", "z" }, commands = "bodies/bus/attitude", meaning = "commanded attitude, body into world" },
  ["pointing/error"] = { unit = "deg", meaning = "angle between commanded and true attitude" },
  ["pointing/rate_error"] = { unit = "deg/s", components = { "x", "y", "z" }, meaning = "body rate minus commanded rate" },
  ["wheels/speed"] = { unit = "rpm", components = { "1", "2", "3", "4" }, meaning = "wheel speed relative to the bus" },
  ["wheels/torque"] = { unit = "N m", components = { "1", "2", "3", "4" }, meaning = "motor torque on the wheels" },
}

local seen = persist { error = 0, settled_worst = 0 }   -- [deg] of the attitude, for figures and checks
local settled_from = p.slew_time + p.settle_time - 30

controller {
  name = "attitude",
  rate = "10 Hz",
  step = function(t)
    local angle, rate, accel = reference(t)
    local q, commanded = { bus:attitude() }, quat.from_axis_angle(axis, angle)
    local e = quat.error(commanded, q)      -- rotation vector from commanded to true, body axes
    local wx, wy, wz = bus:rate()
    local w = { wx - rate * axis[1], wy - rate * axis[2], wz - rate * axis[3] }
    local torque = {}
    for i = 1, 3 do
      local k = inertia[i] * p.bandwidth ^ 2
      local d = 2 * p.damping * inertia[i] * p.bandwidth
      torque[i] = inertia[i] * accel * axis[i] - k * e[i] - d * w[i]
    end
    for i = 1, 4 do
      -- least-norm inverse of this pyramid: 3/4 of the projection on each spin axis
      local share = -0.75 * vec.dot(spin[i], torque)
      local command = math.max(-p.torque_limit, math.min(p.torque_limit, share))
      wheels[i]:torque(command)
    end
    seen.error = math.deg(vec.norm(e))
    if t >= settled_from then seen.settled_worst = math.max(seen.settled_worst, seen.error) end
    log["pointing/commanded"](table.unpack(commanded))
    log["pointing/error"](seen.error)
    log["pointing/rate_error"](math.deg(w[1]), math.deg(w[2]), math.deg(w[3]))
    local rpm = 30 / math.pi
    log["wheels/speed"](wheels[1]:rate() * rpm, wheels[2]:rate() * rpm, wheels[3]:rate() * rpm, wheels[4]:rate() * rpm)
    log["wheels/torque"](wheels[1]:applied(), wheels[2]:applied(), wheels[3]:applied(), wheels[4]:applied())
  end,
}

phase { name = "slew", duration = p.slew_time, enter = function() print("slew begins") end }
phase { name = "settle", duration = p.settle_time, enter = function() print("slew ends, settling") end }

event {
  name = "left wing half way",
  when = function() return sat:hinge("wing_left"):angle() - 0.5 * p.wing_turn end,
  direction = "rising",
  action = function(t) print(string.format("left wing half way at t = %.6f s", t)) end,
}

figure { name = "pointing error, final", unit = "deg", value = function() return seen.error end }
figure { name = "pointing error, worst of the last 30 s", unit = "deg", value = function() return seen.settled_worst end }

check { name = "pointing error, final", unit = "deg", value = function() return seen.error end, below = 0.005 }
check { name = "pointing error, worst of the last 30 s", unit = "deg", value = function() return seen.settled_worst end, below = 0.01 }
check {
  name = "largest wheel speed", unit = "rpm", below = 6000,
  value = function()
    local worst = 0
    for i = 1, 4 do worst = math.max(worst, math.abs(wheels[i]:rate()) * 30 / math.pi) end
    return worst
  end,
}
