-- What air and light do to orbits, to first order, and how long a shadow lasts.
local mu, R, c = 398600.4418e9, 6378137, 299792458
device { type = "lua/meter", mounts = { at = "node", light = "light" }, states = { lit = "s" }, in_step = true,
         evaluate = function(a) return { lit = vec.norm(a.light) / 1361 } end }
local sat = vehicle "vehicle.yaml"
local a, beta = R + 700e3, math.rad(40)
local e, n = 1 - (R + 200e3) / a, math.sqrt(mu / a ^ 3)
local high = 42164e3
local N, speed, fast, turn = 10, math.sqrt(mu / high), math.sqrt(mu / a), math.sqrt(mu / high ^ 3)
mission { duration = N * 2 * math.pi / n, integrator = { method = "dop853", relative = 1e-13, tolerances = { position = 1e-6, velocity = 1e-9, angle = 1e-6, rate = 1e-9 } }, output = { period = "600 s" } }
local r, v = orbit.state({ a = a, e = e, inclination = 0.5, node = 0.3, periapsis = 1, anomaly = math.pi }, mu)
initial { low = { position = r, velocity = v }, high = { position = { high, 0, 0 }, velocity = { 0, speed, 0 } },
          shaded = { position = { 0, a, 0 }, velocity = { -fast * math.cos(beta), 0, fast * math.sin(beta) } } }

-- An orbit loses a^2 B integral rho (1 + e cos E)^(3/2) / (1 - e cos E)^(1/2) dE of its axis in each turn [King-Hele 1964], and of its eccentricity
-- a B (1 - e^2) integral rho cos E ((1 + e cos E) / (1 - e cos E))^(1/2) dE; smooth and periodic, so the mean of 200 places is exact.
local axis, flat = 0, 0
for i = 1, 200 do
  local x = math.cos(2 * math.pi * i / 200)
  local rho = 4e-9 * math.exp(-a * e * (1 - x) / 40e3) * 2 * math.pi / 200
  axis, flat = axis + rho * (1 + e * x) ^ 1.5 / (1 - e * x) ^ 0.5, flat + rho * x * ((1 + e * x) / (1 - e * x)) ^ 0.5
end
local B = 2.2 * 1e-4 / 100
local function elements(name) return orbit.elements({ sat:body(name):position() }, { sat:body(name):velocity() }, mu) end
local axis_lost, flat_lost = N * a * a * B * axis, N * a * B * (1 - e * e) * flat
check { name = "axis lost to air", unit = "m", value = function() return a - elements "low".a end, equal = { axis_lost, tolerance = 1e-4 * axis_lost } }
check { name = "eccentricity lost", unit = "1", value = function() return e - elements "low".e end, equal = { flat_lost, tolerance = 1e-4 * flat_lost } }

-- Light that pushes by f along -x moves the eccentricity of a circle by f (sin cos, 1 + sin^2) / (n a) a second: 3/2 f / (n a) along y, and what goes round.
local f, t = 1361 / c * 1e-5, N * 2 * math.pi / n
local ex, ey = f / (turn * high) * (1 - math.cos(2 * turn * t)) / (4 * turn), f / (turn * high) * (1.5 * t - math.sin(2 * turn * t) / (4 * turn))
local function pushed()
  local x, y = sat:body "high":position()
  local vx, vy = sat:body "high":velocity()
  local h, far = x * vy - y * vx, math.sqrt(x * x + y * y)
  return vy * h / mu - x / far, -vx * h / mu - y / far
end
check { name = "eccentricity by light, x", unit = "1", value = function() return (pushed()) end, equal = { ex, tolerance = 1e-4 * math.abs(ey) } }
check { name = "eccentricity by light, y", unit = "1", value = function() return (select(2, pushed())) end, equal = { ey, tolerance = 1e-4 * math.abs(ey) } }

-- A circle whose plane is turned by beta to the Sun is in shadow for acos(sqrt(a^2 - R^2) / (a cos beta)) / pi of each turn.
local lit = 1 - math.acos(math.sqrt(a * a - R * R) / (a * math.cos(beta))) / math.pi
check { name = "part in light", unit = "1", value = function() return sat:device "meter":get "lit" * n / (N * 2 * math.pi) end, equal = { lit, tolerance = 1e-7 } }
