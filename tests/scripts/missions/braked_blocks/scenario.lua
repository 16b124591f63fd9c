-- Blocks that friction [Coulomb 1785] slows down alike, at 2 m/s^2, from other speeds and both ways: one that comes to rest stops none of the others.
local sat = vehicle "vehicle.yaml"
mission { duration = "3 s", integrator = { relative = 1e-9 }, output = { rate = "10 Hz" } }
for name, v in pairs { first = 1, back = -2, last = 3 } do
  local block = sat:hinge(name)
  check { name = name .. " goes v^2 / 2 a", unit = "m", value = function() return block:q() end, equal = { v * math.abs(v) / 4, tolerance = 1e-9 } }
  check { name = name .. " rests", unit = "m/s", value = function() return block:v() end, equal = { 0, tolerance = 1e-12 } }
end
