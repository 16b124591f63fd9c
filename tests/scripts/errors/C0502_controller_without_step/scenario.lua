-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
controller { name = "attitude", rate = "10 Hz" }
