-- Over the equator, in step with the Earth, its elliptic part pulls a satellite to the nearer end of its short axis [Blitzer 1965]: of its longitude u from there
-- u'' = -k^2 sin(2 u) / 2, k = 6 w R / a sqrt(J22), a pendulum's. It is at rest 20 degrees off, and passes the middle after a quarter K(sin^2 20 deg) / k.
local w, mu, R = 7.292115e-5, 398600.4418e9, 6378.137e3
local C, S = 2.43938e-6, -1.40027e-6                                          -- fully normalised
local J22, axis = math.sqrt((C ^ 2 + S ^ 2) * 5 / 12), math.atan(S, C) / 2 + math.pi / 2
local sat = vehicle "vehicle.yaml"
local u, a = math.rad(20), (mu / w ^ 2) ^ (1 / 3)
for _ = 1, 20 do a = (mu * (1 - 9 * J22 * (R / a) ^ 2 * math.cos(2 * u)) / w ^ 2) ^ (1 / 3) end   -- pulls of the whole, as it stands still
local x, y = a * math.cos(axis + u), a * math.sin(axis + u)
initial { sat = { position = { x, y, 0 }, velocity = { -w * y, w * x, 0 } } }
mission { duration = "300 day", integrator = { method = "dop853", relative = 1e-12, tolerances = { position = "1 mm", velocity = "1e-7 m/s" } }, output = { period = "10 day" } }
local hinge, seen = sat:hinge "sat", persist {}
event { name = "short axis", once = true, direction = "falling", when = function(t) return math.sin(math.atan(hinge:q "y", hinge:q "x") - w * t - axis) end,
        action = function() seen.t = mission.time() stop() end }
local quarter = elliptic.K(math.sin(u) ^ 2) / (6 * w * R / a * math.sqrt(J22)) / 86400
check { name = "quarter of the libration", unit = "day", value = function() return seen.t / 86400 end, equal = { quarter, tolerance = 1e-3 * quarter } }
