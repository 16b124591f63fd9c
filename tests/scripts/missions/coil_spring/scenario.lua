-- A coil spring as a polygon of straight pieces: a force along its axis bends and twists them by its moment there, and its end gives way by
-- integral M_t^2 / (G J) + M_b^2 / (E I) + N^2 / (E A) ds [Castigliano 1879; Love 1927 of the helix], here by Gauss's rule, exact for squares of what is linear.
local E, G, A, I, radius, rise, each, n = 70e9, 70e9 / 2.6, math.pi * 1e-6, math.pi / 4 * 1e-12, 0.05, 0.03, 12, 24
local function corner(k)
  local turn = 2 * math.pi * k / each
  return { radius * math.cos(turn), radius * math.sin(turn), rise * k / each }
end
local compliance = 0
for k = 1, n do
  local a, way = corner(k - 1), vec.sub(corner(k), corner(k - 1))
  local l, t = vec.norm(way), vec.unit(way)
  for _, at in ipairs { 0.5 - math.sqrt(1 / 12), 0.5 + math.sqrt(1 / 12) } do
    local M = vec.cross(vec.add(a, vec.scale(at, way)), { 0, 0, -1 })
    local twist = vec.dot(M, t)
    compliance = compliance + l / 2 * (twist ^ 2 / (2 * G * I) + (vec.dot(M, M) - twist ^ 2) / (E * I) + t[3] ^ 2 / (E * A))
  end
end

local sat = vehicle "vehicle.yaml"
mission { duration = "1 ns" }
local force, eye, move = 1e-5, sat:node "eye.axis", {}
for k = 1, n do move[k] = "piece_" .. k .. ".eta" end
local rest = select(3, eye:position())
eye:load { axes = "world" }:set(0, 0, 0, 0, 0, force)
local found = sat:equilibrium { move = move }
initial(found.initial)
check { name = "reached", value = function() return found.reached and 1 or 0 end, equal = { 1, tolerance = 0 } }
-- Of second order: the end rises by 1e-5 of the radius of the coil.
check { name = "compliance", unit = "mm/N", value = function() return 1e3 * (select(3, eye:position()) - rest) / force end, equal = { 1e3 * compliance, tolerance = 1e-5 * 1e3 * compliance } }
