-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = 1, output = { rate = math.pi } }
