-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "10 m" }
