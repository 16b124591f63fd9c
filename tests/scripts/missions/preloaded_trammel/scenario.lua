-- The trammel of Archimedes: two sliders on lines at right angles, a rod of length L at the angle a to the first between them, which two springs pull by
-- 12 N and 16 N. With x = L cos a, y = L sin a the energy has V'' = k_x y^2 + k_y x^2 + F_x x + F_y y in a, the inertia is m_x y^2 + m_y x^2: the rod in
-- tension is as much stiffness as the springs.
local sat = vehicle "vehicle.yaml"
mission { duration = 1e-3 }
local rate = math.sqrt((50 * 0.64 + 100 * 0.36 + 12 * 0.6 + 16 * 0.8) / (2 * 0.64 + 3 * 0.36))
local modes = sat:system_modes {}
check { name = "rate of the mode", unit = "rad/s", value = function() return 2 * math.pi * modes.frequency[1] end, equal = { rate, tolerance = 1e-12 * rate } }
check { name = "pole", unit = "rad/s", value = function() return math.abs(sat:linearize({}).poles[1].im) end, equal = { rate, tolerance = 1e-12 * rate } }
