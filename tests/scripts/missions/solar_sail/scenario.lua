-- A sail that mirrors at a constant angle to the light goes out on a logarithmic spiral [Bacon 1959; McInnes 1999, 4.3.2].
local sat = vehicle "vehicle.yaml"
local mu, au, c, t = 1.32712440018e20, 149597870700, 299792458, 400 * 86400
mission { duration = t, integrator = { method = "dop853", relative = 1e-12 }, output = { period = "10 day" } }

-- With b the pull of light over that of the Sun, at v^2 = k mu / r and an angle g out of the circle, r^1.5 grows by 1.5 sqrt(k mu) sin g a second:
-- outward k (sin^2 g / 2 + cos^2 g) = 1 - b cos^3 a, along the circle k sin g cos g / 2 = b cos^2 a sin a.
local cosine, sine = math.sqrt(2 / 3), math.sqrt(1 / 3)
local b = 2 * 1361 / c * 1e4 / 100 * au * au / mu
local out, along = 1 - b * cosine ^ 3, b * cosine ^ 2 * sine
local x = (1 - math.sqrt(1 - 8 * (along / out) ^ 2)) / (2 * along / out)     -- tan g = along / out (tan^2 g + 2)
local g = math.atan(x)
local speed = math.sqrt(out / (0.5 * math.sin(g) ^ 2 + math.cos(g) ^ 2) * mu)   -- at r = 1
initial { arm = { rate = speed * math.cos(g) / au ^ 1.5 }, sail = { displacement = au, rate = speed * math.sin(g) / math.sqrt(au) } }
local r = (au ^ 1.5 + 1.5 * speed * math.sin(g) * t) ^ (2 / 3)
check { name = "distance from the Sun", unit = "m", equal = { r, tolerance = 1e-10 * r }, value = function() return sat:hinge "sail":q() end }
check { name = "angle about it", unit = "rad", equal = { math.log(r / au) / x, tolerance = 1e-10 }, value = function() return sat:hinge "arm":q() end }
