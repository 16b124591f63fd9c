-- To rest at the origin in the least time by a force within +-F: back until the last parabola, x + v |v| / (2 a) = 0, and along it [Pontryagin 1962].
-- That is a function of place and speed, located as any other.
local x, v, a = 3, 1, 2
local sat = vehicle "vehicle.yaml"
mission { duration = "10 s" }
local cart = sat:hinge "cart"
cart:force(-4)
local found = persist {}
event { name = "parabola", direction = "falling", once = true, when = function() return cart:q() + cart:v() * math.abs(cart:v()) / (2 * a) end,
        action = function() found.switch = mission.time() cart:force(4) end }
event { name = "rest", direction = "rising", when = function() return cart:v() end, action = function() stop() end }
local rise = math.sqrt(x / a + v ^ 2 / (2 * a ^ 2))
check { name = "switch", unit = "s", value = function() return found.switch end, equal = { v / a + rise, tolerance = 1e-12 } }
check { name = "least time", unit = "s", value = function() return mission.time() end, equal = { v / a + 2 * rise, tolerance = 1e-12 } }
check { name = "place", unit = "m", value = function() return cart:q() end, equal = { 0, tolerance = 1e-12 } }
