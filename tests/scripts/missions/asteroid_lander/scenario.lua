-- A lander at rest on an asteroid that turns: what its feet carry is its weight by the closed form of a box (Nagy 1966), less what the turning takes.
local sat = vehicle "vehicle.yaml"
mission { duration = "300 s", integrator = { method = "cvode_bdf", relative = 1e-12 }, output = { rate = "0.5 Hz" } }
local w, r = 3.4906585e-4, { 1000 - 2.4e-4, 100, 50 }
initial { lander = { position = r, velocity = { -w * r[2], w * r[1], 0 }, orientation = { axis = { 0, 1, 0 }, angle = "90 deg" }, rate = { -w, 0, 0 } } }

local mu, edges = 142.5, { 2000, 1000, 800 }
--- Pull of the box at x along axis i, box axes.
local function pull(x, i)
  local j, k, sum = i % 3 + 1, (i + 1) % 3 + 1, 0
  for n = 0, 7 do
    local X = (n & 1 == 0 and -0.5 or 0.5) * edges[i] - x[i]
    local Y = (n & 2 == 0 and -0.5 or 0.5) * edges[j] - x[j]
    local Z = (n & 4 == 0 and -0.5 or 0.5) * edges[k] - x[k]
    local R = vec.norm { X, Y, Z }
    local odd = (n & 1 ~ n >> 1 & 1 ~ n >> 2 & 1) == 1
    sum = sum + (odd and -1 or 1) * (Y * math.log(Z + R) + Z * math.log(Y + R) - X * math.atan(Y * Z / (X * R)))
  end
  return mu / (edges[1] * edges[2] * edges[3]) * sum
end

local lander, feet = sat:body "lander", sat:device "feet"
--- Weight at the mass centre, in axes that turn with the rock, which the feet hold.
local function weight()
  local turned = quat.from_axis_angle({ 0, 0, 1 }, -sat:hinge "surface":angle())
  local com = vec.add({ lander:position() }, quat.rotate({ lander:attitude() }, { 0.02, -0.01, 0.25 }))
  local x = quat.rotate(turned, com)
  return { 12 * (pull(x, 1) + w * w * x[1]), 12 * (pull(x, 2) + w * w * x[2]), 12 * pull(x, 3) }
end
check { name = "closed form far away", value = function() return pull({ 1e6, 0, 0 }, 1) * 1e12 / mu + 1 end, within = { -1e-5, 1e-5 } }
check { name = "normal force", value = function() return feet:get "force" / -weight()[1] - 1 end, within = { -3e-6, 3e-6 } }
check { name = "friction", value = function() local f = weight() return feet:get "friction" / vec.norm { 0, f[2], f[3] } - 1 end, within = { -1e-6, 1e-6 } }
figure { name = "weight", unit = "N", value = function() return -weight()[1] end }
