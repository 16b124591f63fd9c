-- A jack pushes two floating bodies apart while one of them loses a part of its mass, with the velocity that it has, and a flap is locked: its length goes on as a function of time, and
-- momentum [Newton 1687] tells where the other one is.
local sat = vehicle "vehicle.yaml"
local head, foot, jack = sat:hinge "head", sat:body "foot", sat:loop "jack"
mission { duration = 2, output = { rate = "10 Hz" } }
jack:profile { rate_table = { { 0, 0 }, { 0.5, 0.1 }, { 10, 0.1 } } }
event { name = "lighter", when = function(t) return t - 0.7 end, direction = "rising", once = true, action = function() sat:change { ["bodies.head.mass"] = "0.25 kg" } end }
event { name = "locked", when = function(t) return t - 1.2 end, direction = "rising", once = true, action = function() sat:lock "flap" end }
check { name = "length", unit = "m", value = function() return head:q() end, equal = { 0.575, tolerance = 1e-12 } }
check { name = "place of the foot", unit = "m", value = function() return (foot:position()) end, equal = { -0.045 / 3 - 1.3 * 0.1 / 3, tolerance = 1e-12 } }
