-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local rod = sat:hinge "rod"
event { name = "low", when = function() return rod:angle() end, action = function() controller {} end }
