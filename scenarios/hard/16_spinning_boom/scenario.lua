-- A boom of 10 m spins at 1.7 times the frequency that it has at rest: its own tension holds it. Without the displacement of second order it turns
-- unstable at that frequency.

local sat = vehicle "vehicle.yaml"
local length, rho_A, EI = 10, 1.2, 14000              -- as in vehicle.yaml, SI; the boom of Kane, Ryan and Banerjee (1987)
local unit = math.sqrt(EI / (rho_A * length ^ 4))     -- [rad/s], of which eta and mu are multiples
local eta = 6

-- Flapping, w'''' - eta^2 / 2 ((1 - x^2) w')' = mu^2 w, clamped at 0 and free at 1, as a power series (Wright et al. 1982).
local terms = 120
local function series(mu, a2, a3)
  local a = { [0] = 0, 0, a2, a3 }
  for k = 0, terms - 4 do
    a[k + 4] = (eta ^ 2 / 2 * ((k + 2) * (k + 1) * a[k + 2] - k * (k + 1) * a[k]) + mu ^ 2 * a[k]) / ((k + 4) * (k + 3) * (k + 2) * (k + 1))
  end
  local bend, shear = 0, 0                            -- at the free end
  for k = 2, terms do bend, shear = bend + k * (k - 1) * a[k], shear + k * (k - 1) * (k - 2) * a[k] end
  return bend, shear, a
end
local function determinant(mu)
  local b2, s2 = series(mu, 1, 0)
  local b3, s3 = series(mu, 0, 1)
  return b2 * s3 - b3 * s2, -b2 / b3
end
local a, b = 7.3, 7.4
for _ = 1, 60 do
  local middle = 0.5 * (a + b)
  if determinant(a) * determinant(middle) > 0 then a = middle else b = middle end
end
local mu, _, ratio = a, determinant(a)
local _, _, w = series(mu, 1, ratio)

-- The shapes of vehicle.yaml, coefficients of x^2 to x^7, orthogonal with norm 1: the first motion of the spinning boom by its projections.
local shapes = {
  { 3.515944586285051, -1.6123243871164993, -0.004447254509003459, 0.0096857759575015119, 0.11053386299873101, -0.019392582951221248 },
  { -21.825456662217684, 32.190233485908633, 14.397119426386274, -33.253290562486949, 8.1200701269418553, 2.371402957525335 },
  { 58.402031408666412, -102.54222555931802, -367.0647768023731, 1082.1491753999421, -946.64593730862932, 277.70272752334988 },
  { -209.63527126659609, 1365.1631241974713, -3132.1781816909957, 3129.1285319072974, -1283.6612495472132, 133.44926931438159 },
  { 409.57504120526877, -3731.8033455049718, 12477.400283785745, -19491.681354448875, 14410.744103556128, -4071.6564589224852 },
  { -319.25198349450553, 3411.9231697189248, -13261.953029960775, 23933.582264011126, -20349.696894544981, 6591.4141535965026 },
}
local tip, bent = 0, {}
for k = 0, terms do tip = tip + w[k] end
for i, shape in ipairs(shapes) do
  local sum = 0
  for j, c in ipairs(shape) do
    for k = 0, terms do sum = sum + c * w[k] / (j + k + 2) end
  end
  bent[i] = 1e-4 * sum / tip                          -- [m]: a tip that is off by 1e-5 of the length changes nothing by more than 1e-10
end
local function tip_of(modes)
  local sum = 0
  for i, shape in ipairs(shapes) do
    local at_tip = 0
    for _, c in ipairs(shape) do at_tip = at_tip + c end
    sum = sum + at_tip * modes:eta(i)
  end
  return sum / 1e-4
end
-- In the plane of the spin the same shapes feel the mass that they carry outward: mu^2 - eta^2.
local flapping, lagging = mu * unit, math.sqrt(mu ^ 2 - eta ^ 2) * unit

-- At rest: cos b cosh b = -1. Without Q the whole omega^2 that is left in the plane is omega_1^2 - Omega^2.
local at_rest = 1.8751040687119611 ^ 2 * unit
local slower, faster = 0.99 * at_rest, 1.01 * at_rest
local sway, growth = math.sqrt(at_rest ^ 2 - slower ^ 2), math.sqrt(faster ^ 2 - at_rest ^ 2)

initial {
  flap = { rate = eta * unit, eta = bent }, lag = { rate = eta * unit, eta = bent },
  slower = { rate = slower, eta = { 1e-6, 0, 0, 0, 0, 0 } }, faster = { rate = faster, eta = { 1e-6, 0, 0, 0, 0, 0 } },
}
mission {
  title = "a boom that its spin holds",
  duration = 10,
  integrator = { method = "dop853", relative = 1e-8, absolute = 1e-14 },
  output = { rate = "10 Hz" },
}
local worst = persist { flap = 0, lag = 0, slower = 0, faster = 0 }
local function see(name, e) if not (math.abs(e) <= worst[name]) then worst[name] = math.abs(e) end end   -- a NaN stays
local flap, lag, below, above = sat:modes "flap", sat:modes "lag", sat:modes "slower", sat:modes "faster"
local function cosh(x) return 0.5 * (math.exp(x) + math.exp(-x)) end
controller {
  name = "comparison", rate = "10 Hz",
  step = function(t)
    see("flap", tip_of(flap) - math.cos(flapping * t))
    see("lag", tip_of(lag) - math.cos(lagging * t))
    see("slower", below:eta(1) / 1e-6 - math.cos(sway * t))
    see("faster", above:eta(1) / 1e-6 / cosh(growth * t) - 1)
  end,
}
figure { name = "spin over the frequency at rest", value = function() return eta * unit / at_rest end }
figure { name = "rate at which the linear boom turns unstable", unit = "rad/s", value = function() return at_rest end }
figure { name = "flapping", unit = "rad/s", value = function() return flapping end }
figure { name = "lagging", unit = "rad/s", value = function() return lagging end }
check { name = "mu of the series, as published", value = function() return mu end, equal = { 7.360373019, tolerance = 1e-9 } }
-- Six polynomials have 1.2e-7 of mu too much, which in 80 rad is 1e-5, and 1e-6 of mu in the plane; and 3e-5 of the shape that is in other modes.
check { name = "tip out of the plane, over its amplitude", value = function() return worst.flap end, below = 2e-4 }
check { name = "tip in the plane, over its amplitude", value = function() return worst.lag end, below = 2e-4 }
-- In the plane Omega^2 is 98 and 102 % of omega_1^2, known to 1e-9: what is left is known to 5e-8, its root over 5 rad to 1e-7.
check { name = "without Q, slower, over its amplitude", value = function() return worst.slower end, below = 1e-6 }
check { name = "without Q, faster, relative to its growth", value = function() return worst.faster end, below = 1e-6 }
