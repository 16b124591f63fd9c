-- exit: 3
vehicle "vehicle.yaml"
mission { duration = "60 s" }
