-- exit: 2
-- arguments: --until soon
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
