-- exit: 2
-- argument: --set
-- argument: vehicle.bodies.rod.mass=3 m
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
