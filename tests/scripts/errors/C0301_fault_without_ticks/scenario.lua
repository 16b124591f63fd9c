-- exit: 2
local sat = vehicle "vehicle.yaml"
mission { duration = 1 }
sat:device "wheel":fault { port = "torque", noise = "1 mN m" }
