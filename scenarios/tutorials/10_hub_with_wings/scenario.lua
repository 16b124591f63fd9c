-- The frequencies of a satellite are not those of its wings: the hub gives way. Antisymmetric modes turn it, symmetric ones push it, and both
-- families follow from the differential equation of a beam (README.md). One is looked for in the assembled modes, and in the motion.

local E, rho, L, width, height = 70e9, 2700, 5, 0.2, 0.004        -- as in vehicle.yaml, SI
local hub_mass, hub_inertia = 8.1, 54
local line = rho * width * height                                   -- [kg/m]
local scale = math.sqrt(E * width * height ^ 3 / 12 / (line * L ^ 4))   -- [rad/s]: w = beta^2 scale

-- y = y(0) (ch + c) / 2 + y'(0) (sh + s) / (2 beta) + a (ch - c) + b (sh - s), free at 1: the numbers a and b for a base that moves as 1 or turns as 1.
local function bending(beta, moves, turns)
  local ch, sh, c, s = 0.5 * (math.exp(beta) + math.exp(-beta)), 0.5 * (math.exp(beta) - math.exp(-beta)), math.cos(beta), math.sin(beta)
  -- moment and shear at the tip, over beta^2 and beta^3
  local m0 = 0.5 * moves * (ch - c) + 0.5 * turns / beta * (sh - s)
  local q0 = 0.5 * moves * (sh + s) + 0.5 * turns / beta * (ch - c)
  local det = (ch + c) ^ 2 - (sh + s) * (sh - s)
  return -(m0 * (ch + c) - q0 * (sh + s)) / det, -(q0 * (ch + c) - m0 * (sh - s)) / det
end
-- No momentum about y, none along z: zero at a frequency.
local function turning(beta)
  local a = bending(beta, 0, 1)
  return hub_inertia / (2 * line * L ^ 3) + 2 * a / beta ^ 2
end
local function pushing(beta)
  local _, b = bending(beta, 1, 0)
  return hub_mass / (2 * line * L) - 2 * b / beta
end
-- Roots between the poles at the frequencies of a clamped wing and of one that is free to give way.
local function root(f, low, high)
  assert(f(low) * f(high) < 0)
  for _ = 1, 60 do
    local middle = 0.5 * (low + high)
    if f(low) * f(middle) <= 0 then high = middle else low = middle end
  end
  return 0.5 * (low + high)
end
local clamped = { 1.875104068711961, 4.694091132974175, 7.854757438237613, 10.99554073487547 }
local truth = {}                                                    -- [rad/s], ascending: turning and pushing in turn
for k = 1, 3 do
  for _, f in ipairs { turning, pushing } do truth[#truth + 1] = root(f, clamped[k] + 1e-9, clamped[k + 1] - 1e-9) ^ 2 * scale end
end
table.sort(truth)

local sat = vehicle "vehicle.yaml"
mission {
  title = "frequencies of a hub with two wings",
  duration = "30 s",
  integrator = { method = "dopri5", relative = 1e-6 },
  output = { rate = "20 Hz" },
}
-- Both wings bent, one more than the other: a millimetre at the tip.
local function first(amplitude)
  local eta = { amplitude }
  for k = 2, sat:modes("right"):count() do eta[k] = 0 end
  return eta
end
initial { right = { eta = first(1e-3) }, left = { eta = first(4e-4) } }

-- The modes of the assembled system; the momentum of each is its shape times M v, and swings as a sine of its own.
local found = sat:system_modes { elastic = 6 }
local function momentum_at_start()        -- shape* M u, u the displacement at the start
  local u, s, out = sim:v(), sat:operators(), {}
  for i, name in ipairs(s:names "hinge") do
    u[i] = name == "right.etadot_1" and 1e-3 or name == "left.etadot_1" and 4e-4 or 0
  end
  for k = 1, 4 do out[k] = (s.mass * found.shapes:column(found.n_rigid + k)):dot(u) end
  return out
end

local names = { "1", "2", "3", "4" }
local log = signals {
  ["modes/momentum"] = { unit = "1", components = names, meaning = "of the first modes: shape* M v" },
  ["modes/truth"] = { unit = "1", components = names, meaning = "the same as sines of the frequencies of the beam" },
}
local m = persist { worst = 0, largest = 0 }
local mass_times_shape, start = {}, momentum_at_start()
for k = 1, 4 do mass_times_shape[k] = sat:operators().mass * found.shapes:column(found.n_rigid + k) end
controller {
  name = "modal momentum", rate = "20 Hz",
  step = function(t)
    local v, now, known = sim:v(), {}, {}
    for k = 1, 4 do
      now[k] = mass_times_shape[k]:dot(v)
      known[k] = -truth[k] * start[k] * math.sin(truth[k] * t)
      local e = math.abs(now[k] - known[k])
      if not (e <= m.worst) then m.worst = e end         -- a NaN stays
      m.largest = math.max(m.largest, math.abs(known[k]))
    end
    log["modes/momentum"](table.unpack(now))
    log["modes/truth"](table.unpack(known))
  end,
}

-- Finite elements and the modes that are left out: 1e-5 of the frequency in the third pair.
for k, w in ipairs(truth) do
  check {
    name = string.format("frequency %d by the beam", k), unit = "Hz", value = function() return found.frequency[found.n_rigid + k] end,
    equal = { w / (2 * math.pi), tolerance = 1e-5 * w },
  }
end
-- The fourth mode makes 28 swings: 1e-6 of its frequency is 2e-4 of its phase.
check { name = "momenta of four modes over time, relative", value = function() return m.worst / m.largest end, below = 1e-3 }
-- Hughes 1980 and Likins 1969 (tests/reference/cases/flex-hub-two-appendages.yaml): the hub turns with a tenth of the inertia of rods.
check {
  name = "betas of the turning modes as published", below = 1e-10,
  value = function()
    local sum = 0
    for i, beta in pairs { [2] = 2.638924696297, [3] = 4.793770850458, [5] = 7.875652942778 } do
      sum = sum + math.abs(math.sqrt(truth[i] / scale) - beta)
    end
    return sum
  end,
}
