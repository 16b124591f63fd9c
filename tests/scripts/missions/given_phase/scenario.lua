-- A crank of given motion turns a shaft whose phase against it is given too. Only the crank and the wheel are told how they begin: all
-- else begins with the rates that go with them and with the beginning of the phase, and nothing is struck.
local sat = vehicle "vehicle.yaml"
local crank, shaft, slide, wheel, arm = sat:hinge "crank", sat:hinge "shaft", sat:hinge "slide", sat:hinge "wheel", sat:hinge "arm"
mission { duration = 2, output = { rate = "10 Hz" } }
crank:profile { rate_table = { { 0, 1.5 }, { 1, 1.5 }, { 3, 3.5 } } }
sat:loop "phase":profile { rate_table = { { 0, 0.3 }, { 1, 0.3 }, { 3, -0.7 } } }
sat:loop "turn":profile { hold = 0 }
local began = persist {}
controller { name = "looks", rate = "1 Hz", step = function(t) if t == 0 then began.rates = { shaft:v(), slide:v(), wheel:v(), arm:v() } end end }
for i, rate in ipairs { 3.3, 0.33, -6.6, 3.3 } do
  check { name = "rate at the start " .. i, value = function() return began.rates[i] end, equal = { rate, tolerance = 1e-14 } }
end
local q, v = 2 * (1.5 + 1.5 + 0.5) + 0.3 + 0.3 - 0.25, 2 * 2.5 - 0.2
check { name = "angle of the shaft", unit = "rad", value = function() return shaft:q() end, equal = { q, tolerance = 1e-13 } }
check { name = "rate of the arm", unit = "rad/s", value = function() return arm:v() end, equal = { v, tolerance = 1e-13 } }
-- s'' = 2 - 0.5; the shaft feels what it, the wheel, the arm and the slide take.
local s2 = 2 * 1 - 0.5
check { name = "force that the phase takes", unit = "N m", value = function() return sat:loop "phase":multiplier() end,
        equal = { (0.03 + 4 * 0.03 + 0.03) * s2 + 2 * 0.01 * math.cos(q) * (math.cos(q) * s2 - math.sin(q) * v ^ 2), tolerance = 1e-12 } }
