-- A sheet folded as maps of Miura [Miura 1985] folds itself: all its creases follow one angle u, with corners at (i S, j L + (i mod 2) V, (j mod 2) H)
-- [Schenk & Guest 2013]. Where four plates meet a loop closes the sheet: of the 20 rows of all four 7 count, which leaves one way to move.
local side, cosg, sing, m = 0.5, 0.6, 0.8, 1.2                              -- of plates; of the angle between their sides
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { relative = 1e-10 }, output = { rate = "20 Hz" } }

local function corner(u, i, j)
  local s, q = math.sin(u) * sing, math.sqrt(1 + (math.cos(u) * sing / cosg) ^ 2)
  return { i * side * math.cos(u) * sing / cosg / q, j * side * math.sqrt(1 - s * s) + (i % 2) * side / q, (j % 2) * side * s }
end
local function edge(u, i, j, di, dj) return vec.sub(corner(u, i + di, j + dj), corner(u, i, j)) end
local function normal(u, i, j) return vec.unit(vec.cross(edge(u, i, j, 1, 0), edge(u, i, j, 0, 1))) end
-- From plate (i - di, j - dj) to plate (i, j), about the crease between them.
local function fold(u, i, j, di, dj)
  local a, b = normal(u, i - di, j - dj), normal(u, i, j)
  return math.atan(vec.dot(vec.cross(a, b), vec.unit(edge(u, i, j, dj, di))), vec.dot(a, b))
end

-- Energy at u' = 1, in the axes of the first plate: v + s e + t f is the velocity in a plate, s and t from 0 to 1.
local function place(u, i, j)
  local x, d = vec.unit(edge(u, 0, 0, 1, 0)), corner(u, i, j)
  local z = normal(u, 0, 0)
  return { vec.dot(x, d), vec.dot(vec.cross(z, x), d), vec.dot(z, d) }
end
local h = 1e-3
local function velocity(u, i, j)
  local function apart(k) return vec.sub(place(u + k * h, i, j), place(u - k * h, i, j)) end
  return vec.scale(1 / (60 * h), vec.add(vec.sub(vec.scale(45, apart(1)), vec.scale(9, apart(2))), apart(3)))
end
local function energy(u)
  local sum = 0
  for i = 0, 2 do
    for j = 0, 2 do
      local v = velocity(u, i, j)
      local e, f = vec.sub(velocity(u, i + 1, j), v), vec.sub(velocity(u, i, j + 1), v)
      sum = sum + m / 2 * (vec.dot(v, v) + vec.dot(v, e) + vec.dot(v, f) + (vec.dot(e, e) + vec.dot(f, f)) / 3 + vec.dot(e, f) / 2)
    end
  end
  return sum
end
local from, to, rate, steps = 0.6, 1.1, 0.5, 60
local way = math.sqrt(energy(from)) + math.sqrt(energy(to))                 -- by Simpson's rule
for i = 1, steps - 1 do way = way + (i % 2 == 0 and 2 or 4) * math.sqrt(energy(from + (to - from) * i / steps)) end
local time = way * (to - from) / steps / 3 / (math.sqrt(energy(from)) * rate)

local hinges = {}
for i = 1, 2 do hinges["p" .. i .. "0"] = { i, 0, 1, 0 } end
for i = 0, 2 do
  for j = 1, 2 do hinges["p" .. i .. j] = { i, j, 0, 1 } end
end
local start = {}
for name, at in pairs(hinges) do start[name] = { angle = fold(from, table.unpack(at)) } end
start.p10.rate = rate / (12 * h) * (8 * (fold(from + h, 1, 0, 1, 0) - fold(from - h, 1, 0, 1, 0)) - fold(from + 2 * h, 1, 0, 1, 0) + fold(from - 2 * h, 1, 0, 1, 0))
initial(start)
local off = persist { t = 0, angle = 0 }
event {
  name = "folded", direction = "falling", when = function() return sat:hinge "p10":angle() - fold(to, 1, 0, 1, 0) end,
  action = function()
    off.t = mission.time() - time
    for name, at in pairs(hinges) do off.angle = math.max(off.angle, math.abs(sat:hinge(name):angle() - fold(to, table.unpack(at)))) end
    stop()
  end,
}
check { name = "ways to move", unit = "1", value = function() return sat:closed_system():mobility() end, equal = { 1, tolerance = 0 } }
check { name = "folded at", unit = "s", value = function() return off.t end, equal = { 0, tolerance = 1e-8 } }
check { name = "creases", unit = "rad", value = function() return off.angle end, below = 1e-8 }
