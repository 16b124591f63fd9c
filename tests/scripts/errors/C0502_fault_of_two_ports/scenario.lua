-- exit: 2
local sat = vehicle "vehicle.yaml"
mission { duration = 1 }
sat:device "gyro":fault { port = "rate", swap = "valid", delay = "2 m" }
