-- On a rope, let go a little above where it is taut: it falls for a short while once in each swing, between which it turns by twice
-- pi - atan(v / (W stretch)). Let go just where it is taut, it swings.
local sat = vehicle "vehicle.yaml"
mission { duration = "20 s", integrator = { method = "dop853", relative = 1e-9 }, output = { rate = "0.05 Hz" } }
local g, m = 9.81, 2
local W, drop = math.sqrt(200 / m), 1e-4
local stretch, v = g / W ^ 2, math.sqrt(2 * g * drop)
local far, taut, fall = math.sqrt(stretch ^ 2 + (v / W) ^ 2), 2 * (math.pi - math.atan(v / W, stretch)) / W, 2 * v / g
local t = (20 - fall / 2) % (taut + fall) -- since it was taut last
local down = far * math.cos(W * (t - taut / 2)) + stretch
check { name = "it is taut then", value = function() return t < taut and 1 or 0 end, equal = { 1 } }
check { name = "on a rope that is slack at times", unit = "m", value = function() return sat:hinge "hung":q() end, equal = { -down, tolerance = 1e-6 } }
check { name = "on one that is not", unit = "m", value = function() return sat:hinge "at_its_length":q() end, equal = { -stretch * (1 - math.cos(W * 20)), tolerance = 1e-6 } }
