-- A strut from the pin of an arm to its tip holds nothing: its row is zero but for rounding, and the arm moves as one without it.
local sat = vehicle "vehicle.yaml"
mission { duration = "3 s", integrator = { method = "dop853", relative = 1e-11 } }
local arm, twin = sat:hinge "arm", sat:hinge "twin_arm"
check { name = "angle beside that without a strut", unit = "rad", value = function() return arm:angle() - twin:angle() end, within = { -1e-9, 1e-9 } }
check { name = "it swings", unit = "rad", value = function() return math.abs(twin:angle() - 0.4) end, above = 0.1 }
