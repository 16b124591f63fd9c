-- exit: 2
local sat = vehicle "../C0502_profile_of_a_loop/vehicle.yaml"
mission { duration = 1 }
sat:loop "pinn"
