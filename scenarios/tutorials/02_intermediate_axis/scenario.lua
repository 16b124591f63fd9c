-- A body that spins about the axis of its intermediate moment of inertia turns over, again and again: the Dzhanibekov effect. Between the
-- flips it stays near an unstable equilibrium, where errors grow by a factor of e each 0.35 s; the period is still known exactly.

local J, w0 = { 1, 2, 3 }, { 0.001, 5, 0.001 }          -- as in vehicle.yaml

-- 4 K(m) / rate; m = 1 - m1 is within 1e-7 of 1, so the numerators are written as sums in which nothing cancels.
local function about(i)                                  -- L^2 - 2 E J_i
  local sum = 0
  for k = 1, 3 do sum = sum + J[k] * (J[k] - J[i]) * w0[k] ^ 2 end
  return sum
end
local rate = math.sqrt((J[3] - J[2]) * about(1) / (J[1] * J[2] * J[3]))
local m1 = (J[3] - J[1]) * about(2) / ((J[3] - J[2]) * about(1))
local period = 4 * elliptic.K(1 - m1, m1) / rate

local body = vehicle("vehicle.yaml"):body "body"

mission {
  title = "a body turns over about its intermediate axis",
  duration = period,
  integrator = { method = "dopri5", relative = 1e-13 },
  output = { rate = "20 Hz" },
}

-- Rates at whole seconds [rad/s], from a Taylor series of 22 digits (README.md).
local known = {
  { -0.006488479703386333, 4.999995889961425, 0.003834073936917771 },
  { -0.1177160862448411, 4.998614200259828, 0.06796831850404733 },
  { -2.021466640948331, 4.573147014861109, 1.167094594918928 },
  { -2.468405718431412, -4.348215060138482, 1.425134939901587 },
}
local worst = persist { known = 0, flips = {} }
controller {
  name = "comparison", rate = "1 Hz",
  step = function(t)
    if not known[t] then return end
    local e = vec.norm(vec.sub({ body:rate() }, known[t]))
    if not (e <= worst.known) then worst.known = e end   -- a NaN stays
  end,
}
event {
  name = "flip",
  when = function() local _, wy = body:rate() return wy end,
  action = function(t) worst.flips[#worst.flips + 1] = t end,
}

figure { name = "period", unit = "s", value = function() return period end }

-- An error of 1e-13 of the first second has grown by exp(2.9 x 3) = 6000 when the body flips.
check { name = "rates at 1, 2, 3, 4 s", unit = "rad/s", value = function() return worst.known end, below = 1e-8 }
-- The time from flip to flip grows with the logarithm of how near to the axis the body passes: 1e-3 rad/s, of which 1e-10 is lost.
check { name = "from flip to flip", unit = "s", value = function() return worst.flips[2] - worst.flips[1] end, equal = { period / 2, tolerance = 1e-7 } }
-- Two passages of the unstable equilibrium multiply what is lost in the first one.
check { name = "rates after one period", unit = "rad/s", below = 1e-6, value = function() return vec.norm(vec.sub({ body:rate() }, w0)) end }
