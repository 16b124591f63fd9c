-- A top of 1e4 rad/s precesses at 2e-3 rad/s: 1.6e4 turns while its axis moves by a degree.

local body = vehicle("vehicle.yaml"):body "top"
local A, C, weight = 0.1, 0.05, 1 * 9.81 * 0.1        -- about the tip; m g l. As in vehicle.yaml, SI
local spin, tilt = 1e4, math.rad(60)

-- Steady precession: A cos(tilt) p^2 - C spin p + m g l = 0, the slow root; p about the vertical, n about the axis beside it.
local p = 2 * weight / (C * spin + math.sqrt((C * spin) ^ 2 - 4 * A * math.cos(tilt) * weight))
local n = spin - p * math.cos(tilt)
local function about(axis, angle) local q = { math.cos(angle / 2), 0, 0, 0 } q[axis + 1] = math.sin(angle / 2) return q end
local function attitude(t) return quat.multiply(quat.multiply(about(3, p * t), about(1, tilt)), about(3, n * t)) end

initial { top = { attitude = attitude(0), angular_velocity = { 0, p * math.sin(tilt), spin } } }
mission {
  title = "a heavy top of 1e4 rad/s",
  duration = 10,
  integrator = { method = "dop853", relative = 1e-13 },
  output = { period = 0.1 },
}
local worst = persist { axis = 0, turn = 0, rate = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", period = 0.1,
  step = function(t)
    local x, y, z = table.unpack(quat.error(attitude(t), { body:attitude() }))
    see("axis", math.sqrt(x ^ 2 + y ^ 2))
    see("turn", math.abs(z))
    local wx, wy = body:rate()
    see("rate", math.abs(math.sqrt(wx ^ 2 + wy ^ 2) / (p * math.sin(tilt)) - 1))
  end,
}
figure { name = "precession", unit = "rad/s", value = function() return p end }
-- 1e5 rad of spin in some 3e5 steps, each of 1e-13 of a quaternion, in the same sense: 6e-8 rad. What tilts the axis turns with the body and adds up at
-- random, to 1e-10 rad; so do rates of 1e-13 rad/s beside the precession of 2e-3 rad/s.
check { name = "turn about the axis", unit = "rad", value = function() return worst.turn end, below = 1e-7 }
check { name = "direction of the axis", unit = "rad", value = function() return worst.axis end, below = 1e-10 }
check { name = "rate across the axis, relative", value = function() return worst.rate end, below = 1e-7 }
