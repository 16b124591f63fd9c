-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
check { name = "speed", value = function() return nil end, below = 1 }
