-- exit: 2
-- arguments: --set angle
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
