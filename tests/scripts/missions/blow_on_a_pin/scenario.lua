-- Four bars are held by friction, which would let them go on once they move. Blows on a pin that does not give way move nothing, and the bars stay [Coulomb 1785].
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", integrator = { method = "dopri5", relative = 1e-9 }, output = { rate = "10 Hz" } }
controller { name = "blows", rate = "10 Hz", step = function(t) sat:device("blows"):set("fire", 1) end }
check { name = "crank stands still", unit = "rad/s", equal = { 0, tolerance = 1e-12 }, value = function() return sat:hinge("crank"):v() end }
check { name = "friction holds", unit = "1", equal = { 1, tolerance = 0 }, value = function() return sat:device("rubs"):get "sticks" end }
local start = sat:hinge("crank"):q()
check { name = "crank stays", unit = "rad", equal = { start, tolerance = 1e-12 }, value = function() return sat:hinge("crank"):q() end }
