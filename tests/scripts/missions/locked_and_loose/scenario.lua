-- The vehicle becomes another one three times; the dense twin that a run is compared with is that of the present one.
local sat = vehicle "vehicle.yaml"
mission { title = "an arm that is locked, unlocked and let go", duration = "2 s", integrator = { method = "dop853", relative = 1e-11 } }
local function at(name, time, action)
  event { name = name, once = true, direction = "rising", when = function(t) return t - time end, action = action }
end
at("lock", 0.45, function() sat:lock "arm" end)
at("unlock", 1.25, function() sat:unlock "arm" end)
at("let go", 1.6, function() sat:detach "hand" end)
check { name = "locked in between", unit = "rad", value = function() return sat:hinge("arm"):angle() end, within = { -1, 1 } }
