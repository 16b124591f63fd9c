-- exit: 3
local sat = vehicle "../satellite.yaml"
mission { duration = "1 s" }
local bus = sat:body "bus"
event { name = "apex", when = function() return (bus:position()) end, action = function() end }
