-- A crank of a parallelogram and the turn of a shaft that slides as well are given, with a rate from the start on. What nothing is given
-- for begins with the rates that go with them, as if these were `initial` rates; the bus, which has one, keeps it.
local sat = vehicle "vehicle.yaml"
local bus = sat:body "bus"
mission { duration = 1 }
sat:hinge "crank":profile { hold = 2 }
sat:hinge "shaft":profile { hold = 1.5, component = "rate" }
local began = persist {}
controller { name = "looks", rate = "1 Hz", step = function(t)
  if t > 0 then return end
  local function v(name, c) return sat:hinge(name):v(c) end
  local _, _, turn = bus:rate()
  began.rates = { v "coupler", v "rocker", v "drum", v("shaft", "speed") + v "nut", turn, vec.norm { bus:velocity() } }
end }
for i, rate in ipairs { -2, 2, 3, 0.15, 0.3, 0 } do
  check { name = "rate at the start " .. i, value = function() return began.rates[i] end, equal = { rate, tolerance = 1e-13 } }
end
-- The shaft slides and the nut comes towards it by the least of m (s^2 + n^2), s + n = 0.15: alike, as they are of one mass.
check { name = "angle of the drum", unit = "rad", value = function() return sat:hinge "drum":q() end, equal = { 3, tolerance = 1e-12 } }
