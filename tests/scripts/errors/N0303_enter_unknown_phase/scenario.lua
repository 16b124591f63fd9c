-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
phase { name = "point" }
phase { name = "safe" }
controller { name = "watch", rate = "1 Hz", step = function() mission.enter "save" end }
