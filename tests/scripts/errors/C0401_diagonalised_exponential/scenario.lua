-- exit: 2
local sat = vehicle "../satellite.yaml"
mission { duration = 1, dynamics = "diagonalised_rates", integrator = { method = "exponential" } }
