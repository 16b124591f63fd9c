-- What air takes from a circular orbit, and how the gradient of gravity turns the axis of a spinning satellite, in half a day.
local sat = vehicle "vehicle.yaml"
local mu, r, R, day = 398600.4418e9, 6778137, 7e6, 43200
mission { duration = day, integrator = { method = "dop853", relative = 1e-11 }, output = { period = "10 min" } }
local n, spin, lean = math.sqrt(mu / R ^ 3), 0.05, math.rad(30)
initial {
  ball = { position = { r, 0, 0 }, velocity = { 0, math.sqrt(mu / r), 0 } },
  top = { position = { R, 0, 0 }, velocity = { 0, n * R, 0 }, orientation = { axis = { 1, 0, 0 }, angle = lean }, angular_velocity = { 0, 0, spin } },
}
-- a' = -rho Cd A / m sqrt(mu a) [King-Hele 1964], where a turn takes little of the scale height: 1e-3 here.
local a, dt = r, day / 1000
local function rate(x) return -1e-11 * math.exp(-(x - 6778137) / 60e3) * 2.2 * 2 / 100 * math.sqrt(mu * x) end
for _ = 1, 1000 do
  local k1 = rate(a)
  local k2 = rate(a + dt / 2 * k1)
  local k3 = rate(a + dt / 2 * k2)
  a = a + dt / 6 * (k1 + 2 * k2 + 2 * k3 + rate(a + dt * k3))
end
local ball = sat:body "ball"
check { name = "decay", unit = "m", value = function() return orbit.elements({ ball:position() }, { ball:velocity() }, mu).a - r end, equal = { a - r, tolerance = -1e-3 * (a - r) } }

-- The axis goes back round the normal of the orbit at 3/2 n^2 (C - A) / (C w) cos(lean) [Hughes 1986], on average; twice in a turn it nods by that
-- over 2 n, 5e-3, which is what the average leaves out. The slope over seven turns by least squares.
local top = sat:body "top"
local s = persist { n = 0, t = 0, y = 0, tt = 0, ty = 0 }
local turn = 2 * math.pi / n
controller { name = "axis", period = "20 s", step = function(t)
  if t > 7 * turn then return end
  local z = quat.rotate({ top:attitude() }, { 0, 0, 1 })
  local back = math.atan(-z[1], -z[2])                       -- 0 at the start
  s.n, s.t, s.y, s.tt, s.ty = s.n + 1, s.t + t, s.y + back, s.tt + t * t, s.ty + t * back
end }
local regression = 1.5 * n ^ 2 * (120 - 80) / 120 / spin * math.cos(lean)
check { name = "regression", unit = "rad/s", value = function() return (s.n * s.ty - s.t * s.y) / (s.n * s.tt - s.t ^ 2) end, equal = { regression, tolerance = 5e-3 * regression } }
