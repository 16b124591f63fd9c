-- A free body, pushed through its mass centre and turned about a principal axis, once in node axes and once in world axes.
local sat = vehicle "vehicle.yaml"
mission { duration = "4 s", integrator = { method = "dopri5", relative = 1e-11 }, output = { rate = "5 Hz", nodes = { "hub.engine" } } }
initial { hub = { attitude = { math.sqrt(0.5), 0, 0, math.sqrt(0.5) }, position = { 1, 2, 3 }, velocity = { 0, "50 cm/s", 0 } } }
local hub, engine = sat:body "hub", sat:node "hub.engine"
local push = engine:load {}                 -- node z is body x
local turn = engine:load { axes = "world" } -- world z is body z

local w0
controller { name = "thrust", rate = "1 Hz", step = function(t)
  if t == 0 then push:set(0, 0, 0, 0, 0, 100) end
  if t == 1 then push:set(0, 0, 0, 0, 0, 0) turn:set(0, 0, 6, 0, 0, 0) end
  if t == 3 then turn:set(0, 0, 0, 0, 0, 0) end
end }

-- Body y is world -x at the start: 0.5 m/s along -x. Thrust along body x = world y: 100 N / 50 kg for 1 s.
local function velocity(i) return function() return (select(i, engine:velocity())) end end
check { name = "velocity x", unit = "m/s", value = velocity(1), equal = { -0.5, tolerance = 1e-9 } }
check { name = "velocity y", unit = "m/s", value = velocity(2), equal = { 2.0, tolerance = 1e-9 } }
check { name = "velocity z", unit = "m/s", value = velocity(3), equal = { 0, tolerance = 1e-9 } }
check { name = "way y", unit = "m", value = function() return select(2, engine:position()) - 2 end, equal = { 0.5 * 2 + 2 * 3, tolerance = 1e-9 } }
check { name = "height", unit = "m", value = function() return (select(3, engine:position())) end, equal = { 3.2, tolerance = 1e-9 } }
check { name = "rate z", unit = "rad/s", value = function() return (select(3, hub:rate())) end, equal = { 6 * 2 / 12, tolerance = 1e-9 } }
check {
  name = "turn", unit = "rad", -- 1/2 (0.5 rad/s^2) (2 s)^2 + 1 rad/s 1 s
  value = function() return quat.error({ math.sqrt(0.5), 0, 0, math.sqrt(0.5) }, { hub:attitude() })[3] end,
  equal = { 2.0, tolerance = 1e-9 },
}
check { name = "mass", unit = "kg", value = function() return sat:mass() - hub:mass() end, equal = { 0 } }
