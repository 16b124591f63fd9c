-- exit: 2
local sat = vehicle "../pendulum.yaml"
sat:linearize { inputs = { "rod.angel" } }
