-- exit: 3
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s" }
