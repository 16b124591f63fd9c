-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { linear_solver = "krylov" } }
