-- exit: 2
local sat = vehicle "vehicle.yaml"
mission { duration = 1 }
