-- exit: 2
local sat = vehicle "../pendulum.yaml"
sat:node("rod.end"):load {}:set(0, 0, 0, 0, 0, 1, 2)
