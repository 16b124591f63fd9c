-- A shaft of given motion drives a wheel by a gear and a slide by a cam: its drive gives what all three take, s the angle of the shaft,
--   (J + 9 J_wheel) s'' + m (r cos s) (r cos s)', (r cos s)' = r (cos s s'' - sin s s'^2),
-- and brings in the energy that they have, which the balance of the run must know.
local sat = vehicle "vehicle.yaml"
local shaft, wheel, slide = sat:hinge "shaft", sat:hinge "wheel", sat:hinge "slide"
mission { duration = 2.5, output = { rate = "10 Hz" } }
shaft:profile { rate_table = { { 0, 0 }, { 1, 2 }, { 4, -1 } } }
local s, rate = 1 + 2 * 1.5 - 0.5 * 1.5 ^ 2, 2 - 1.5
check { name = "angle", unit = "rad", value = function() return shaft:q() end, equal = { s, tolerance = 1e-14 } }
check { name = "rate of the wheel", unit = "rad/s", value = function() return wheel:v() end, equal = { -3 * rate, tolerance = 1e-14 } }
check { name = "place of the slide", unit = "m", value = function() return slide:q() end, equal = { 0.1 * math.sin(s), tolerance = 1e-14 } }
check { name = "force of the drive", unit = "N m", value = function() return shaft:applied() end,
        equal = { -(0.06 + 9 * 0.03) - 2 * 0.01 * math.cos(s) * (math.cos(s) + math.sin(s) * rate ^ 2), tolerance = 1e-13 } }
