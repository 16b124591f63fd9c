-- exit: 2
vehicle "vehicle.yaml"
mission { duration = "1 s" }
initial { wheel = { momentum = 1 } }
