-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission("4 s")
