-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local tip = sat:node("rod.end"):load { axes = "world" }
controller { name = "thruster", rate = "10 Hz", step = function(t) pcall(tip.set, tip, 0, 0, 0, 1 / 0, 0, 0) end }
