-- exit: 2
local sat = vehicle "../satellite.yaml"
sat:hinge("drive"):torque(1)
