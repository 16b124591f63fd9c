-- A block that slides on a rail under 1.2 N against 1 N of friction is caught by another one that comes towards it as fast: together they stand still, and what then rests holds, up to
-- 1.5 N [Coulomb 1785].
local sat = vehicle "vehicle.yaml"
mission { duration = "3 s" }
local a, b = sat:hinge "a", sat:hinge "b"
a:force(1.2)
b:force(-0.2)
event { name = "meet", once = true, direction = "rising", when = function(t) return t - 1 end, action = function() b:force(0) sat:attach("b", { to = "a", as_found = true }) end }
check { name = "place", unit = "m", value = function() return a:q() end, equal = { 1.1, tolerance = 1e-9 } }
check { name = "stands still", unit = "m/s", value = function() return a:v() end, equal = { 0 } }
check { name = "holds", value = function() return sat:device("rubs"):get "sticks" end, equal = { 1 } }
