-- exit: 2
-- argument: --set
-- argument: angle=20 m
parameters { angle = "30 deg" }
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
