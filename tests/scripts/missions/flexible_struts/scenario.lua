-- A platform on six struts that give way along themselves [Gough 1957]: its stiffness is the sum of E A / l over the struts of J* J, J = [p x t, t] with
-- t along a strut and p where it holds the platform. Struts weigh 15 g in all, of which the platform carries a third.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 ms" }
local EA, mass, height = 70e9 * 1e-6, { 12, 14, 20, 100, 100, 100 }, 0.9
local below, above = { -10, 10, 110, 130, 230, 250 }, { -50, 50, 70, 170, 190, 290 }
local K = {}
for i = 1, 6 do K[i] = { 0, 0, 0, 0, 0, 0 } end
for k = 1, 6 do
  local p = { 0.6 * math.cos(math.rad(above[k])), 0.6 * math.sin(math.rad(above[k])), 0 }
  local way = { p[1] - math.cos(math.rad(below[k])), p[2] - math.sin(math.rad(below[k])), height }
  local l, t = vec.norm(way), vec.unit(way)
  local J = vec.cross(p, t)
  for i = 1, 3 do J[3 + i] = t[i] end
  for i = 1, 6 do for j = 1, 6 do K[i][j] = K[i][j] + EA / l * J[i] * J[j] / math.sqrt(mass[i] * mass[j]) end end
end
local squares, modes = matrix(K):eigenvalues(), sat:system_modes { elastic = 6 }
check { name = "rigid modes", unit = "1", value = function() return modes.n_rigid end, equal = { 0, tolerance = 0 } }
for i = 1, 6 do
  local w = math.sqrt(squares[i])
  check { name = "mode " .. i, unit = "rad/s", value = function() return 2 * math.pi * modes.frequency[i] end, within = { w * (1 - 1e-4), w } }
end
