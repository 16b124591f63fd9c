-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, integrator = { absolute = 1e300 } }
