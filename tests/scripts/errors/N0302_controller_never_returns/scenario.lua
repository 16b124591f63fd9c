-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
controller { name = "search", rate = "10 Hz", step = function(t) while true do end end }
