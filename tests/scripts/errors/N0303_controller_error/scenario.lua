-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local gains = {}
local function law(t) return gains.proportional * t end
controller { name = "attitude", rate = "10 Hz", step = function(t) sat:hinge("rod"):torque(law(t)) end }
