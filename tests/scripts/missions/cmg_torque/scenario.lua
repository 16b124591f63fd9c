-- The gimbal turns its rotor at a constant rate: the bench is held by h_0 times that rate, along g x s. About the z axis of the bench that is
-- h_0 rate cos(angle); gimbal and rotor turn about principal axes and give nothing.
local cluster = cmg.cluster { gimbals = { { 1, 0, 0 } }, spins = { { 0, 1, 0 } }, h = 0.1 * 200 }
local sat = vehicle "vehicle.yaml"
local bench, gimbal, rotor = sat:hinge "bench", sat:hinge "gimbal", sat:hinge "rotor"
mission { duration = "9 s", integrator = { method = "dopri5", relative = 1e-11 }, output = { rate = "1 Hz" } }
bench:profile { rate_table = { { 0, 0 }, { 1, 0 } } }
local worst, largest = 0, 0
controller { name = "look", rate = "5 Hz", step = function(t)
  local torque = cluster.momentum_rate({ 0.3 * t }, { 0.3 })[3]
  worst, largest = math.max(worst, math.abs(bench:applied() - torque)), math.max(largest, math.abs(torque))
end }
check { name = "torque of the bench", unit = "N m", below = 1e-9, value = function() return worst end }
check { name = "it is 6 N m", unit = "N m", value = function() return largest end, equal = { 0.1 * 200 * 0.3, tolerance = 1e-12 } }
check { name = "rate of the rotor", unit = "rad/s", value = function() return rotor:rate() end, equal = { 200, tolerance = 1e-9 } }
