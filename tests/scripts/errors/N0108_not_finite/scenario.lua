-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s", integrator = { method = "rk4", step = "1 ms" } }
local rod = sat:hinge "rod"
controller { name = "runaway", rate = "100 Hz", step = function() rod:torque(1e300 * rod:rate()) end }
