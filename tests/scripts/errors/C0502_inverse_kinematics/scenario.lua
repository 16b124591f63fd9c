-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
sat:inverse_kinematics { targets = { { node = "rod", position = { 0, 0, -1 }, rows = { 4.7 } } }, starts = 0, iterations = -1, tolerance = 0 }
