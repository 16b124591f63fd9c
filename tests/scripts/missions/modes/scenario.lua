-- Phases as the modes of a machine: cycles by `next`, choices by exit_, jumps from controllers and events, each begun in the instant that asks for it.
local sat = vehicle "../phases/vehicle.yaml"
mission { duration = "10 s", output = { rate = "1 Hz" } }
local cart = sat:hinge "cart"
local log = persist { said = "", cycles = 0 }
local function say(t, text)
  log.began = t
  log.said = log.said .. ("%s@%g "):format(text, t)
end
local function mode(name, more)
  more.name = name
  more.enter = more.enter or function(t) say(t, name) end
  phase(more)
end
mode("ahead", { duration = "1 s", next = "back" })
mode("back", { duration = "0.5 s", next = "ahead", exit_ = function()
  log.cycles = log.cycles + 1
  if log.cycles == 2 then mission.enter "choice" end -- in place of `ahead`
end })
mode("choice", { enter = function(t) say(t, "choice") mission.enter "wait" end })
mode("wait", { until_ = function(t)
  if t > 3.45 then mission.enter "drift" end -- wins over what until_ returns
  return false
end })
mode("drift", {})
mode("caught", { duration = "0.1 s" })
mode("safe", { exit_ = function(t) say(t, "never") end })

controller { name = "drive", rate = "10 Hz", step = function(t)
  cart:force(({ ahead = 1, back = -2 })[mission.phase()] or 0)
  assert(mission.phase_time() == t - log.began)
  if mission.phase() == "drift" and mission.phase_time() > 0.99 then mission.enter "safe" log.asked = mission.phase() end
end }
controller { name = "after it", rate = "10 Hz", step = function(t)
  if mission.phase() == "safe" and not log.seen then log.seen = t end
end }
assert(mission.phase() == "" and mission.phase_time() == 0)
-- From the instant of an event, between two ticks; its phase lasts until a tick and hands over to the one declared after it.
event { name = "far", direction = "rising", once = true, when = function(t) return t - 7.123 end, action = function()
  mission.enter "caught"
  log.at_action = mission.phase()
end }
check { name = "what happened", value = function()
  local want = "ahead@0 back@1 ahead@1.5 back@2.5 choice@3 wait@3 drift@3.5 safe@4.5 never@7.123 caught@7.123 safe@7.3 "
  return log.said == want and 1 or error(log.said)
end, equal = { 1 } }
check { name = "a wish begins when its function has returned", value = function() return log.asked == "drift" and log.at_action == "safe" and 1 or 0 end, equal = { 1 } }
check { name = "later controllers of the instant see it", unit = "s", value = function() return log.seen end, equal = { 4.5, tolerance = 1e-12 } }
check { name = "time in the phase", unit = "s", value = function() return mission.phase_time() end, equal = { 10 - 7.3, tolerance = 1e-12 } }
