-- A panel begins locked and is let go: its balances are judged by the tolerances of what moves then, of which there was nothing before.
local sat = vehicle "vehicle.yaml"
mission { duration = 3, integrator = { method = "cvode_bdf", relative = 1e-9 }, output = { rate = "10 Hz" } }
sequence { name = "let go", run = function() at(1) sat:unlock "panel" end }
local w = math.sqrt(0.4 / (3.3 + 12 * 0.9 ^ 2))
check { name = "rate", unit = "rad/s", value = function() return sat:hinge "panel":rate() end, equal = { -math.pi / 2 * w * math.sin(2 * w), tolerance = 1e-7 } }
