-- Blocks on springs that a belt of the speed V takes along [den Hartog 1931; Thomsen & Fidlin 2003]: each sticks until its spring pulls with B, and slips by
-- x = C / k + A cos(w t) + V / w sin(w t), A = (B - C) / k, w^2 = k / m, until it is as fast as the belt again: 2 (pi - atan(A w / V)) / w later, and 2 A back.
-- Now and then one breaks away while the other sticks.
local sat = vehicle "vehicle.yaml"
mission { duration = "10 s", integrator = { method = "exponential", relative = 1e-9 }, output = { rate = "10 Hz" } }
local V = 0.1
for name, b in pairs { light = { m = 1, k = 100, B = 10, C = 6 }, heavy = { m = 1.3, k = 80, B = 9, C = 5 } } do
  local A, w = (b.B - b.C) / b.k, math.sqrt(b.k / b.m)
  local slips = 2 * (math.pi - math.atan(A * w / V)) / w
  local t = (10 - b.B / b.k / V) % (slips + 2 * A / V)           -- since it broke away last
  local x = b.C / b.k + (t < slips and A * math.cos(w * t) + V / w * math.sin(w * t) or -A + V * (t - slips))
  check { name = name .. " block", unit = "m", equal = { x, tolerance = 1e-7 }, value = function() return (sat:body(name):position()) end }
end
