-- A pendulum that what carries it round a sphere does not disturb [Schuler 1923]: hung at R with J = m l (R - l), it is turned by what accelerates its pivot
-- as fast as the vertical turns. Tilted at rest it swings once in 84 min, w^2 = m mu l R / (R - l)^3 / (J + m l^2).
local R, J, m, mu = 6371e3, 1, 2, 398600.4418e9
local l = 2 * J / m / (R + math.sqrt(R * R - 4 * J / m))
local sat = vehicle("vehicle.yaml", { ["bodies.carried.com"] = { 0, 0, -l }, ["bodies.resting.com"] = { 0, 0, -l } })
local period = 2 * math.pi / math.sqrt(m * mu * l * R / (R - l) ^ 3 / (J + m * l * l))
mission { duration = 1.25 * period, integrator = { method = "dop853", relative = 1e-12 }, output = { period = "100 s" } }
sat:hinge "carrier":profile { rate_table = { { 0, 0 }, { 1000, 1e-4 }, { 2000, -2e-4 }, { 3000, 0 } } }
local worst = persist { tilt = 0 }
controller { name = "tilt", period = "100 s", step = function() worst.tilt = math.max(worst.tilt, math.abs(sat:hinge "carried":angle())) end }
check { name = "way", unit = "km", value = function() return R * sat:hinge "carrier":angle() / 1e3 end, equal = { -637.1, tolerance = 1e-6 } }
check { name = "the carried one stays upright", unit = "rad", value = function() return worst.tilt end, below = 1e-14 }
check { name = "the resting one passes its middle", unit = "rad", value = function() return sat:hinge "resting":angle() end, equal = { 0, tolerance = 1e-12 } }
