-- exit: 2
local sat = vehicle "vehicle.yaml"
initial { bus = { position = { 1, 2, z = 3 } } }
