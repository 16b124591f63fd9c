-- Frames whose last corner is closed by a loop: a portal, rings in pieces, a tensegrity.
local sat = vehicle "vehicle.yaml"
mission { duration = 1e-6 }
local found = sat:equilibrium { move = { "lid" } }
initial(found.initial)

-- Two legs and a bar of 1 m, clamped: in their plane by the dynamic stiffness of Euler's and Bernoulli's beams that stretch, solved for its zeros in 12
-- digits. Finite elements, 20 of each beam, are off by some 1e-6, twelve modes of each by up to 3e-5.
local modes = sat:system_modes { elastic = 40, rigid = 20 }
local function nearest(expected)
  local best = math.huge
  for i = 1, #modes.frequency do
    if math.abs(modes.frequency[i] - expected) < math.abs(best - expected) then best = modes.frequency[i] end
  end
  return best
end
for i, frequency in ipairs { 7.496470385, 29.582996096, 48.257671286, 52.320263882 } do
  check { name = "portal, " .. i, unit = "Hz", value = function() return nearest(frequency) end, equal = { frequency, tolerance = 5e-5 * frequency } }
end

-- Rings of the radius 1 m by Hoppe [1871] in their plane and by Michell [1890] across [Love 1927, 293]. Of n straight pieces they are higher by some
-- 4.4 / n^2; what is left of the limit of 12 and 24 is of the order of the square of the first, 1e-3.
local E, G, A, I, J, density = 70e9, 70e9 / 2.6, 1e-4, 1e-8 / 12, 0.1405770 * 1e-8, 2700
local function extrapolated(expected)
  local coarse, fine = nearest(expected * (1 + 4.4 / 12 ^ 2)), nearest(expected * (1 + 4.4 / 24 ^ 2))
  return fine + (fine - coarse) / 3
end
for n = 2, 3 do
  local along = n * (n ^ 2 - 1) / math.sqrt(n ^ 2 + 1) * math.sqrt(E * I / (density * A)) / (2 * math.pi)
  local across = n * (n ^ 2 - 1) / math.sqrt(n ^ 2 + E * I / (G * J)) * math.sqrt(E * I / (density * A)) / (2 * math.pi)
  check { name = ("ring, %d waves in its plane"):format(n), unit = "Hz", value = function() return extrapolated(along) end, equal = { along, tolerance = 1e-3 * along } }
  check { name = ("ring, %d waves across"):format(n), unit = "Hz", value = function() return extrapolated(across) end, equal = { across, tolerance = 1e-3 * across } }
end

-- Three struts of 2 between triangles of the radius 1, and ropes that hold them: at rest the lid is turned by 150 degrees [Tibert & Pellegrino 2003],
-- where ropes are shortest. Then it goes up and down as it turns, on the potential of three ropes.
local q = { sat:body "lid":attitude() }
check { name = "twist of the tensegrity", unit = "deg", value = function() return math.deg(2 * math.atan(q[4], q[1])) end, equal = { 150, tolerance = 1e-7 } }
