-- exit: 2
local sat = vehicle "vehicle.yaml"
mission { duration = 1, integrator = { method = "extended", relative = 1e-20 } }
