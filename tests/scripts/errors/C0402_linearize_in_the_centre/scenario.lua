-- exit: 2
local sat = vehicle "vehicle.yaml"
local model = sat:linearize {}
initial { bus = { position = { 7e6, 0, 0 }, velocity = { 0, 7546, 0 } } }
mission { duration = 10 }
