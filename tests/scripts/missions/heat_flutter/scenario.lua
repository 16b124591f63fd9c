-- Heat takes its time: a boom bends by a moment that lags behind what it is turned to the Sun [Etkin & Hughes 1967], J q'' + c q' + k q = -g u,
-- T u' = q - u. With d, K, G = c, k, g over J its poles are those of s^3 + (d + 1/T) s^2 + (K + d/T) s + (K + G) / T: by Routh it flutters where G is more
-- than d (d + 1/T + K T), and there swings on by w^2 = K + d/T.
local J, c, k, T = 1e-3 + 0.5 * 4, 0.05, 2, 3
local d, K = c / J, k / J
local G, w = d * (d + 1 / T + K * T), math.sqrt(K + d / T)
device {
  type = "lua/heat", mounts = { at = "hinge" }, params = { lag = { 1, "s" }, gain = { 1, "N m" } }, states = { bent = "1" }, in_step = true,
  evaluate = function(a) return { bent = (a.at.q - a.bent) / a.lag, at = -a.gain * a.bent } end,
}
local sat = vehicle("vehicle.yaml", { ["devices.sun.gain"] = G * J })
mission { duration = 20, integrator = { method = "dop853", relative = 1e-11 } }
local real, pair = 0, 0
for _, p in ipairs(sat:linearize {}.poles) do
  if p.im == 0 then real = p.re elseif p.im > 0 then pair = p end
end
check { name = "decays", unit = "1/s", value = function() return real end, equal = { -(d + 1 / T), tolerance = 1e-12 } }
check { name = "neither grows nor decays", unit = "1/s", value = function() return pair.re end, equal = { 0, tolerance = 1e-12 } }
check { name = "flutters at", unit = "rad/s", value = function() return pair.im end, equal = { w, tolerance = 1e-12 } }
-- From q = q0, u = 0 at rest: q = a cos(w t) + b sin(w t) + e exp(-r t) with q'' = -K q0.
local q0, r = 0.01, d + 1 / T
local e = q0 * (w ^ 2 - K) / (w ^ 2 + r ^ 2)
local angle = (q0 - e) * math.cos(20 * w) + r * e / w * math.sin(20 * w) + e * math.exp(-20 * r)
check { name = "angle", unit = "rad", value = function() return sat:hinge "boom":angle() end, equal = { angle, tolerance = 1e-11 } }
