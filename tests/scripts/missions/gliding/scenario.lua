-- Nothing acts and nothing turns: v' is zero, and the dense twin, whose velocity terms cancel up to rounding, says so too.
local sat = vehicle "vehicle.yaml"
mission { title = "a spacecraft that glides", duration = "2 s", output = { rate = "5 Hz" } }
check { name = "way", unit = "m", value = function() return (sat:body("bus"):position()) end, equal = { 15000, tolerance = 1e-8 } }
