-- Delta-v is the integral of the specific force (Savage 1998), of which a blow has a part however short it is: a pulse, a hard stop, a capture
-- and a latch are felt by who is struck, in closed form by the momentum that each takes.
local sat = vehicle "vehicle.yaml"
mission { duration = "3 s", integrator = { method = "dop853", relative = 1e-12 } }
local felt = persist {}
for _, name in ipairs { "one", "cart", "target", "chaser", "bus", "slider" } do felt[name] = { 0, 0, 0 } end
controller { name = "adds", rate = "10 Hz", step = function()
  for name, sum in pairs(felt) do felt[name] = vec.add(sum, sat:device("on_" .. name):get "velocity") end
end }
sequence { name = "plan", run = function()
  at "1.05 s"
  sat:attach("chaser", { to = "target", as_found = true })
  sat:lock "slider"
end }

local function feels(name, x, y)
  check { name = name .. " along", unit = "m/s", value = function() return felt[name][1] end, equal = { x, tolerance = 1e-12 } }
  check { name = name .. " across", unit = "m/s", value = function() return felt[name][2] end, equal = { y, tolerance = 1e-12 } }
end
-- 2 N s at 0.5 m from the mass centre; from then on it turns evenly, and the unit is held on its circle.
local w = -2 * 0.5 / 3
feels("one", 2 / 10 - w * 0.2 - w ^ 2 * 0.3 * 3, w * 0.3 - w ^ 2 * 0.2 * 3)
feels("cart", -1.5, 0)
feels("target", 2 / 5, 0)
feels("chaser", 2 / 5 - 1, 0)
feels("bus", 1 / 5, 0)
feels("slider", 1 / 5 - 1, 0)
