-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
check { name = "angle", value = function() return 1 end }
