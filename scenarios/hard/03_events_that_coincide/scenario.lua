-- Two carts roll uniformly: events at one instant, events 1e-9 s apart, one that touches zero and does not cross it, one at the very end.

local sat = vehicle "vehicle.yaml"
local cart, other = sat:hinge "cart", sat:hinge "other"
mission {
  title = "events that coincide, follow at once, and graze",
  duration = 3,
  integrator = { method = "dopri5", relative = 1e-10, max_step = 0.25 },
  output = { period = 0.5 },
}
local seen = persist { list = {} }
local function note(name, when)
  event { name = name, when = when, action = function(t) seen.list[#seen.list + 1] = { name, t } end }
end
note("at 1", function() return cart:q() - 1 end)
note("at 1 too", function() return other:q() + 0.5 end)
note("a nanosecond later", function() return cart:q() - 1 - 1e-9 end)
note("touches zero at 2.1", function() return (cart:q() - 2.1) ^ 2 end)
note("crosses twice, 1e-3 s apart, around 2.25", function() return (cart:q() - 2.25) ^ 2 - 0.25e-6 end)
note("at the end", function() return cart:q() - 3 end)

local function time_of(name)
  for _, e in ipairs(seen.list) do if e[1] == name then return e[2] end end
  return -1
end
check { name = "first event", unit = "s", value = function() return time_of "at 1" end, equal = { 1, tolerance = 1e-12 } }
check { name = "of the same instant", unit = "s", value = function() return time_of "at 1 too" - time_of "at 1" end, equal = { 0, tolerance = 1e-12 } }
check { name = "a nanosecond later", unit = "s", value = function() return time_of "a nanosecond later" - time_of "at 1" end, equal = { 1e-9, tolerance = 1e-13 } }
check { name = "what touches zero does not fire", value = function() return time_of "touches zero at 2.1" end, equal = { -1, tolerance = 0 } }
check { name = "at the end", unit = "s", value = function() return time_of "at the end" end, equal = { 3, tolerance = 1e-12 } }
