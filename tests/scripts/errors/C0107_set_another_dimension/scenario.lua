-- exit: 2
-- arguments: --set "angle=20 m"
parameters { angle = "30 deg" }
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
