-- A hanging chain of a hundred masses on massless links swings in two of its modes. Frequencies and shapes are Laguerre polynomials; the
-- work of one evaluation of the equations grows in proportion to the number of links (README.md).

local p = parameters { links = 100 }      -- 25, 50 or 100: there is a vehicle for each
local N, length, g = p.links, 0.1, 9.81   -- as in the vehicle, SI

local function named(form) return string.format(form, N) end    -- a parameter is 100.0, not 100
local chain = vehicle(named "chain_%d.yaml")

-- L_0(x) ... L_N(x) by their recurrence [Abramowitz, Stegun 1964, 22.7]. Mass j from below swings with the amplitude L_j(x).
local function laguerre(x)
  local L = { [0] = 1, 1 - x }
  for j = 1, N - 1 do L[j + 1] = ((2 * j + 1 - x) * L[j] - j * L[j - 1]) / (j + 1) end
  return L
end
-- Its zeros are the eigenvalues of a tridiagonal matrix [Golub, Welsch 1969].
local rows = {}
for i = 1, N do
  rows[i] = {}
  for j = 1, N do rows[i][j] = i == j and 2 * i - 1 or math.abs(i - j) == 1 and math.min(i, j) or 0 end
end
local zeros = matrix(rows):eigenvalues()

-- The second mode and the fourth, 0.1 mm each at the lower end: angles of 1e-4, whose cubes do not count.
local modes = { { x = zeros[2], amplitude = 1e-4 }, { x = zeros[4], amplitude = 1e-4 } }
local across = {}                         -- [m] of mass j from below at the start; mass N is the support
for j = 0, N do across[j] = 0 end
for _, mode in ipairs(modes) do
  local L = laguerre(mode.x)
  for j = 0, N do across[j] = across[j] + mode.amplitude * (L[j] - (j == N and L[N] or 0)) end
end
local start, before = {}, 0
for i = 1, N do                           -- link i hangs on mass N - i + 1 from below and carries the next one
  local angle = math.asin((across[N - i] - across[N - i + 1]) / length)
  start["link_" .. i] = { angle = angle - before }
  before = angle
end
initial(start)

mission {
  title = named "a chain of %d links in its second and fourth mode",
  duration = "6 s",
  integrator = { method = "dopri5", relative = 1e-9, absolute = 1e-14 },
  output = { rate = "50 Hz", nodes = { named "link_%d.end" } },
}

local function truth(t)
  local sum = 0
  for _, mode in ipairs(modes) do sum = sum + mode.amplitude * math.cos(math.sqrt(g / length * mode.x) * t) end
  return sum
end
local log = signals { ["truth/end"] = { unit = "m", meaning = "deflection of the lower end by the linear modes" } }
local worst, tip = persist { distance = 0 }, chain:node(named "link_%d.end")
controller {
  name = "comparison", rate = "50 Hz",
  step = function(t)
    if t == 0 then worst.poles = chain:linearize({}).poles end
    local e = math.abs(tip:position() - truth(t))
    log["truth/end"](truth(t))
    if not (e <= worst.distance) then worst.distance = e end   -- a NaN stays
  end,
}

-- Angles of 1e-4 leave 1e-7 of 0.2 mm.
check { name = "lower end against two cosines", unit = "m", value = function() return worst.distance end, below = 5e-11 }
check {
  name = "all frequencies of the linear model", below = 1e-7,     -- relative; the model is about the start, where angles are 1e-4
  value = function()
    local w = {}
    for _, pole in ipairs(worst.poles) do if pole.im > 0 then w[#w + 1] = pole.im end end
    table.sort(w)
    if #w ~= N then return #w end
    local largest = 0
    for i, x in ipairs(zeros:table()) do
      local e = math.abs(w[i] / math.sqrt(g / length * x) - 1)
      if not (e <= largest) then largest = e end
    end
    return largest
  end,
}
-- The mass matrix by its factors: applied and inverted without being formed, N steps each.
check {
  name = "M (M^-1 f) = f", below = 1e-10, -- relative; the condition of M is some N^4
  value = function()
    local s, f = sim:operators(), {}
    for i = 1, N do f[i] = math.sin(i) end
    f = vector(f)
    return (s.mass * (s.mass:inv() * f) - f):norm() / f:norm()
  end,
}
