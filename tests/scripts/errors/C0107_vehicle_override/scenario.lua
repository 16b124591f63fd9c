-- exit: 2
-- arguments: --set "vehicle.bodies.rod.mass=3 m"
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
