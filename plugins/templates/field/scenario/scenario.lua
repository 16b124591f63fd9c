-- A circular orbit over an oblate planet: its plane turns about the axis of the planet.
plugin "@NAME@.so"
local sat = vehicle "vehicle.yaml"
local satellite = sat:body "satellite"
local mu, J2, R, a, i = 398600.4418e9, 1.08262668e-3, 6378137, 7000e3, math.rad(60)
local n = math.sqrt(mu / a ^ 3)
local days = 1
mission { duration = days * 86400, output = { rate = "0.01 Hz" }, integrator = { relative = 1e-11 } }
local v = math.sqrt(mu / a)
initial { satellite = { position = { a, 0, 0 }, velocity = { 0, v * math.cos(i), v * math.sin(i) } } }

-- The node goes west by 3/2 n J2 (R / a)^2 cos i [Kozai 1959], to first order in J2.
local function node()
  local r, w = { satellite:position() }, { satellite:velocity() }
  local h = { r[2] * w[3] - r[3] * w[2], r[3] * w[1] - r[1] * w[3] }
  return math.atan(h[1], -h[2])
end
check {
  name = "the node goes west as fast as it should", unit = "rad", below = 1e-3,
  value = function() return math.abs(node() + 1.5 * n * J2 * (R / a) ^ 2 * math.cos(i) * days * 86400) end,
}
