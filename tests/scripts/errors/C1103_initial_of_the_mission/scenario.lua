-- exit: 2
local sat = vehicle "vehicle.yaml"
initial { crank = { angle = "50 deg" } }
mission { duration = 1 }
