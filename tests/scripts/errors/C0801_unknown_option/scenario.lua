-- exit: 2
-- arguments: --untill 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
