-- A satellite with a boom of 12 m circles Earth at 7.6 km/s, upright, and its boom swings by centimetres. The mass centre stays on the circle of
-- Kepler, and the frequency is that of a free beam with a body at each end; neither costs the other its digits.

local mu, radius = 398600.4418e9, 6878.137e3
local n = math.sqrt(mu / radius ^ 3)      -- [rad/s]

-- The beam, as in vehicle.yaml (SI), free in space: a bus at its root, a point mass at its tip.
local E, rho, L, outer, inner = 70e9, 2700, 12, 0.015, 0.0145
local line = rho * math.pi * (outer ^ 2 - inner ^ 2)
local stiffness = E * math.pi / 4 * (outer ^ 4 - inner ^ 4)
local mu_bus, mu_tip = 60 / (line * L), 1.5 / (line * L)

-- The determinant of the conditions at the tip, for a bus of inertia J about the axis of bending (README.md).
local function determinant(beta, J)
  local j = J / (line * L ^ 3)
  local ch, sh = 0.5 * (math.exp(beta) + math.exp(-beta)), 0.5 * (math.exp(beta) - math.exp(-beta))
  local c, s = math.cos(beta), math.sin(beta)
  -- A shape and its second and third derivative at the tip, over beta^2 and beta^3: columns for the turning and the pushing of the bus.
  local turn, push = -2 / (j * beta ^ 2), 2 / (mu_bus * beta)
  local a = { ch - c + turn * (sh + s) / (2 * beta), ch + c + turn * (sh - s) / (2 * beta), sh - s + turn * (ch - c) / (2 * beta) }
  local b = { sh - s + push * (ch + c) / 2, sh + s + push * (ch - c) / 2, ch + c + push * (sh + s) / 2 }
  local function shear(x) return x[3] + mu_tip * beta * x[1] end
  return a[2] * shear(b) - b[2] * shear(a)
end
local function frequency(J)               -- [rad/s] the lowest one
  local low, high = 0.3, 0.3
  repeat high = high + 0.01 until determinant(low, J) * determinant(high, J) < 0
  for _ = 1, 60 do
    local middle = 0.5 * (low + high)
    if determinant(low, J) * determinant(middle, J) <= 0 then high = middle else low = middle end
  end
  return low ^ 2 * math.sqrt(stiffness / (line * L ^ 4))
end
local across, along = frequency(15), frequency(14)        -- out of the plane of the orbit (bends about y) and in it (about z)

local sat = vehicle "vehicle.yaml"
local bus = sat:body "bus"

-- Bent in the shape of the first mode in each plane, so that only these swing; what the bus would move with them is a shift of the orbit.
local found, names = sat:system_modes { elastic = 2 }, sat:operators():names "hinge"
local eta = {}
for i, name in ipairs(names) do
  local mode = tonumber(name:match "etadot_(%d+)")
  if mode then eta[mode] = 0.005 * (found.shapes(i, found.n_rigid + 1) + found.shapes(i, found.n_rigid + 2)) end
end
initial {
  bus = { position = { radius, 0, 0 }, velocity = { 0, n * radius, 0 }, rate = { 0, 0, n } },     -- the orbit is the x-y plane, the boom points up
  boom = { eta = eta },
}
mission {
  title = "a boom of 12 m swings in orbit",
  duration = "200 s",
  integrator = { method = "dopri5", relative = 1e-9 },
  output = { rate = "5 Hz", nodes = { "boom.tip" } },
}

-- The orbit of the mass centre: place after t in the ellipse through r at the velocity v [Battin 1987: f and g, Kepler's equation].
local function kepler(r, v, t)
  local r0, s = vec.norm(r), vec.dot(r, v) / math.sqrt(mu)
  local a = 1 / (2 / r0 - vec.dot(v, v) / mu)
  local m, x = math.sqrt(mu / a ^ 3) * t, 0
  x = m
  for _ = 1, 20 do
    x = x - (x - (1 - r0 / a) * math.sin(x) + s / math.sqrt(a) * (1 - math.cos(x)) - m) / (1 - (1 - r0 / a) * math.cos(x) + s / math.sqrt(a) * math.sin(x))
  end
  local f, g = 1 - a / r0 * (1 - math.cos(x)), t + math.sqrt(a ^ 3 / mu) * (math.sin(x) - x)
  return vec.add(vec.scale(f, r), vec.scale(g, v))
end

local m = persist { orbit = 0, crossings = { {}, {} } }
local boom = sat:modes "boom"
for k, plane in ipairs { "along", "across" } do      -- the first cantilever mode bends in the plane or out of it
  event {
    name = plane, direction = "rising", when = function() return boom:eta(k) end,
    action = function(t) m.crossings[k][#m.crossings[k] + 1] = t end,
  }
end
local log = signals { ["orbit/error"] = { unit = "m", meaning = "of the mass centre, from the ellipse of Kepler" } }
controller {
  name = "orbit", rate = "1 Hz",
  step = function(t)
    local s = sim:operators()
    local whole = s:mass_properties()
    if t == 0 then
      local p = s:momentum(sim:v())
      m.place = { whole.com[1], whole.com[2], whole.com[3] }
      m.velocity = { p[4] / whole.mass, p[5] / whole.mass, p[6] / whole.mass }
    end
    local e = vec.norm(vec.sub({ whole.com[1], whole.com[2], whole.com[3] }, kepler(m.place, m.velocity, t)))
    if not (e <= m.orbit) then m.orbit = e end           -- a NaN stays
    log["orbit/error"](e)
  end,
}
local function measured(k)
  local c = m.crossings[k]
  return 2 * math.pi * (#c - 1) / (c[#c] - c[1])
end

check { name = "mass centre on the ellipse of Kepler", unit = "m", value = function() return m.orbit end, below = 1e-5 }
check { name = "swings in the plane", unit = "rad/s", value = function() return measured(1) end, equal = { along, tolerance = 1e-5 * along } }
check { name = "swings across the plane", unit = "rad/s", value = function() return measured(2) end, equal = { across, tolerance = 1e-5 * across } }
