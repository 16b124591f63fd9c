-- exit: 3
local sat = vehicle("../satellite.yaml", { ["devices.spin"] = "{type: momentum_wheel, at: bus, inertia: 0.05}" })
mission { duration = "1 s" }
local wheel = sat:device "spin"
event { name = "fast", when = function() return wheel:get "momentum" + wheel:get "rate" end }
