-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { method = "cvode_bdf", linear_solver = "gmres" } }
