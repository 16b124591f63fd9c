-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { method = "rk4", step = 0, max_step = 0, initial_step = "0 s" } }
