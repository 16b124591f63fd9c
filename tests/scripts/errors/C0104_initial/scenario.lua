-- exit: 2
local sat = vehicle "../pendulum.yaml"
initial { rod = { angle = "1 m", rate = 2, speed = 3 }, rood = {} }
