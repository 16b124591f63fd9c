-- A box lies on its four corners, 1e8 N/m each: it stays as deep as its weight presses it, m g / 4 k = 49 nm.
local sat = vehicle "vehicle.yaml"
mission { duration = "0.2 s", integrator = { method = "ark_implicit", relative = 1e-9 }, output = { rate = "10 Hz" } }
check { name = "depth, over m g / 4 k", value = function() return sat:device("floor"):get "gap" / -(2 * 9.81 / 4e8) end, equal = { 1, tolerance = 0.05 } }
