-- A robot whose platform goes without turning [Clavel 1988]: of each arm an elbow at R + L cos u out and L sin u down, and two rods side by side to what is r
-- out on the platform, so that three spheres of radius l meet at its middle p. Motion is that of three angles, T = m p'^2 / 2 + I u'^2 / 2.
local R, r, L, l, m, I, g = 0.2, 0.05, 0.25, 0.6, 0.8, 0.3 * 0.25 ^ 2 / 3, 9.81
local angles, torques = { 0.2, 0.45, 0.6 }, { -1, -2.5, -2 }
local sat = vehicle "vehicle.yaml"
mission { duration = "1 ms" }
local dot, sub, add, scale = vec.dot, vec.sub, vec.add, vec.scale

-- Middles of the spheres and how they move with their angles, then the lower of the two points where they meet.
local c, moves = {}, {}
for k, u in ipairs(angles) do
  local out, down = { math.cos(2 * math.pi * (k - 1) / 3), math.sin(2 * math.pi * (k - 1) / 3), 0 }, { 0, 0, -1 }
  c[k] = add(scale(R - r + L * math.cos(u), out), scale(L * math.sin(u), down))
  moves[k] = add(scale(-L * math.sin(u), out), scale(L * math.cos(u), down))
end
local x = vec.unit(sub(c[2], c[1]))
local far, along = vec.norm(sub(c[2], c[1])), dot(x, sub(c[3], c[1]))
local y = vec.unit(sub(sub(c[3], c[1]), scale(along, x)))
local across = dot(y, sub(c[3], c[1]))
local px = far / 2
local py = (along ^ 2 + across ^ 2 - 2 * along * px) / (2 * across)
local place = add(c[1], add(add(scale(px, x), scale(py, y)), scale(-math.sqrt(l ^ 2 - px ^ 2 - py ^ 2), vec.cross(x, y))))

-- (p - c_k) . p' = (p - c_k) . c_k' u_k', so p' = J u', and from rest (m J* J + I) u'' = torque - m g dz/du + the weight of the arms.
local rods, arms = {}, {}
for k = 1, 3 do
  local d = sub(place, c[k])
  rods[k], arms[k] = d, { 0, 0, 0 }
  arms[k][k] = dot(d, moves[k])
end
rods, arms = matrix(rods), matrix(arms)
local J, M, push, weigh = {}, {}, {}, 0.3 * g * L / 2
for k = 1, 3 do J[k] = rods:solve(arms:column(k)) end
for i = 1, 3 do
  M[i], push[i] = {}, torques[i] - m * g * J[i][3] + weigh * math.cos(angles[i])
  for k = 1, 3 do M[i][k] = m * J[i]:dot(J[k]) + (i == k and I or 0) end
end
local expected = matrix(M):solve(push)

for k = 1, 3 do sat:hinge("arm_" .. k):torque(torques[k]) end
local found = { place = { sat:body "platform":position() }, v = sim:vdot(), ways = sat:closed_system():mobility() }
local function is(name, unit, value, number, tolerance) check { name = name, unit = unit, value = function() return value end, equal = { number, tolerance = tolerance } } end
is("ways to move", "1", found.ways, 3, 0)
for i, name in ipairs { "x", "y", "z" } do is("platform " .. name, "m", found.place[i], place[i], 1e-12) end
for k = 1, 3 do is("arm " .. k, "rad/s^2", found.v["arm_" .. k .. ".rate'"], expected[k], 1e-9 * vec.norm { expected[1], expected[2], expected[3] }) end
for _, turn in ipairs { "wx", "wy", "wz" } do is("platform " .. turn, "rad/s^2", found.v["platform." .. turn .. "'"], 0, 1e-9) end
