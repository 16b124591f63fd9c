-- exit: 2
local sat = vehicle "../pendulum.yaml"
local rod = sat:hinge "rodd"
