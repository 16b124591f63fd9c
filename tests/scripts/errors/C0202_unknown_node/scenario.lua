-- exit: 2
local sat = vehicle "../pendulum.yaml"
local tip = sat:node "rod.ent"
