-- A flexible body of level 2 whose modes slide and turn its masses is these masses on hinges, with all that is mounted on them.
local sat = vehicle "vehicle.yaml"
mission { duration = "5 s", integrator = { method = "dop853", relative = 1e-12 }, output = { rate = "10 Hz" } }
local pairs_of = { { "whole.hub", "core.hub" }, { "whole.slide", "slide.end" }, { "whole.turn", "turn.end" }, { "whole.rise", "rise.end" } }
local devices = { gyro = { "rate", "force" }, wheel = { "momentum", "rate" }, stay = { "tension" }, mount = { "turn", "force", "moment" } }

local worst = persist { place = 0, velocity = 0, acceleration = 0, attitude = 0, devices = 0, way = 0 }
local function far(what, a, b, apart)
  for i = 1, #a do worst[what] = math.max(worst[what], math.abs(a[i] + (i == 1 and apart or 0) - b[i])) end
end
local function numbers(x) return type(x) == "table" and x or { x } end
controller { name = "compares", rate = "10 Hz", step = function()
  for _, pair in ipairs(pairs_of) do
    local one, other = sat:node(pair[1]), sat:node(pair[2])
    far("place", { one:position() }, { other:position() }, 50)
    far("velocity", { one:velocity() }, { other:velocity() })
    far("acceleration", { one:acceleration() }, { other:acceleration() })
    far("attitude", quat.error({ one:attitude() }, { other:attitude() }), { 0, 0, 0 })
  end
  for name, ports in pairs(devices) do
    for _, port in ipairs(ports) do
      far("devices", numbers(sat:device("whole_" .. name):get(port)), numbers(sat:device("core_" .. name):get(port)))
    end
  end
  worst.way = math.max(worst.way, math.abs(sat:hinge("turn"):angle()))
end }

-- The method errs by 1e-12 in each of 200 steps; level 1 is off by 1e-3.
for _, what in ipairs { "place", "velocity", "acceleration", "attitude", "devices" } do
  check { name = what .. " of both", value = function() return worst[what] end, below = 1e-10 }
end
check { name = "the turn is large", unit = "rad", value = function() return worst.way end, above = 0.2 }
