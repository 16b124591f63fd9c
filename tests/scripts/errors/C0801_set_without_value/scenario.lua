-- exit: 2
-- argument: --set
-- argument: angle
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
