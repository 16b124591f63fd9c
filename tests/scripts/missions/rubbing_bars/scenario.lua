-- Five bars with friction [Coulomb 1785] come to rest at once, and three of them slide on at once: which hold and which slide is the one answer of a
-- quadratic program, that of the least sum of Gauss [1829]. One joint let go after the other, and held again where its friction would push it along, goes
-- round in circles here, unless they are tried in turn [Murty 1974]. Angles and rates at the end are those of a program of its own that solves the quadratic
-- program in each step (10 digits).
local sat = vehicle "vehicle.yaml"
mission { duration = "0.25 s", integrator = { method = "dop853", relative = 1e-11 }, output = { rate = "10 Hz" } }
local angles = { 0.6965852052, 1.0277933912, 1.3819195135, 0.7329870099, 1.1713476782 }
local rates = { -1.0268076095, 0, 0.1766104331, 0, -2.2814495628 }
for i = 1, 5 do
  local hinge = sat:hinge("m" .. i - 1)
  check { name = "angle " .. i, unit = "rad", value = function() return hinge:angle() end, equal = { angles[i], tolerance = 1e-9 } }
  check { name = "rate " .. i, unit = "rad/s", value = function() return hinge:rate() end, equal = { rates[i], tolerance = 1e-8 } }
end
