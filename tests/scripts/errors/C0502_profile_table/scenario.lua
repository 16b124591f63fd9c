-- exit: 2
local sat = vehicle "../satellite.yaml"
sat:hinge("drive"):profile { rate_table = { { 0, 1 }, { 0, 2 } } }
