-- A string of beads, a chain between two walls, and the top of Goryachev and Chaplygin.
local sat = vehicle "vehicle.yaml"
mission { duration = "10 s", integrator = { method = "dop853", relative = 1e-12 } }
local g = 9.81

-- Ten beads at equal distances l on a string swing at the roots of Laguerre's polynomial, L_10(l w^2 / g) = 0 [Bernoulli 1733]. Roots by numpy.
local roots = { 0.13779347054049243, 0.7294545495031705, 1.8083429017403163, 3.4014336978548996, 5.552496140063804, 8.330152746764497, 11.843785837900066, 16.279257831378104, 21.99658581198076, 29.920697012273892 }
local poles = sat:linearize {}.poles
for i, root in ipairs(roots) do
  local least = math.huge
  for _, p in ipairs(poles) do least = math.min(least, math.sqrt(p.re ^ 2 + (p.im - math.sqrt(g * root)) ^ 2)) end
  check { name = "beads, " .. i, unit = "rad/s", value = function() return least end, below = 1e-9 }
end

-- Forty links of weight m g hang between walls 25 m apart: link i stands at tan a = (20.5 - i) m g / H, and H follows by the width.
local function width(H)
  local sum = 0
  for i = 1, 40 do sum = sum + 1 / math.sqrt(1 + ((20.5 - i) * g / H) ^ 2) end
  return sum
end
local low, high = 1, 1000
for _ = 1, 60 do
  local H = (low + high) / 2
  if width(H) < 25 then low = H else high = H end
end
local sag, chain = 0, {}
for i = 1, 40 do chain[i] = "link" .. i end
for i = 1, 20 do sag = sag + math.sin(math.atan((20.5 - i) * g / low)) end
local found = sat:equilibrium { move = chain }
initial(found.initial)
check { name = "sag of the chain", unit = "m", value = function() return -select(3, sat:node "link20.end":position()) end, equal = { sag, tolerance = 1e-8 } }
check { name = "pull on the wall", unit = "N", value = function() return (select(4, sat:loop "wall":reaction())) end, equal = { low, tolerance = 1e-6 } }

-- A = B = 4 C, the mass centre across the axis, no momentum about the vertical: r (p^2 + q^2) - m g l / C p n stays, with n the direction up along the axis
-- [Goryachev 1900, Chaplygin 1901].
local top = sat:body "top"
local attitude = quat.from_axis_angle({ 1, 2, 0.5 }, 0.9)
local up = quat.rotate(quat.conjugate(attitude), { 0, 0, 1 })
local p, q = 0.7, -0.4
initial { top = { attitude = attitude, rate = { p, q, -4 * (p * up[1] + q * up[2]) / up[3] } } }
local function integral()
  local p, q, r = top:rate()
  local n = quat.rotate(quat.conjugate({ top:attitude() }), { 0, 0, 1 })[3]
  return r * (p ^ 2 + q ^ 2) - g * 0.5 * p * n
end
local first, seen = integral(), persist { change = 0 }
controller { name = "top", rate = "10 Hz", step = function() seen.change = math.max(seen.change, math.abs(integral() - first)) end }
check { name = "integral of the top", value = function() return seen.change end, below = 1e-9 }
