-- A test mass on a suspension of 1e-6 N/m in a spacecraft whose boom vibrates with up to 700 Hz: along each axis the two masses have the frequency of the
-- reduced mass, sqrt(k (1 / m + 1 / M)) (Landau, Lifshitz 1976, Mechanics, 13), with closed loops and without, less than a millionth of the highest one.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s" }
local closed = sat:system_modes { elastic = 30 }
local open = sat:closed_system():open_tree():system_modes { elastic = 30 }
check { name = "rigid-body modes", value = function() return closed.n_rigid end, equal = { 6 } }
check { name = "rigid-body modes without the strut", value = function() return open.n_rigid end, equal = { 7 } }
for i, k in ipairs { 2e-6, 3e-6, 4e-6 } do
  local wanted = math.sqrt(k * (1 / 2 + 1 / 105.7)) / (2 * math.pi)
  for name, modes in pairs { closed = closed, open = open } do
    local nearest = math.huge
    for j = 1, #modes.frequency do
      if math.abs(modes.frequency[j] - wanted) < math.abs(nearest - wanted) then nearest = modes.frequency[j] end
    end
    check { name = ("%s, axis %d"):format(name, i), unit = "Hz", value = function() return nearest end, equal = { wanted, tolerance = 1e-7 * wanted } }
  end
end
