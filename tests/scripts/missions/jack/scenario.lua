-- A jack pushes two floating bodies apart while one of them loses a part of its mass, with the velocity that it has, and a flap is locked, and is told to stop: its length goes on as a function of time, and
-- momentum [Newton 1687] tells where the other one is.
local sat = vehicle "vehicle.yaml"
local head, foot, jack = sat:hinge "head", sat:body "foot", sat:loop "jack"
mission { duration = 2, output = { rate = "10 Hz" } }
jack:profile { rate_table = { { 0, 0 }, { 0.5, 0.1 }, { 10, 0.1 } } }
event { name = "lighter", when = function(t) return t - 0.7 end, direction = "rising", once = true, action = function() sat:change { ["bodies.head.mass"] = "0.25 kg" } end }
event { name = "locked", when = function(t) return t - 1.2 end, direction = "rising", once = true, action = function() sat:lock "flap" end }
event { name = "slower", when = function(t) return t - 1.6 end, direction = "rising", once = true, action = function() jack:profile { rate_table = { { 1.6, 0.1 }, { 1.8, 0 } } } end }
-- 0.445 m at 0.7 s; what is then left of the vehicle goes on with the mean of -0.1 / 3 and 0.2 / 3 m/s.
local length, mean = 0.4 + 0.025 + 0.11 + 0.01, (2 * -0.1 + 0.75 * 0.2) / 3 / 2.75
check { name = "length", unit = "m", value = function() return head:q() end, equal = { length, tolerance = 1e-12 } }
check { name = "place of the foot", unit = "m", value = function() return (foot:position()) end, equal = { -0.045 / 3 + 1.3 * mean - (length - 0.445) * 0.75 / 2.75, tolerance = 1e-12 } }
