-- A rigid body tumbles without torque. Its rates are Jacobi's elliptic functions of time, and after one period of them it is turned
-- about its angular momentum by an angle that is an integral of them. README.md has the formulas.

local J = { 1.5, 2.5, 3.2 }               -- [kg m^2] as in vehicle.yaml, J1 < J2 < J3
local p = parameters { w1 = "0.8 rad/s", w3 = "0.7 rad/s" }    -- at the start, where w2 = 0; body axes
local w1, w3 = p.w1, p.w3

-- Twice the energy, the square of the momentum; here L2 > J2 E2, so that the motion goes round the third axis.
local E2, L2 = J[1] * w1 ^ 2 + J[3] * w3 ^ 2, (J[1] * w1) ^ 2 + (J[3] * w3) ^ 2
assert(L2 > J[2] * E2, "the motion goes round the first axis: swap the axes in the formulas")
local rate = math.sqrt((J[3] - J[2]) * (L2 - J[1] * E2) / (J[1] * J[2] * J[3]))
local m = (J[2] - J[1]) * (J[3] * E2 - L2) / ((J[3] - J[2]) * (L2 - J[1] * E2))
local w2 = math.sqrt((J[3] * E2 - L2) / (J[2] * (J[3] - J[2])))
local period = 4 * elliptic.K(m) / rate

local function exact(t)                   -- body axes
  local sn, cn, dn = elliptic.jacobi(rate * t, m)
  return { w1 * cn, w2 * sn, w3 * dn }
end

-- Turn about L of the period: the mean of the rate of precession, by the trapezoidal rule, which converges geometrically for what is periodic.
local function turn_of_a_period()
  local sum, n = 0, 128
  for k = 0, n - 1 do
    local w = exact(k * period / n)
    local a, b = J[1] * w[1] ^ 2 + J[2] * w[2] ^ 2, (J[1] * w[1]) ^ 2 + (J[2] * w[2]) ^ 2
    sum = sum + math.sqrt(L2) * a / b
  end
  return sum * period / n
end

local body = vehicle("vehicle.yaml"):body "body"

initial { body = { rate = { w1, 0, w3 } } }
mission {
  title = "a tumbling body and Jacobi's elliptic functions",
  duration = period,
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { rate = "4 Hz" },
}

local log = signals {
  ["truth/rate"] = { unit = "rad/s", components = { "wx", "wy", "wz" }, meaning = "rate by elliptic functions, body axes" },
  ["truth/error"] = { unit = "rad/s", meaning = "largest difference of a component" },
}
local worst = persist { rate = 0, direction = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays

local L = { J[1] * w1, 0, J[3] * w3 }     -- [N m s] world axes: body and world are aligned at the start
controller {
  name = "comparison",
  rate = "4 Hz",
  step = function(t)
    local w, truth = { body:rate() }, exact(t)
    local e = vec.norm(vec.sub(w, truth))
    log["truth/rate"](truth[1], truth[2], truth[3])
    log["truth/error"](e)
    see("rate", e)
    local now = quat.rotate({ body:attitude() }, { J[1] * w[1], J[2] * w[2], J[3] * w[3] })
    see("direction", vec.norm(vec.sub(now, L)) / vec.norm(L))
  end,
}

figure { name = "period", unit = "s", value = function() return period end }

-- An integrator of relative tolerance 1e-11 per step, some hundred steps, rates of order 1: some 1e-10.
check { name = "rates by elliptic functions", unit = "rad/s", value = function() return worst.rate end, below = 1e-9 }
-- The momentum is constant in world axes only if attitude and rate fit: R J w.
check { name = "momentum stands still in the world", value = function() return worst.direction end, below = 1e-9 }
check {
  name = "turn about the momentum after one period", unit = "rad", below = 1e-9,
  value = function()
    local expected = quat.from_axis_angle(vec.unit(L), turn_of_a_period())
    return vec.norm(quat.error(expected, { body:attitude() }))
  end,
}
