-- exit: 3
local sat = vehicle "../satellite.yaml"
mission { duration = "1 s" }
controller { name = "change", rate = "1 Hz", step = function() sat:change "bodies.bus.mass" end }
