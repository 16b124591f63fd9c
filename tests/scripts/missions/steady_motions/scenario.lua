-- Hoops that roll upright, one fast enough to stay so; a ball that circles in a funnel.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", integrator = { method = "cvode_bdf", relative = 1e-10 }, output = { rate = "20 Hz" } }
local g, m = 9.81, 2

-- The lean x of what rolls at the spin w: (A + m r^2) x'' = (m g r - C (C + m r^2) / A w^2) x, of a hoop 3 r x'' = 2 (g - 4 r w^2) x: upright it
-- falls below w^2 = g / (4 r) [Routh 1905]. It leans by 4e-3 at most, which matters squared; friction creeps at 1e-4 of the speed across.
local r, A, C, rate = 0.5, 0.25, 0.5, 1e-3
local function hoop(name, share)
  local w = share * math.sqrt(g / (4 * r))
  local slope = (m * g * r - C * (C + m * r ^ 2) / A * w ^ 2) / (A + m * r ^ 2)
  local k = math.sqrt(math.abs(slope))
  local x = slope < 0 and rate * math.sin(k) / k or rate * (math.exp(k) - math.exp(-k)) / (2 * k)
  local body = sat:body(name)
  check { name = "lean of the " .. name .. " hoop", unit = "rad", equal = { x, tolerance = 1e-3 * math.abs(x) },
    value = function() return -math.asin(quat.rotate({ body:attitude() }, { 1, 0, 0 })[3]) end }
  return { position = { 0, 0, r - m * g / 1e7 }, velocity = { rate * r, w * r, 0 }, angular_velocity = { -w, rate, 0 } }
end

-- The middle of the ball slides on a cone of half angle a whose tip is over that of the funnel, d off it: it circles at W^2 = g cos a / (d sin^2 a).
-- Started a thousandth farther out with the same angular momentum, it comes back as cos(sqrt(3) W sin(a) t), but for a thousandth of that.
local a, d, out = math.pi / 4, 1, 1e-3
local W = math.sqrt(g * math.cos(a) / (d * math.sin(a) ^ 2))
local depth = 0.5 * g / math.sin(a) / 1e6
local tip = (0.02 - depth) / math.sin(a)
local ball = sat:body "ball"
check { name = "ball off its circle", unit = "m", equal = { out * math.cos(math.sqrt(3) * W * math.sin(a)), tolerance = 3e-3 * out },
  value = function() return (select(3, ball:position()) - tip) / math.cos(a) - d end }
-- Its depth, 7e-6 m, is that of the steady force to a hundredth.
check { name = "ball off the wall", unit = "m", below = 1e-7, value = function()
  local x, y, z = ball:position()
  return math.abs(math.sqrt(x ^ 2 + y ^ 2) - (z - tip) * math.tan(a))
end }
initial {
  fast = hoop("fast", 1.5),
  slow = hoop("slow", 0.5),
  ball = { position = { (d + out) * math.sin(a), 0, tip + (d + out) * math.cos(a) }, velocity = { 0, W * d ^ 2 / (d + out) * math.sin(a), 0 } },
}
