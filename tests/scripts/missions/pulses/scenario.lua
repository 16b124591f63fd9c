-- Pulses: the limit cycle of an attitude that is held between two limits, and a transfer by two of them [Hohmann 1925].
local sat = vehicle "vehicle.yaml"
local mu, r1, half = 398600.4418e9, 7000e3, 3900                          -- [s] on the way, a tick of the thrusters
local a = (mu * (half / math.pi) ^ 2) ^ (1 / 3)
local r2 = 2 * a - r1
local v1, v2 = math.sqrt(mu / r1), math.sqrt(mu / r2)
mission { duration = "10000 s", integrator = { method = "dop853", relative = 1e-11 }, output = { period = "10 s" } }
local place, velocity = orbit.state({ a = r1, anomaly = -1000 * v1 / r1 }, mu)     -- on the x axis at the first pulse, after 1000 s
initial { tug = { position = place, velocity = velocity } }

-- A bit changes the rate by twice what it is: from one limit to the other and back.
local held, limit = sat:hinge "held", math.rad(0.2)
local plus, minus = sat:device "plus", sat:device "minus"
local seen = persist { n = 0 }
controller { name = "hold", rate = "5 Hz", step = function(t)
  local angle, rate = held:angle(), held:rate()
  local low, high = angle < -limit and rate < 0, angle > limit and rate > 0
  if t - (seen.fired or -1) < 0.5 then low, high = false, false end       -- the bit comes at the next tick
  plus:set("fire", low and 1 or 0)
  minus:set("fire", high and 1 or 0)
  if low or high then seen.fired = t end
  if high then seen.first, seen.last, seen.n = seen.first or t, t, seen.n + 1 end
end }
-- Each end of the cycle is late by at most two ticks of 0.2 s, which lengthens the way there and that back.
check { name = "period of the limit cycle", unit = "s", value = function() return (seen.last - seen.first) / (seen.n - 1) end, within = { 4 * limit / 2e-4, 4 * limit / 2e-4 + 1.6 } }

-- Half an ellipse after the first pulse the tug is on the other side, where the second makes a circle of it.
local kick, back, tug = sat:device "kick", sat:device "back", sat:body "tug"
local function pulse(device, dv)                            -- at the next tick
  device:set("fire", dv * 500 / 1e6)
  wait(1)
  device:set("fire", 0)
end
sequence {
  name = "transfer",
  run = function()
    at(999.5)
    pulse(kick, math.sqrt(mu * (2 / r1 - 1 / a)) - v1)
    at(999.5 + half)
    pulse(back, v2 - math.sqrt(mu * (2 / r2 - 1 / a)))
  end,
}
-- 1e-11 of 1e7 m, some hundred times.
local function elements() return orbit.elements({ tug:position() }, { tug:velocity() }, mu) end
check { name = "radius of the circle", unit = "m", value = function() return elements().a end, equal = { r2, tolerance = 0.01 } }
check { name = "eccentricity", value = function() return elements().e end, below = 1e-9 }
