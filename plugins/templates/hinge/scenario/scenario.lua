-- Without forces the kinetic energy stays: ((J + m |p'|^2) rate^2) / 2, so the rate is known wherever the slider is.
plugin "@NAME@.so"
local track = (vehicle "vehicle.yaml"):hinge "slider"
mission { duration = "20 s", integrator = { relative = 1e-10 } }
initial { slider = { rate = "30 deg/s" } }

local function inertia(q) return 0.1 + 2 * ((2 * math.sin(q)) ^ 2 + (0.5 * math.cos(q)) ^ 2) end
check {
  name = "the rate is that of the same energy", unit = "rad/s", below = 1e-6,
  value = function() return math.abs(track:rate() - math.rad(30) * math.sqrt(inertia(0) / inertia(track:angle()))) end,
}
