-- exit: 2
-- argument: --untill
-- argument: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
