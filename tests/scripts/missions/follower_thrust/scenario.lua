-- A thrust that follows the end that it acts on: of a clamped column it brings the first two modes together until they flutter [Beck 1952], of a
-- free one, a missile, likewise [Beal 1965]. Each is in pieces, whose thrust acts as one turns against the next: the error falls with the square
-- of their length, and from 8 and 16 of them follow the frequencies of the column itself, to its fourth power.
local sat = vehicle "vehicle.yaml"
mission { duration = "0.01 s", integrator = { method = "exponential" } }
local E, I, line, L = 70e9, 1e-8, 2700 * 5e-4, 10
local unit, time = E * I / L ^ 2, math.sqrt(line * L ^ 4 / (E * I))      -- P and w below are in these

-- w'''' + P ((1 - x) w')' = w^2 w of the missile, pushed at x = 0, both ends free: a power series.
local function missile(P, w)
  local function tip(a0, a1)
    local a, bend, shear = { [0] = a0, a1, 0, 0 }, 0, 0
    for k = 0, 56 do
      a[k + 4] = (w ^ 2 * a[k] - P * ((k + 2) * (k + 1) * a[k + 2] - (k + 1) ^ 2 * a[k + 1])) / ((k + 4) * (k + 3) * (k + 2) * (k + 1))
    end
    for k = 2, 60 do bend, shear = bend + k * (k - 1) * a[k], shear + k * (k - 1) * (k - 2) * a[k] end
    return bend, shear
  end
  local b0, s0 = tip(1, 0)
  local b1, s1 = tip(0, 1)
  return b0 * s1 - b1 * s0
end
local function column(P, w)                                               -- [Beck 1952]
  local root = math.sqrt(P ^ 2 / 4 + w ^ 2)
  local a, b = math.sqrt(root + P / 2), math.sqrt(root - P / 2)
  local sh, ch = 0.5 * (math.exp(b) - math.exp(-b)), 0.5 * (math.exp(b) + math.exp(-b))
  return P ^ 2 + 2 * w ^ 2 + P * w * math.sin(a) * sh + 2 * w ^ 2 * math.cos(a) * ch
end
local function root(f, P, low, high)
  assert(f(P, low) * f(P, high) < 0)
  for _ = 1, 50 do
    local middle = 0.5 * (low + high)
    if f(P, low) * f(P, middle) <= 0 then high = middle else low = middle end
  end
  return low
end

-- Where two frequencies become one: at 20.05 E I / L^2 of the column, as published, at 109.69 of the missile.
local function crossings(f, P, low, high)
  local n, last = 0, f(P, low)
  for i = 1, 400 do
    local next = f(P, low + (high - low) * i / 400)
    if next * last < 0 then n = n + 1 end
    last = next
  end
  return n
end
assert(crossings(column, 20.04, 9, 13) == 2 and crossings(column, 20.06, 9, 13) == 0)
assert(crossings(missile, 109.68, 20, 26) == 2 and crossings(missile, 109.7, 20, 26) == 0)

local P, pieces = 8, { 8, 16 }
local move = {}
for _, n in ipairs(pieces) do
  for _, kind in ipairs { "missile", "column" } do
    for i = 0, n - 1 do move[#move + 1] = ("%s_%d_%d.eta"):format(kind, n, i) end
  end
  sat:node(("missile_%d_0"):format(n)):load {}:set(0, 0, 0, P * unit, 0, 0)
  sat:node(("column_%d_%d.tip"):format(n, n - 1)):load {}:set(0, 0, 0, -P * unit, 0, 0)
end
local found = sat:equilibrium { move = move }
assert(found.reached, found.message)
initial(found.initial)
-- Bending in the two planes alike, so each twice; a missile drifts besides, by rounding of a fourfold zero.
local function modes(kind, n)
  local w = {}
  for _, pole in ipairs(sat:operators():subtree(("%s_%d_0"):format(kind, n)):linearize({ inputs = {}, outputs = {} }).poles) do
    if pole.im * time > 1 then w[#w + 1] = pole.im * time end
  end
  table.sort(w)
  return { w[1], w[3] }
end
for kind, truth in pairs {
  column = { root(column, P, 4, 8), root(column, P, 10, 22) },
  missile = { root(missile, P, 16, 24), root(missile, P, 50, 64) },
} do
  local coarse, fine = modes(kind, pieces[1]), modes(kind, pieces[2])
  for k, w in ipairs(truth) do
    check { name = ("%s, mode %d, of infinitely many pieces"):format(kind, k), value = function() return (4 * fine[k] - coarse[k]) / 3 / w end, equal = { 1, tolerance = 1e-3 } }
  end
end
