-- Chaplygin's sleigh (1911): a blade that slides along its edge and not across. Such a condition on rates is a force across the blade that
-- grows with what it slips by, here some 1e-6 m/s. With u along the blade, a from it to the mass centre, k^2 = I / m + a^2:
--   u' = a w^2,  k^2 w' = -a u w:   u = V tanh s,  w = (V / k) / cosh s,  s = s_0 + a V t / k^2,  V^2 = u^2 + k^2 w^2
device { type = "lua/edge", mounts = { at = "node" }, params = { resistance = "N s/m" }, in_step = true,
         evaluate = function(a) return { at = { force = { 0, -a.resistance * a.at.velocity[2], 0 } } } end }
local sat = vehicle "vehicle.yaml"
local sleigh, blade = sat:hinge "sleigh", sat:node "sleigh.blade"
local u, w, angle = -0.7, 0.8, 0.3                   -- it begins backwards, and turns round
local a, k2 = 0.5, 0.4 / 2 + 0.5 ^ 2
local along = angle + math.atan(0.3, 0.4)
local x, y = -0.3 * math.cos(angle), -0.3 * math.sin(angle)   -- of the blade
initial { sleigh = { angle = angle, rate = w, vx = u * math.cos(along) + w * y, vy = u * math.sin(along) - w * x } }
mission { duration = 8, integrator = { method = "cvode_bdf", relative = 1e-10 }, output = { rate = "10 Hz" } }

local k, V = math.sqrt(k2), math.sqrt(u ^ 2 + k2 * w ^ 2)
local s0 = 0.5 * math.log((V + u) / (V - u))
local s = s0 + a * V * 8 / k2
local function gudermann(z) return 2 * math.atan(math.exp(z)) end
local function speed() local v, turned = { blade:velocity() }, sleigh:q "angle" + along - angle
  return v[1] * math.cos(turned) + v[2] * math.sin(turned) end
-- The force across, at most 1.4 N, slips 1.4e-6 m/s and, for the 2 s in which it turns round, takes 3e-6 J: 2e-6 m/s of V; 1e-5 m slipped are as many rad.
check { name = "speed along the blade", unit = "m/s", value = speed, equal = { V * (1 - 2 / (math.exp(2 * s) + 1)), tolerance = 2e-6 } }
check { name = "rate", unit = "rad/s", value = function() return sleigh:v "rate" end,
        equal = { V / k * 2 / (math.exp(s) + math.exp(-s)), tolerance = 2e-6 } }
check { name = "angle", unit = "rad", value = function() return sleigh:q "angle" end,
        equal = { angle + k / a * (gudermann(s) - gudermann(s0)), tolerance = 1e-5 } }
