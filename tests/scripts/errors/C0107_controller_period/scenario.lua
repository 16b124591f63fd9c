-- exit: 2
vehicle "vehicle.yaml"
mission { duration = "1 s" }
controller { name = "c", period = "1 deg", step = function(t) end }
