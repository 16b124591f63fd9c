-- A rack with a stop on either side, both at one place: the spring of the one lets go of it just where the other is struck and throws it back with half its
-- rate [Newton 1687], so that it goes half as deep the next time.
local sat = vehicle "vehicle.yaml"
local w = math.sqrt(100 / 0.81 / (1 + 3 / 0.81))
mission { duration = 1.5 * math.pi / w, integrator = { method = "dop853", relative = 1e-11 }, output = { rate = "10 Hz" } }
initial { a = { rate = -0.03 * w }, b = { rate = 0.03 / 0.9 * w } }
local a = sat:hinge "a"
check { name = "rack", unit = "m", value = function() return a:q() end, equal = { 0.025, tolerance = 1e-10 } }
