-- exit: 3
vehicle "vehicle.yaml"
mission { duration = "1 s" }
