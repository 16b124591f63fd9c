-- exit: 2
local sat = vehicle "vehicle.yaml"
initial { panel = { angle = "20 deg" } }
mission { duration = 1 }
