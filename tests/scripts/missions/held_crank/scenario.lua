-- Five bars whose crank a brake holds [Coulomb 1785] are four, and pass the dead centre of their rocker as those with a crank that is locked: at one instant nothing that
-- pushes at the rocker moves it, and what it turns back by is the square of rates.
local sat = vehicle "vehicle.yaml"
mission { duration = "0.4 s", integrator = { method = "dop853", relative = 1e-11 }, output = { rate = "100 Hz" } }
local turned = persist { back = 0 }
event { name = "dead centre", direction = "falling", when = function() return sat:hinge "a3":angle() end, action = function() turned.back = turned.back + 1 end }
check { name = "dead centres", value = function() return turned.back end, above = 0.5 }
check { name = "crank stays", unit = "rad", value = function() return sat:hinge "a0":angle() end, equal = { -0.5, tolerance = 0 } }
for i = 1, 3 do
  check { name = "bar " .. i, unit = "rad", value = function() return sat:hinge("a" .. i):angle() - sat:hinge("b" .. i):angle() end, equal = { 0, tolerance = 1e-9 } }
end
