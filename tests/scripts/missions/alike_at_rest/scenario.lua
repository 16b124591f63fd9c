-- Three four-bars that are alike but for 1e-12 of their rates come to rest together under friction that sticks [Coulomb 1785], are asked for more than it holds,
-- turn back together, and so on until they stay: which of them is first is the error of the steps.
local sat = vehicle "vehicle.yaml"
local p = parameters { method = "cvode_bdf" }
mission { duration = "6 s", integrator = { method = p.method, relative = 1e-9 }, output = { rate = "10 Hz" } }
local first = sat:hinge "crank0"
for i = 1, 2 do
  local other = sat:hinge("crank" .. i)
  check { name = "crank" .. i .. " beside crank0", unit = "rad", value = function() return other:angle() - first:angle() end, equal = { 0, tolerance = 1e-6 } }
end
check { name = "they have come to rest", unit = "rad/s", value = function() return first:rate() end, equal = { 0, tolerance = 1e-12 } }
check { name = "and have turned back", unit = "rad", value = function() return first:angle() end, below = -1.2 }
