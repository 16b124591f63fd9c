-- An arm beyond its latch is mounted anew where its angle is counted from another zero: it has not passed the place of the latch, and comes to it 2 s later. An arm that is locked
-- keeps its zero: an encoder tells what it turned up to there, 0.3 rad/s for half a period.
local sat = vehicle "vehicle.yaml"
mission { duration = "4 s", output = { rate = "10 Hz" } }
local m = persist { rates = {} }
event { name = "mounts", once = true, direction = "rising", when = function(t) return t - 1 end, action = function()
  sat:attach("arm", { to = { body = "base", orientation = { axis = { 0, 0, 1 }, angle = 0.6 } }, type = "revolute", axis = { 0, 0, 1 } })
end }
event { name = "locks", once = true, direction = "rising", when = function(t) return t - 0.55 end, action = function() sat:lock "held" end }
controller { name = "looks", rate = "10 Hz", step = function(t)
  m.rates[#m.rates + 1] = sat:device("reads"):get "rate"
  if t == 2.9 then m.angle, m.closed = sat:hinge("arm"):angle(), sat:device("catch"):get "closed" end
end }
check { name = "goes on", unit = "rad", value = function() return m.angle end, equal = { 0.49, tolerance = 1e-12 } }
check { name = "open", value = function() return m.closed end, equal = { 0 } }
check { name = "caught", value = function() return sat:device("catch"):get "closed" end, equal = { 1 } }
check { name = "rate up to the lock", unit = "rad/s", value = function() return m.rates[7] end, equal = { 0.15, tolerance = 1e-12 } }
