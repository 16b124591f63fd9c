-- exit: 2
local sat = vehicle "../satellite.yaml"
sat:hinge("wheel"):profile { hold = 1 }
