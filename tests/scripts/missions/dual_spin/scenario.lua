-- A dual-spin satellite with a nutation damper on its platform [Likins 1967]. The bob moves along the spin axis at a distance r of it, with the
-- reduced mass mu against all else: that is a whole theory of small motions.
local A, C, spin_inertia = 150, 60, 40                      -- [kg m^2] across, of platform and rotor; of the platform and of the rotor about the axis
local m, rest, r, k, c = 2, 300, 1.2, 5, 3
local mu = m * rest / (m + rest)
local sat = vehicle "vehicle.yaml"
mission { duration = "400 s", integrator = { method = "dopri5", relative = 1e-9, absolute = 1e-12 }, output = { rate = "1 Hz" } }

-- Platform despun, h in the rotor: (A s^2 + h^2 / A + mu r^2 s^2) (mu s^2 + c s + k) = mu^2 r^2 s^4. The first coefficient is about the axis y.
local h = spin_inertia * 2
local function polynomial(re, im)
  local function times(a, b) return { a[1] * b[1] - a[2] * b[2], a[1] * b[2] + a[2] * b[1] } end
  local s = { re, im }
  local s2 = times(s, s)
  local left = times({ (A + mu * r ^ 2) * s2[1] + h ^ 2 / A, (A + mu * r ^ 2) * s2[2] }, { mu * s2[1] + c * s[1] + k, mu * s2[2] + c * s[2] })
  local right = times({ mu ^ 2 * r ^ 2 * s2[1], mu ^ 2 * r ^ 2 * s2[2] }, s2)
  return math.sqrt((left[1] - right[1]) ^ 2 + (left[2] - right[2]) ^ 2) / (k * h ^ 2 / A)
end
initial { platform = { angular_velocity = { 0, 0, 0 } }, rotor = { rate = 2 } }
local worst, n, nutation = 0, 0, nil
for _, pole in ipairs(sat:linearize().poles) do
  if pole.im > 1e-3 then
    worst, n = math.max(worst, polynomial(pole.re, pole.im)), n + 1
    if math.abs(pole.im - h / A) < 0.1 then nutation = pole end
  end
end
check { name = "modes with a frequency", value = function() return n end, equal = { 2, tolerance = 0 } }
check { name = "poles, of the polynomial", value = function() return worst end, below = 1e-11 }

-- A platform that turns with W, too, hr in the rotor. Hz = (C + mu r^2) W + hr. It may lean and turn on as it is, the bob out, at two Hz:
-- about y at (A + mu r^2) W, about x at A W + mu^2 r^2 W^3 / k. Between them it topples, below both the damper drives the nutation, above both
-- it is stable.
local W = 0.8
local about_x, about_y = ((A - C - mu * r ^ 2) * W + mu ^ 2 * r ^ 2 * W ^ 3 / k) / spin_inertia, (A - C) * W / spin_inertia
local function growth(rate)
  initial { platform = { angular_velocity = { 0, 0, W } }, rotor = { rate = rate - W } }
  local most = { re = -math.huge }
  for _, pole in ipairs(sat:linearize().poles) do
    if pole.re > most.re then most = pole end
  end
  return most
end
local driven, topples, still, stable = growth(about_x - 2e-3), growth(about_x + 2e-3), growth(about_y - 2e-3), growth(about_y + 2e-3)
check { name = "driven by its damper", unit = "rad/s", value = function() return math.abs(driven.im) > 1e-3 and driven.re or 0 end, above = 1e-6 }
for name, pole in pairs { ["topples about x"] = topples, ["topples about y"] = still } do
  check { name = name, unit = "rad/s", value = function() return pole.im == 0 and pole.re or 0 end, above = 1e-3 }
end
check { name = "stable", unit = "rad/s", value = function() return stable.re end, below = 1e-7 }    -- zeros that are double, to rounding

-- In time: a nutation of a hundredth of a degree decays as its pole says.
local small = 1e-4
initial { platform = { angular_velocity = { small, 0, 0 } }, rotor = { rate = 2 } }
local platform = sat:body "platform"
local function energy()
  local x, y = platform:rate()
  return A * x ^ 2 + (A + mu * r ^ 2) * y ^ 2
end
local seen = persist {}
controller { name = "look", rate = "1 Hz", step = function(t)
  if t == 100 then seen.first = energy() end
  if t == 400 then seen.last = energy() end
end }
-- A tenth of it is gone; what the bob has of it swings by some 1e-4.
check { name = "decay of the nutation", unit = "1/s", value = function() return -math.log(seen.last / seen.first) / 600 end, equal = { -nutation.re, tolerance = -0.01 * nutation.re } }
