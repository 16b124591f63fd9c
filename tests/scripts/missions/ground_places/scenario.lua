-- Devices between a body and a place of the world that is not its origin.
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = "dop853", relative = 1e-12 }, output = { rate = "20 Hz" } }
local g, T = 9.81, 2

-- A bob below the ceiling at 5 m: z = 5 - rest - m g / k + A cos(w t).
local m, k, A = 2, 80, 0.3
local rest = 5 - 1.5 - m * g / k
check { name = "bob", unit = "m", equal = { rest + A * math.cos(math.sqrt(k / m) * T), tolerance = 1e-9 },
  value = function() return select(3, sat:body("bob"):position()) end }

-- A sledge without friction that begins at the depth of its weight: it stays there, and goes g sin(a) t^2 / 2 down the slope.
local a, r, stiffness = math.rad(20), 0.1, 1000
local off = r - 0.5 * g * math.cos(a) / stiffness
local function place(along) return { 10 + off * math.sin(a) + along * math.cos(a), 0, 2 + off * math.cos(a) - along * math.sin(a) } end
local there = place(0.5 * g * math.sin(a) * T ^ 2)
check { name = "sledge", unit = "m", below = 1e-9, value = function()
  local x, y, z = sat:body("sledge"):position()
  return vec.norm { x - there[1], y - there[2], z - there[3] }
end }
initial { bob = { position = { 1, 2, rest + A } }, sledge = { position = place(0) } }
