-- A shadow of 20 s in a step of minutes: its width over the speed is what the push of the light lacks.
local sat = vehicle "vehicle.yaml"
mission { duration = "1000 s", integrator = { method = "cvode_adams", relative = 1e-9 }, output = { rate = "0.001 Hz" } }
local push = 1361 / 299792458 * 1000 * 1.3 / 2
check { name = "in the shadow", unit = "s", value = function() return 1000 + sat:body "ball":velocity() / push end, equal = { 20, tolerance = 2e-4 } }
