-- A tether that is let out from a station on a circle, at a constant speed.
local sat = vehicle "vehicle.yaml"
local mu, r, span, l, v = 398600.4418e9, 7e6, 5000, 1000, 0.01
mission { duration = span, integrator = { method = "dop853", relative = 1e-11 }, output = { period = "1 min" } }
local n = math.sqrt(mu / r ^ 3)
initial { station = { position = { r, 0, 0 }, velocity = { 0, n * r, 0 }, angular_velocity = { 0, 0, n } } }
sat:hinge("tip"):profile { hold = v }

-- l x'' + 2 l' (x' + n) + 3 n^2 l x = 0 for a small angle x from the vertical in the plane of the orbit [Beletsky & Levin 1993]; with
-- l' = v its left-hand side is y'' + 3 n^2 y + 2 v n of y = l x. x is 0.012 at most and matters squared, l / r is 1.5e-4.
local reel = sat:hinge "reel"
local y = -2 * v / (3 * n) * (1 - math.cos(math.sqrt(3) * n * span))
check { name = "tip ahead of the vertical", unit = "m", equal = { y, tolerance = 2e-3 * 4 * v / (3 * n) }, value = function() return (l + v * span) * reel:angle() end }
-- The tether pulls by m l ((n + x')^2 - n^2 + 3 n^2 cos(x)^2).
local k, L = math.sqrt(3) * n, l + v * span
local turning = (-2 * v / (3 * n) * k * math.sin(k * span) - v * y / L) / L
local pull = L * ((n + turning) ^ 2 - n ^ 2 + 3 * n ^ 2 * math.cos(y / L) ^ 2)
local tip = sat:hinge "tip"
check { name = "pull of the tether", unit = "N", equal = { pull, tolerance = 5e-4 * pull }, value = function() return -tip:applied() end }
