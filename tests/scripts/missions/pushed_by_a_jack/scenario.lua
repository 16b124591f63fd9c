-- A cart that a jack pushes off, evenly faster up to 0.53 s and then at 0.1 m/s, with a mass on a spring: it follows the acceleration, whose corner lies within what would be one step.
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = "rk4", step = "0.02 s" }, output = { rate = "0.5 Hz" } }
sat:loop("jack"):profile { rate_table = { { 0, 0 }, { 0.53, 0.1 }, { 10, 0.1 } } }
local w, a = 2, 0.1 / 0.53
check { name = "cart", unit = "m", value = function() return sat:hinge("cart"):q() end, equal = { 1 + 0.1 * (2 - 0.53 / 2), tolerance = 1e-12 } }
check { name = "bob", unit = "m", value = function() return sat:hinge("bob"):q() end, equal = { a / w ^ 2 * (math.cos(w * 2) - math.cos(w * 1.47)), tolerance = 1e-8 } }
