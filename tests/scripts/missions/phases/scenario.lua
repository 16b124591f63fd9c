-- Phases follow one another at ticks; an event ends the run.
local sat = vehicle "vehicle.yaml"
mission { duration = "100 s", output = { rate = "1 Hz" } }
local cart = sat:hinge "cart"
local said = {}
local function say(text) return function(t) said[#said + 1] = string.format("%s@%g", text, t) end end
phase { name = "push", duration = "0.3 s", enter = say "push", exit_ = say "pushed" }
phase { name = "coast", until_ = function() return cart:q() > 1 end, enter = say "coast" }
phase { name = "empty", duration = 0, enter = say "empty" }
phase { name = "brake", enter = say "brake" }

controller { name = "thrust", rate = "10 Hz", step = function(t)
  cart:force(({ push = 2, coast = 0, brake = -2 })[mission.phase()])
end }
event { name = "rest", when = function() return cart:v() end, direction = "falling", action = function(t) say "rest"(t) stop() end }

-- 1 m/s^2 for 0.3 s: 0.045 m and 0.3 m/s; 1 m is passed at 0.3 + 0.955 / 0.3 = 3.483 s, seen at 3.5 s; rest 0.3 s later.
local want = "push@0 pushed@0.3 coast@0.3 empty@3.5 brake@3.5 rest@3.8"
check { name = "what happened", value = function() return table.concat(said, " ") == want and 1 or error(table.concat(said, " ")) end, equal = { 1 } }
check { name = "end", unit = "s", value = function() return mission.time() end, equal = { 3.8, tolerance = 1e-9 } }
check { name = "in the end", value = function() return mission.phase() == "brake" and 1 or 0 end, equal = { 1 } }
