-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { durration = "4 s", output = { rat = "1 Hz" } }
