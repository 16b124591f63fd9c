-- A joint of five bars is unlocked while another one is held by friction and the others move: what rounding leaves of its rate is no motion, it sticks, and
-- so both stay where they are [Coulomb 1785]. Held, they take 0.60 and 0.30 N m then, of 0.99 and 0.65.
local sat = vehicle "vehicle.yaml"
mission { duration = "1.1 s", integrator = { method = "dop853", relative = 1e-9 }, output = { rate = "100 Hz" } }
sequence { name = "brake", run = function() at "0.642 s" sat:lock "l3" at "1.042 s" sat:unlock "l3" end }
controller { name = "kick", rate = "20 Hz", step = function(t) sat:device("pt"):set("fire", t == 0.85 and 1 or 0) end }
for _, name in ipairs { "l1", "l3" } do
  check { name = name .. " stands still", unit = "rad/s", equal = { 0, tolerance = 0 }, value = function() return sat:hinge(name):v() end }
end
