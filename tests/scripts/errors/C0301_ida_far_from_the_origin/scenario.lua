-- exit: 2
local sat = vehicle "vehicle.yaml"
mission { duration = 10, integrator = { method = "ida", relative = 1e-11 } }
