-- exit: 2
-- argument: --set
-- argument: angel=2
parameters { angle = 1 }
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
