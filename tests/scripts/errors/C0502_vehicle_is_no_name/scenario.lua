-- exit: 2
local sat = vehicle { "../pendulum.yaml" }
mission { duration = "4 s" }
