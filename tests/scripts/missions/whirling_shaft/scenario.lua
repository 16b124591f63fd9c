-- A shaft, held at one end, turns about its own length with W, and what damps it turns with it [Kimball 1924]. In its axes z = y + i z of a mode
-- has z'' + 2 i W z' - W^2 z + 2 d w z' + w^2 z = 0. W^2 of the deflection itself is in level 2, and in nothing below. From its first critical
-- speed on, W = w, it whirls forward by its own damping.
local sat = vehicle "vehicle.yaml"
mission { duration = 1e-3 }
local damping, modes = 0.01, sat:modes "shaft"
local first = 2 * math.pi * modes:frequency(1)

local function root(re, im)                              -- of a number that is not on the negative axis
  local size, half = math.sqrt(math.sqrt(re * re + im * im)), math.atan(im, re) / 2
  return size * math.cos(half), size * math.sin(half)
end
local function poles(rate)
  initial { shaft = { rate = rate } }
  return sat:linearize().poles
end
local function off(rate)
  local worst = 0
  local found = poles(rate)
  for _, i in ipairs { 1, 3 } do                         -- modes come in pairs, across each other
    local w = 2 * math.pi * modes:frequency(i)
    local b = damping * w                                -- s = - b - i W +- root(b^2 + 2 i b W - w^2)
    local re, im = root(b * b - w * w, 2 * b * rate)
    for _, sign in ipairs { 1, -1 } do
      local x, y, nearest = -b + sign * re, -rate + sign * im, math.huge
      for _, pole in ipairs(found) do nearest = math.min(nearest, math.sqrt((pole.re - x) ^ 2 + (math.abs(pole.im) - math.abs(y)) ^ 2)) end
      worst = math.max(worst, nearest / w)
    end
  end
  return worst
end
local function growth(rate)
  local most = -math.huge
  for _, pole in ipairs(poles(rate)) do
    if math.abs(pole.im) + math.abs(pole.re) > 1e-6 then most = math.max(most, pole.re) end   -- but for the given turn
  end
  return most
end
for _, share in ipairs { 0.3, 0.9, 1.5, 4 } do
  local error = off(share * first)
  check { name = string.format("poles at %g of the first critical speed", share), value = function() return error end, below = 1e-12 }
end
local below, above = growth(0.999 * first), growth(1.001 * first)
check { name = "stable below the first critical speed", unit = "rad/s", value = function() return below end, below = -0.9e-3 * damping * first }
check { name = "unstable above", unit = "rad/s", value = function() return above end, within = { 0.9e-3 * damping * first, 1.1e-3 * damping * first } }
initial { shaft = { rate = 1 } }                        -- all of this was told before the run: in it the shaft hardly turns
