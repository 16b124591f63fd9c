-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "10 s" }
sequence { name = "deploy", start = "1 s", step = function() end }
