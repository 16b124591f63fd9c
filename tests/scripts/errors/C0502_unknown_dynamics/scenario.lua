local sat = vehicle "../satellite.yaml"
mission { duration = 1, dynamics = "diagonalized" }
