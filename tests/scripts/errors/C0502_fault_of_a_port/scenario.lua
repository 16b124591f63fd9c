-- exit: 2
local sat = vehicle "vehicle.yaml"
mission { duration = 1 }
sat:device "gyro":fault { port = "rate", bias = { "1 deg/s", 2 }, drift = "1 deg/s", stuk = true, from = "1 m" }
