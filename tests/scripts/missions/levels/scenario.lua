-- Events at states of devices: a level of propellant that cuts the engine off, a momentum of a wheel, a charge; closed forms.
device { type = "lua/battery", mounts = { at = "node" }, params = { drain = "W/s" }, states = { charge = { 12, "J" } },
         in_step = true, evaluate = function(a) return { charge = -a.drain * a.t } end }
local sat = vehicle "vehicle.yaml"
mission { duration = "12 s", output = { rate = "10 Hz" } }
local stage, tank, engine, wheel, battery = sat:body "stage", sat:device "tank", sat:device "engine", sat:device "wheel", sat:device "battery"
local seen = persist {}
local exhaust, burnt = 300 * 9.80665, 2.5                              -- [m/s], [kg]

event { name = "cut off", direction = "falling", once = true, when = function() return tank:get "propellant" - 60 + burnt end, action = function(t)
  seen.cut, seen.left = t, tank:get "propellant"
  engine:set("command", 0)
end }
event { name = "wheel at rest", when = function() return wheel:get "momentum" end, action = function(t) seen.rest = t end }
sequence { name = "charge", run = function()
  wait_until(function() return battery:get "charge" - 3 end)
  seen.low = mission.time()
end }

local function closed_form(name, unit, value, exact, tolerance)
  check { name = name, unit = unit, value = value, equal = { exact, tolerance = tolerance } }
end
closed_form("cut off", "s", function() return seen.cut end, burnt * exhaust / 900, 1e-11)
closed_form("left", "kg", function() return seen.left end, 60 - burnt, 1e-11)
closed_form("speed", "m/s", function() return select(3, stage:velocity()) end, exhaust * math.log(362 / (362 - burnt)), 1e-9)
closed_form("wheel at rest", "s", function() return seen.rest end, 4, 1e-11)
closed_form("charge", "s", function() return seen.low end, 6, 1e-9)
