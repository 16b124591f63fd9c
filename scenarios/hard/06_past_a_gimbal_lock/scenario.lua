-- A body turns uniformly and passes the lock of its gimbals at 1e-6 rad: two of them turn at 1e5 rad/s there, half a turn within some 1e-5 s, to cancel each other.

local p = parameters { miss = "1e-6 rad" }
local sat = vehicle "vehicle.yaml"
local gimballed, free = sat:body "gimballed", sat:body "free"
local rate, t_lock = 0.1, 10                          -- [rad/s], [s]

-- R = Rx(miss) Ry(a): the x axis of the body passes the axis of the first gimbal, z, at `miss`.
local function angle(t) return math.pi / 2 + rate * (t - t_lock) end
local function attitude(t)
  local sx, cx, sy, cy = math.sin(p.miss / 2), math.cos(p.miss / 2), math.sin(angle(t) / 2), math.cos(angle(t) / 2)
  return { cx * cy, sx * cy, cx * sy, sx * sy }
end
local s, c, sa, ca = math.sin(p.miss), math.cos(p.miss), math.sin(angle(0)), math.cos(angle(0))
local pitch, roll = math.atan(c * sa, math.sqrt(ca ^ 2 + (s * sa) ^ 2)), math.atan(s, c * ca)
initial {
  gimballed = {
    angle_1 = math.atan(s * sa, ca), angle_2 = pitch, angle_3 = roll,
    rate_1 = rate * math.sin(roll) / math.cos(pitch), rate_2 = rate * math.cos(roll), rate_3 = rate * math.sin(roll) * math.tan(pitch),
  },
  free = { attitude = attitude(0), angular_velocity = { 0, rate, 0 } },
}
mission {
  title = "past the lock of gimbals at 1e-6 rad",
  duration = 20,
  integrator = { method = "dop853", relative = 1e-8 },
  output = { period = 0.5 },
}

local worst = persist { before = 0, after = 0, rate = 0, free = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", period = 0.5,
  step = function(t)
    local x, y, z = gimballed:rate()
    see(t < t_lock and "before" or "after", vec.norm(quat.error(attitude(t), { gimballed:attitude() })))
    if t > t_lock then see("rate", vec.norm { x, y - rate, z }) end
    see("free", vec.norm(quat.error(attitude(t), { free:attitude() })))
  end,
}
-- Some tens of steps of 1e-8.
check { name = "attitude before the lock", unit = "rad", value = function() return worst.before end, below = 1e-7 }
-- H* of the gimbals has a condition number of 1 / miss at the lock, D that number squared, 1e12: v' is wrong by some units of round-off, 2e-16,
-- times that, 1e-3 of itself, which is left in the rates, 1e-4 rad/s, and 10 s later ten times that in the attitude.
check { name = "rate after it", unit = "rad/s", value = function() return worst.rate end, below = 1e-4 }
check { name = "attitude after it", unit = "rad", value = function() return worst.after end, below = 1e-3 }
-- The ball turns uniformly, in the steps that the gimbals ask for.
check { name = "attitude of the same body on a quaternion", unit = "rad", value = function() return worst.free end, below = 1e-9 }
