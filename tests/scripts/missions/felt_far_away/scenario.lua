-- A capture is felt at the tip of an arm as far out as the Sun is as at the origin (delta-v of Savage 1998), where places are rounded to 6e-5 m: that is what the two may differ by, times rates of 1/s.
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "10 Hz" } }
local felt = persist { near = { 0, 0, 0 }, far = { 0, 0, 0 } }
controller { name = "adds", rate = "10 Hz", step = function()
  for name, sum in pairs(felt) do felt[name] = vec.add(sum, sat:device(name .. "_imu"):get "velocity") end
end }
sequence { name = "captures", run = function()
  at "1.05 s"
  for name in pairs(felt) do sat:attach(name .. "_chaser", { to = name .. "_target", as_found = true }) end
end }
check { name = "felt near", unit = "m/s", value = function() return vec.norm(felt.near) end, above = 0.1 }
check { name = "felt alike", unit = "m/s", value = function() return vec.norm(vec.sub(felt.near, felt.far)) end, below = 2e-4 }
