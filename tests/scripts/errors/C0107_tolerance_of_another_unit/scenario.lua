-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { tolerances = { angle = "1e-9 m", rate = -1, spin = 2 } } }
