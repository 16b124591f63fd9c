-- exit: 3
local sat = vehicle "../satellite.yaml"
mission { duration = "1 s" }
local bus = sat:body "bus"
check { name = "rate", value = function() return vec.norm(bus:rate()) end, below = 1 }
