-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { method = "rk4", step = 0 } }
