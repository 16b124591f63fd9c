-- Ten years towards the Earth, with a controller every hundred seconds: three million ticks, and none may be lost.

local sat = vehicle "vehicle.yaml"
local bus, hinge = sat:body "bus", sat:hinge "bus"
local inertia, orbit = 1200, 2 * math.pi / 5700       -- [kg m^2] about z, as in vehicle.yaml; [rad/s]
local tick, year, years = 100, 365.25 * 86400, 10     -- [s]

-- Sun and panels push with the year, held from tick to tick as the torque of the controller is. Angle and rate off the Earth are
-- held with both poles of the sampled system at 0.9.
local function push(t) return 1e-4 * math.sin(2 * math.pi * t / year) end
local pole = 0.9
local k = inertia * (1 - pole) ^ 2 / tick ^ 2
local c = inertia * (2 * (1 - pole) - (1 - pole) ^ 2 / 2) / tick
local function law(t, angle, rate) return push(t) - k * angle - c * rate end

initial { bus = { angular_velocity = { 0, 0, orbit } } }
mission {
  title = "ten years of attitude",
  duration = years * year,
  integrator = { method = "dopri5", relative = 1e-9 },
  output = { period = 10 * 86400 },
}
-- Beside the vehicle goes the sampled system: what a constant torque does in a tick is in closed form.
local seen = persist { ticks = 0, last = 0, angle = 0, rate = 0, off = 0, most = 0 }
controller {
  name = "wheels", period = tick,
  step = function(t)
    local w, x, y, z = bus:attitude()
    local _, _, wz = bus:rate()
    local angle, rate = math.fmod(2 * math.atan(z, w) - orbit * t, 2 * math.pi), wz - orbit
    if angle > math.pi then angle = angle - 2 * math.pi elseif angle < -math.pi then angle = angle + 2 * math.pi end
    local off = math.max(math.abs(angle - seen.angle), math.abs(x), math.abs(y))
    if not (off <= seen.off) then seen.off = off end    -- a NaN stays
    if not (math.abs(angle) <= seen.most) then seen.most = math.abs(angle) end
    hinge:torque(law(t, angle, rate), "wz")
    local acceleration = law(t, seen.angle, seen.rate) / inertia
    seen.angle = seen.angle + tick * (seen.rate + tick / 2 * acceleration)
    seen.rate = seen.rate + tick * acceleration
    seen.ticks, seen.last = seen.ticks + 1, t
  end,
}
figure { name = "largest angle off the Earth", unit = "rad", value = function() return seen.most end }
-- The phase of the orbit, 3.5e5 rad at the end, has 3e-11 rad left in a double number; what a tick adds is corrected by the next ones.
check { name = "beside the sampled system", unit = "rad", value = function() return seen.off end, below = 3e-10 }
check { name = "ticks, at both ends too", value = function() return seen.ticks end, equal = { years * year / tick + 1, tolerance = 0 } }
check { name = "last tick", unit = "s", value = function() return seen.last end, equal = { years * year, tolerance = 0 } }
