-- A thousand pendulums, one on the other, swing in their slowest mode as one.

local links = 1000
local sat = vehicle "vehicle.yaml"
local gravity, rod = 9.81, 0.1                        -- as in vehicle.yaml, SI
local amplitude = 1e-6                                -- [m] of the lowest mass, 100 m below the first hinge

-- Small motion of the mass with j others below it: x_j = L_j(lambda) cos(omega t), omega^2 = lambda g / rod, L_j the polynomials of
-- Laguerre by their recurrence, and L_1000(lambda) = 0 at the first hinge. The slowest mode has the smallest zero.
local function shape(lambda)
  local L = { [0] = 1, 1 - lambda }
  for j = 1, links - 1 do L[j + 1] = ((2 * j + 1 - lambda) * L[j] - j * L[j - 1]) / (j + 1) end
  return L
end
local lambda = 2.404825557695773 ^ 2 / (4 * links)    -- of a chain without links: the first zero of J0
for _ = 1, 5 do                                       -- Newton, with lambda L_n' = n (L_n - L_(n-1))
  local L = shape(lambda)
  lambda = lambda - L[links] * lambda / (links * (L[links] - L[links - 1]))
end
local x, omega = shape(lambda), math.sqrt(lambda * gravity / rod)

local start, inboard = {}, 0
for j = links - 1, 0, -1 do
  local slope = amplitude * (x[j] - (j == links - 1 and 0 or x[j + 1])) / rod
  start[("link_%04d"):format(links - j)] = { angle = slope - inboard }
  inboard = slope
end
initial(start)

mission {
  title = "a chain of a thousand bodies",
  duration = 18,
  integrator = { method = "dop853", relative = 1e-10, absolute = 1e-16 },
  output = { period = 1 },
}
local hinges = {}
for i = 1, links do hinges[i] = sat:hinge(("link_%04d"):format(i)) end
local worst = persist { lowest = 0, middle = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", period = 0.5,
  step = function(t)
    local slope, at = 0, 0
    for i = 1, links do
      slope = slope + hinges[i]:angle()
      at = at + rod * slope
      if i == links / 2 then see("middle", math.abs(at / amplitude - x[links / 2] * math.cos(omega * t))) end
    end
    see("lowest", math.abs(at / amplitude - math.cos(omega * t)))
  end,
}
figure { name = "slowest frequency", unit = "rad/s", value = function() return omega end }
-- The recurrence of a thousand terms has 1e-11 of it; methods add less.
check { name = "lowest mass, over its amplitude", value = function() return worst.lowest end, below = 1e-9 }
check { name = "mass in the middle, over the same", value = function() return worst.middle end, below = 1e-9 }
