-- exit: 2
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local function setup() return wheel.speed end
setup()
