-- exit: 3
local pendulum = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local tip = pendulum:node "rod.end"
check { name = "near", unit = "m", value = function() return tip:position() end, below = 1 }   -- it was judged by x alone
