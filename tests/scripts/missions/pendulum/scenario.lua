-- A pendulum swings from rest: its energy and its period are known.
local p = parameters { start = "30 deg", name = "swing", flag = true, list = { 1, "2 m" } }
local sat = vehicle "vehicle.yaml"
mission { title = "pendulum", duration = "4 s", integrator = { method = "dopri5", relative = 1e-10 },
          output = { rate = "20 Hz", reactions = { "rod" }, nodes = { "rod.end" } } }
initial { rod = { angle = p.start } }
local rod = sat:hinge "rod"

local ticks = 0
controller { name = "clock", rate = "10 Hz", step = function(t)
  if t ~= ticks / 10 then error("tick " .. ticks .. " came at " .. t) end
  ticks = ticks + 1
end }

local lowest = {}
event { name = "lowest point", when = function() return rod:angle() end, action = function(t) lowest[#lowest + 1] = t end }

check { name = "ticks", value = function() return ticks end, equal = { 41, tolerance = 0 } }
check { name = "passes of the lowest point", value = function() return #lowest end, equal = { 5 } }
-- J / (m g c) = (0.2 + 0.5) / (2 * 9.81 * 0.5); the period of 30 degrees is longer by K(sin 15 deg) / (pi / 2) = 1.0174088
check { name = "half period", unit = "s", value = function() return lowest[3] - lowest[2] end,
        equal = { math.pi * math.sqrt(0.7 / 9.81) * 1.017408797595956, tolerance = 1e-8 } }
figure { name = "angle, final", unit = "deg", value = function() return math.deg(rod:angle()) end }
