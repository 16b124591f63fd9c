-- Two equal double pendulums get the same pulse of torque, one ten times as strong. The linear model about hanging at rest, x' = A x + B u, goes
-- along: its poles are known, and what it leaves out grows with the cube of the motion.

local p = parameters { torque = "0.02 N m", pulse = "1 s", ratio = 10 }
local g, l = 9.81, 1                      -- as in vehicle.yaml

local sat = vehicle "vehicle.yaml"
local hinges = {}
for _, name in ipairs { "small_1", "small_2", "large_1", "large_2" } do hinges[#hinges + 1] = sat:hinge(name) end

local rate = 50                           -- [Hz] of the comparison
mission {
  title = "a linear model beside the motion itself",
  duration = "8 s",
  integrator = { method = "dopri5", relative = 1e-11, absolute = 1e-14 },
  output = { rate = rate },
}

local plant = sat:linearize {
  inputs = { "small_1.angle", "large_1.angle" },
  outputs = { "small_1.angle", "small_2.angle", "large_1.angle", "large_2.angle" },
}

-- One tick of x' = A x + B u with u held.
local Ad, Bd = control.discretise(plant.A, plant.B, 1 / rate)

-- The truth of the linear motion: modes (1, sqrt 2) and (1, -sqrt 2) of the angles from the vertical [Landau, Lifshitz, Mechanics, 23].
local w = { math.sqrt((2 - math.sqrt(2)) * g / l), math.sqrt((2 + math.sqrt(2)) * g / l) }
local function truth(t)
  local upper, lower = 0, 0
  for k, s in ipairs { math.sqrt(2), -math.sqrt(2) } do
    local function swing(time) return time > 0 and 1 - math.cos(w[k] * time) or 0 end
    local x = p.torque / ((4 + 2 * s) * w[k] ^ 2) * (swing(t) - swing(t - p.pulse))
    upper, lower = upper + x, lower + s * x
  end
  return upper, lower - upper              -- angles of the hinges
end

local m = persist { x = {}, truth = 0, small = 0, large = 0 }
for i = 1, plant.A:rows() do m.x[i] = 0 end
local function see(name, e) if not (e <= m[name]) then m[name] = e end end   -- a NaN stays
local log = signals {
  ["linear/angle"] = { unit = "rad", components = { "small_1", "small_2", "large_1", "large_2" }, meaning = "of the linear model" },
  ["linear/error"] = { unit = "rad", components = { "small", "large" }, meaning = "differences of both angles from the motion, added up" },
}
controller {
  name = "comparison", rate = rate,
  step = function(t)
    local y, e = plant.C * vector(m.x), {}
    for i, hinge in ipairs(hinges) do e[i] = math.abs(y[i] - hinge:angle()) end
    local a, b = truth(t)
    see("truth", math.abs(y[1] - a) + math.abs(y[2] - b))
    see("small", e[1] + e[2])
    see("large", e[3] + e[4])
    log["linear/angle"](table.unpack(y:table()))
    log["linear/error"](e[1] + e[2], e[3] + e[4])

    local u = t < p.pulse and p.torque or 0
    hinges[1]:torque(u)
    hinges[3]:torque(p.ratio * u)
    m.x = (Ad * vector(m.x) + Bd * vector { u, p.ratio * u }):table()
  end,
}

figure { name = "angles that the linear model is off, small motion", unit = "rad", value = function() return m.small end }
figure { name = "angles that the linear model is off, large motion", unit = "rad", value = function() return m.large end }
check {
  name = "poles", unit = "rad/s", below = 1e-12,             -- to round-off: the model is exact
  value = function()
    local sum = 0
    for _, pole in ipairs(plant.poles) do sum = sum + math.abs(pole.re) + math.min(math.abs(math.abs(pole.im) - w[1]), math.abs(math.abs(pole.im) - w[2])) end
    return sum
  end,
}
-- 400 products with a matrix that is exact to 1e-15.
check { name = "linear model by the modes", unit = "rad", value = function() return m.truth end, below = 1e-13 }
-- sin x = x - x^3 / 6: ten times the torque, a thousand times the error, but for the next power, (0.015 rad)^2.
check { name = "error grows with the cube", value = function() return m.large / m.small end, equal = { p.ratio ^ 3, tolerance = 1e-3 * p.ratio ^ 3 } }
check { name = "error of the small motion", unit = "rad", value = function() return m.small end, within = { 1e-9, 1e-6 } }
