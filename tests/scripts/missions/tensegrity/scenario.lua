-- A prism of three bars that fly free and touch nowhere, held by nine ropes under tension [Skelton & de Oliveira 2009]. It turns as a whole, and each bar
-- about itself, without any force: nine motions, of which three only the ropes together leave alone. The nine others are those of the matrix of second
-- differences of the energy of all ropes, about bars of two angles and three places each, in a program of its own (8 digits).
local sat = vehicle "vehicle.yaml"
mission { duration = 1e-3 }
initial(sat:equilibrium({ move = { "bar_1", "bar_2", "bar_3" } }).initial)
local modes = sim:system_modes { elastic = 18 }
check { name = "rigid-body motions", value = function() return modes.n_rigid end, equal = { 9, tolerance = 0 } }
for i, rate in ipairs { 32.00257006, 98.59652705, 98.59652706, 117.83300342, 117.83300342, 170.04808791, 190.07182938, 190.07182939, 232.94690519 } do
  check { name = "mode " .. i, unit = "rad/s", value = function() return 2 * math.pi * modes.frequency[modes.first_elastic + i - 1] end, equal = { rate, tolerance = 1e-6 } }
end
