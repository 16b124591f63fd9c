-- A slender block that falls back on its other edge [Housner 1963]: momentum about the edge that it comes to leaves it r = 1 - 2 m R^2 sin^2 a / I of its
-- rate, and what it then rises to follows from energy, cos(a - tilt) - cos a being r^2 of what it was.
local sat = vehicle "vehicle.yaml"
mission { duration = "1.1 s", integrator = { method = "cvode_bdf", relative = 1e-10 }, output = { rate = "50 Hz" } }
local m, a, R = 100, math.atan(0.4), math.sqrt(0.29)
local r = 1 - 2 * m * R ^ 2 * math.sin(a) ^ 2 / (9.7 + m * R ^ 2)
local tilt = 0.5 * a
initial { block = { orientation = { axis = { 0, 1, 0 }, angle = tilt }, position = { 0.2 - R * math.sin(a - tilt), 0, R * math.cos(a - tilt) } } }
local function next_peak(peak) return a - math.acos(math.cos(a) + r ^ 2 * (math.cos(a - peak) - math.cos(a))) end

local seen = persist { least = 0, most = 0 }
controller {
  name = "look", rate = "100 Hz",
  step = function(t)
    local q = { sat:body "block":attitude() }
    local now = 2 * math.atan(q[3], q[1])
    seen.least = math.min(seen.least, now)
    if t > 0.6 then seen.most = math.max(seen.most, now) end
  end,
}
-- The floor gives by 3.3e-4 m under the weight on an edge 0.2 m from the middle: 1.6e-3 rad.
local second = next_peak(tilt)
check { name = "to the other side", unit = "rad", value = function() return -seen.least end, equal = { second, tolerance = 1.6e-3 } }
check { name = "and back", unit = "rad", value = function() return seen.most end, equal = { next_peak(second), tolerance = 1.6e-3 } }
