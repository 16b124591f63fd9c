-- At the borders between what a shaken pivot holds and what falls or swings up, x'' + (a - 2 q cos 2s) x = 0 has solutions that are periodic.
local g = 9.81

-- Upright on z = -A cos(w t), s = w t / 2: a = -4 c g / w^2, q = 2 c A with c = m l / J. The border is a_0, at q = 1 that of ce_0 [DLMF 28.2, 28.4].
local a_0, ratio = -0.45513860410741355, 2.5945590177972769 -- ce_0(pi / 2) / ce_0(0)
local c = 0.6 / (0.05 + 2 * 0.3 ^ 2)
local w = math.sqrt(-4 * c * g / a_0)
-- Hanging on z = A cos(w t): a = 4 g / (l w^2), q = 2 A / l. The border is b_1, at q = 1/2 that of se_1, which begins at zero.
local b_1, slope = 0.47065435493383911, 1.2772599061790129 -- se_1(pi / 2) / se_1'(0)
local l = 4 * g / (b_1 * w ^ 2)

local sat = vehicle("vehicle.yaml", { ["bodies.hanging.com"] = { 0, 0, -l } })
mission { duration = 7 * math.pi / w, integrator = { method = "dopri5", relative = 1e-12, absolute = 1e-18 }, output = { rate = "10 Hz" } }
local frequency = w / (2 * math.pi)
sat:hinge("upper_shaker"):profile { sine = { amplitude = 1 / (2 * c), frequency = frequency, phase = -math.pi / 2 } }
sat:hinge("lower_shaker"):profile { sine = { amplitude = l / 4, frequency = frequency, phase = math.pi / 2 } }

-- Beyond 1e-6 rad the pendulums are not linear: that is worth 1e-12 of a, and of what is not periodic some hundred times as much.
local small = 1e-6
initial { inverted = { angle = small }, hanging = { rate = small * w / 2 } }
check { name = "inverted", equal = { ratio, tolerance = 1e-9 }, value = function() return sat:hinge("inverted"):angle() / small end }
check { name = "hanging", equal = { -slope, tolerance = 1e-9 }, value = function() return sat:hinge("hanging"):angle() / small end }
