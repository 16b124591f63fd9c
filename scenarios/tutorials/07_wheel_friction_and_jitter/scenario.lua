-- A reaction wheel whose motor is off runs down by the friction of its bearing. Its mass centre is 10 um off its axis, so that it shakes the
-- satellite with its own frequency and the square of it: jitter. The motion is planar, and exact formulas hold for all of it (README.md).

local M, m, e = 95, 5, 1e-5                       -- as in vehicle.yaml, SI
local Jb, J = 8, 0.05 + M * m / (M + m) * e ^ 2   -- [kg m^2] about the axis: bus, wheel with what the offset adds
local v0, coulomb, viscous = 100, 0.1, 5e-4

local rate = viscous * (1 / J + 1 / Jb)            -- [1/s] of the run-down
local limit = coulomb / viscous                    -- [rad/s]
local stop_time = math.log(1 + v0 / limit) / rate

local sat = vehicle "vehicle.yaml"
local bus, wheel, node = sat:body "bus", sat:hinge "wheel", sat:node "bus"

mission {
  title = "a wheel runs down and shakes its satellite",
  duration = 50,
  integrator = { method = "dopri5", relative = 1e-11, absolute = 1e-14 },
  output = { rate = "100 Hz", nodes = { "bus" } },
}

-- Rate of the wheel in the bus; place and acceleration of the bus.
local function truth(t)
  local fade = math.exp(-rate * t)
  local v = (v0 + limit) * fade - limit
  local turned = (v0 + limit) * (1 - fade) / rate - limit * t
  local angle = (J * v0 * t + Jb * turned) / (J + Jb)             -- of the wheel in the world
  local w, w_dot = (J * v0 + Jb * v) / (J + Jb), -Jb * rate * (v0 + limit) * fade / (J + Jb)
  local c, s, a = math.cos(angle), math.sin(angle), m / (M + m) * e
  return v, { a * (1 - c), a * (v0 * t - s), 0 }, { a * (w * w * c + w_dot * s), a * (w * w * s - w_dot * c), 0 }
end

local log = signals {
  ["truth/wheel_rate"] = { unit = "rad/s", meaning = "rate of the wheel by the closed form" },
  ["truth/acceleration"] = { unit = "m/s^2", components = { "x", "y" }, meaning = "acceleration of the bus by the closed form" },
}
local worst = persist { rate = 0, place = 0, acceleration = 0, largest = 0 }
local function see(name, x) if not (x <= worst[name]) then worst[name] = x end end   -- a NaN stays
controller {
  name = "comparison", rate = "100 Hz",
  step = function(t)
    local v, place, acceleration = truth(t)
    if v < 3 then return end                       -- 30 times the width over which friction is smoothed about zero
    see("rate", math.abs(wheel:rate() - v))
    see("place", vec.norm(vec.sub({ bus:position() }, place)))
    see("acceleration", vec.norm(vec.sub({ node:acceleration() }, acceleration)))
    see("largest", vec.norm { node:acceleration() })
    log["truth/wheel_rate"](v)
    log["truth/acceleration"](acceleration[1], acceleration[2])
  end,
}

figure { name = "time to stop", unit = "s", value = function() return stop_time end }
figure { name = "largest jitter", unit = "m/s^2", value = function() return worst.largest end }

-- Some 2000 rad at 1e-11 in each step.
check { name = "wheel runs down", unit = "rad/s", value = function() return worst.rate end, below = 1e-7 }
check { name = "place of the bus", unit = "m", value = function() return worst.place end, below = 1e-12 }
-- e m / (M + m) v^2 = 5 mm/s^2, turned by the error of the angle
check { name = "acceleration of the bus", unit = "m/s^2", value = function() return worst.acceleration end, below = 1e-8 }
-- Both turn together then, with the momentum that the wheel had.
check { name = "wheel at rest in the bus at the end", unit = "rad/s", value = function() return wheel:rate() end, within = { -1e-6, 1e-6 } }
check {
  name = "rate of the bus at the end", unit = "rad/s", equal = { J * v0 / (J + Jb), tolerance = 1e-5 },
  value = function() local _, _, w = bus:rate() return w end,
}
