-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { method = "cvode_adams", linear_solver = "krylov" } }
