-- exit: 3
local pendulum = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local rod = pendulum:hinge "rod"
phase { name = "swing", until_ = function() return rod:angle() - 1.57 end }   -- it was over at once
