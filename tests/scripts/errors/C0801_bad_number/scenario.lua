-- exit: 2
-- argument: --until
-- argument: soon
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
