-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
check { name = "angle", value = function() return 1 end, equal = { 1, tolerence = 1e-3 } }
