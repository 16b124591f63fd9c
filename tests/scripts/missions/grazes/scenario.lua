-- Two crossings within one step: both are located, whatever the length of the steps.
local sat = vehicle "vehicle.yaml"
mission { duration = "20 s", integrator = { method = "dopri5", relative = 1e-11 }, output = { rate = "0.05 Hz" } }
local g, m = 9.81, 2

-- Up to a stop, or a ceiling, a millimetre below where it would turn round: into it with v, for (2 / w) atan(v w / g), w^2 = k / m.
local up, level, w = 5, 1.273, math.sqrt(5e3 / m)
local into = math.sqrt(up ^ 2 - 2 * g * level)
local back = 2 * (up - into) / g + 2 / w * math.atan(into * w / g)
for _, name in ipairs { "stopped", "thrown" } do
  local body, t = sat:hinge(name), 20 - back
  check { name = name .. ": its place", unit = "m", value = function() return body:q() end, equal = { -up * t - g * t ^ 2 / 2, tolerance = 1e-6 } }
end
