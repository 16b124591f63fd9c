-- A ball that comes to rest after bounces without end, one that jumps in step with a table, and rows of balls that hand on a blow.
local sat = vehicle "vehicle.yaml"
mission { duration = "4.1 s", integrator = { relative = 1e-10 }, output = { rate = "20 Hz" } }
local g = 9.81

-- Each bounce takes e times the one before: the fifth is at t_1 (1 + 2 (e + e^2 + e^3 + e^4)), with e^5 of the first speed after it.
local ball, e, first = sat:hinge "ball", 0.5, math.sqrt(2 / g)
local fifth, speed = first * (1 + 2 * (e + e ^ 2 + e ^ 3 + e ^ 4)), g * first * e ^ 5
local seen = persist { height = 0 }
controller { name = "look", rate = "100 Hz", step = function(t) if t == 1.32 then seen.height = ball:q() end end }
check { name = "after five bounces", unit = "m", value = function() return seen.height end, equal = { speed * (1.32 - fifth) - g * (1.32 - fifth) ^ 2 / 2, tolerance = 1e-9 } }
check { name = "at rest", unit = "m", value = function() return ball:q() end, equal = { -g / 1e4, tolerance = 1e-9 } }

-- A ball jumps once for each period of a table whose speed makes good what a blow takes, u = (1 - e) / (1 + e) g T / 2 [Holmes 1982]; below
-- phases of pi (1 - e^2) tan(phase) < 2 (1 + e^2) what disturbs it dies away.
local period, phase, r = 0.2, 0.5, 0.8
local u = (1 - r) / (1 + r) * g * period / 2
local table_, hopper = sat:hinge "table", sat:hinge "hopper"
table_:profile { sine = { amplitude = u * period / (2 * math.pi * math.cos(phase)), frequency = 1 / period, phase = phase } }
initial { table = { rate = u }, hopper = { rate = g * period / 2 - u } }
check { name = "on the way for the twenty-first time", unit = "m", value = function() return table_:q() + hopper:q() end, equal = { g * period ^ 2 / 8, tolerance = 1e-9 } }

-- Of equal balls the last one flies away, with gaps between them or none.
for _, row in ipairs { "a", "b" } do
  for i = 1, 4 do
    check { name = row .. i, unit = "m/s", value = function() return (sat:body(row .. i):velocity()) end, equal = { i == 4 and 1 or 0, tolerance = 1e-12 } }
  end
end
-- Struck at both ends in one instant, at 2 and 1 m/s, each blow goes through to the other end.
for i, speed in ipairs { -1, 0, 0, 0, 2 } do
  check { name = "c" .. i, unit = "m/s", value = function() return (sat:body("c" .. i):velocity()) end, equal = { speed, tolerance = 1e-12 } }
end
