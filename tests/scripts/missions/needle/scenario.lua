-- A magnet over the equator swings about the field, B = D / r^3, as a pendulum [Gauss 1833]: from rest across it, it is back after 4 K(1/2) / w, w^2 = m B / I.
local sat = vehicle "vehicle.yaml"
local w = math.sqrt(2 * 7.77e15 / 7e6 ^ 3 / 0.05)
mission { duration = 4 * elliptic.K(0.5) / w, integrator = { method = "dop853", relative = 1e-12 }, output = { period = "10 s" } }
local start = quat.from_axis_angle({ 0, 1, 0 }, math.pi / 2)
check { name = "back where it began", unit = "rad", below = 1e-9, value = function() return vec.norm(quat.error(start, { sat:body "magnet":attitude() })) end }
check { name = "at rest there", unit = "rad/s", below = 1e-9, value = function() return vec.norm { sat:body "magnet":rate() } end }

-- A folded tape spring gives the panel, I = 0.1 + 0.5^2, what its moment is worth from straight to folded, after Seffen & Pellegrino [1999].
local function energy(angle)
  local s, th = angle / 0.08, (1 - math.exp(-2)) / (1 + math.exp(-2))
  return 0.08 * (0.1 * (s + math.log((1 + math.exp(-2 * s)) / 2)) + (2 - 0.1 * th) * (math.exp(0.5) - math.exp((1 - s * s) / 2)))
end
local panel, seen = sat:hinge "panel", persist {}
event {
  name = "straight", direction = "falling", once = true, when = function() return panel:angle() end,
  action = function()
    seen.rate = panel:rate()
    sat:lock "panel"
  end,
}
check { name = "rate at which the panel is straight", unit = "rad/s", equal = { -math.sqrt(2 * energy(2.5) / 0.35), tolerance = 1e-9 }, value = function() return seen.rate end }
