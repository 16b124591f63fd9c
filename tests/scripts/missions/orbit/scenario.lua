-- Transfers flown by the vehicle, elements there and back, relative motion against the motion of two neighbours.
local sat = vehicle "vehicle.yaml"
local mu = 3.986004418e14
local function near(name, value, expected, tolerance)
  local off = type(value) == "number" and math.abs(value - expected) or vec.norm(vec.sub(value, expected))
  assert(off <= tolerance, ("%s: off by %.3g, at most %g"):format(name, off, tolerance))
end

-- Vallado, example 7-5, as printed [km/s].
local r1, r2 = { 15945.34e3, 0, 0 }, { 12214.83899e3, 10249.46731e3, 0 }
local v1, v2 = orbit.lambert(r1, r2, 76 * 60, 3.986004418e14)
near("Vallado v1", vec.scale(1e-3, v1), { 2.05891335371, 2.91596435165, 0 }, 1e-10)
near("Vallado v2", vec.scale(1e-3, v2), { -3.45156484468, 0.91031424811, 0 }, 1e-10)

-- Elements of states and back: ellipses, hyperbolas, circles, orbits in the equator, both ways round, a parabola.
for _, e in ipairs { 0, 1e-9, 0.3, 0.95, 1, 1.4 } do
  for _, inclination in ipairs { 0, 0.9, 2.5, math.pi } do
    for _, anomaly in ipairs { 0, 1.1, 4.9 } do
      local given = { p = 9e6, e = e, inclination = inclination, node = 5.1, periapsis = 2.2, anomaly = anomaly }
      local r, v = orbit.state(given, mu)
      near("speed", vec.dot(v, v), mu * (2 / vec.norm(r) - (1 - e * e) / 9e6), 1e-7)   -- of energy
      near("momentum", vec.norm(vec.cross(r, v)), math.sqrt(mu * 9e6), 1e-3)           -- 6e10
      near("height", r[3], vec.norm(r) * math.sin(inclination) * math.sin(2.2 + anomaly), 1e-8)
      local found = orbit.elements(r, v, mu)
      near("e", found.e, e, 1e-14)
      near("p", found.p, 9e6, 1e-7)
      if e ~= 1 then near("a", found.a * (1 - e * e), 9e6, 1e-6) end
      near("inclination", found.inclination, inclination, 1e-14)
      if inclination == 0.9 and e > 0.1 then
        near("node", found.node, 5.1, 1e-14)
        near("periapsis", found.periapsis, 2.2, 1e-13)
        near("anomaly", found.anomaly, anomaly, 1e-13)
      end
      found.a = nil
      local again, back = orbit.state(found, mu)
      near("r", again, r, 1e-14 * 10 * vec.norm(r))
      near("v", back, v, 1e-14 * 10 * vec.norm(v))
    end
  end
end
local r, v = orbit.state({ a = 7e6, e = 0.01, inclination = 0.5 }, mu)
near("perigee", r, { 6.93e6, 0, 0 }, 1e-8)
assert(v[1] == 0 and v[2] > 0 and v[3] > 0)

-- Transfers at random: what is left of the Kepler problem is checked by elements, which both ends share, and by the flight below.
local place = { { 7e6, 1e6, -2e6 }, { -3e6, 8e6, 4e6 } }
for _, long in ipairs { false, true } do
  for _, time in ipairs { 300, 900, 3000, 20000, 2e6 } do
    local a, b = orbit.lambert(place[1], place[2], time, mu, long)
    local first, last = orbit.elements(place[1], a, mu), orbit.elements(place[2], b, mu)
    for _, key in ipairs { "p", "e", "inclination", "node" } do near(key, last[key] / first[key], 1, 1e-11) end
    local swept = (last.anomaly + last.periapsis - first.anomaly - first.periapsis) % (2 * math.pi)
    assert((swept > math.pi) == long, "the other way round")
  end
end
local flights = { short = { time = 1500 }, long = { time = 7000, long = true }, fast = { time = 400 } }
local start = {}
for name, flight in pairs(flights) do
  local a
  a, flight.arrives = orbit.lambert(place[1], place[2], flight.time, mu, flight.long)
  start[name] = { position = place[1], velocity = a }
end
initial(start)
mission { duration = "7000 s", integrator = { method = "dop853", relative = 1e-13 }, output = { period = "100 s" } }
for name, flight in pairs(flights) do
  local seen = persist { place = math.huge, velocity = math.huge }
  controller { name = name, period = "100 s", step = function(t)
    if t ~= flight.time then return end
    seen.place = vec.norm(vec.sub({ sat:body(name):position() }, place[2]))
    seen.velocity = vec.norm(vec.sub({ sat:body(name):velocity() }, flight.arrives))
  end }
  check { name = name .. " arrives", unit = "m", value = function() return seen.place end, below = 1e-4 }       -- 1e-11 of its way
  check { name = name .. " velocity", unit = "m/s", value = function() return seen.velocity end, below = 1e-7 }
end

-- Hill's equations: A of x' = A x by a small time, and two times one after the other.
local n = 1.1e-3
local function entries(M) local out = {} for i = 1, 6 do for j = 1, 6 do out[#out + 1] = M[i][j] end end return out end
local h = 1e-3
local A = (orbit.hill(n, h) - orbit.hill(n, -h)) * (1 / (2 * h))
local expected = { { 0, 0, 0, 1, 0, 0 }, { 0, 0, 0, 0, 1, 0 }, { 0, 0, 0, 0, 0, 1 }, { 3 * n * n, 0, 0, 0, 2 * n, 0 }, { 0, 0, 0, -2 * n, 0, 0 }, { 0, 0, -n * n, 0, 0, 0 } }
for i, x in ipairs(entries(A)) do near("A " .. i, x, expected[(i - 1) // 6 + 1][(i - 1) % 6 + 1], 1e-12) end
local twice, once = entries(orbit.hill(n, 700) * orbit.hill(n, 2500)), entries(orbit.hill(n, 3200))
for i = 1, 36 do near("both times " .. i, twice[i], once[i], 1e-12 * (1 + math.abs(once[i]))) end

for expected_text, call in pairs {
  ["places that are not opposite"] = function() orbit.lambert({ 7e6, 0, 0 }, { -8e6, 0, 0 }, 900, mu) end,
  ["a time > 0 s, got -3"] = function() orbit.lambert(r1, r2, -3, mu) end,
  ["p of a parabola, got nil"] = function() orbit.state({ e = 1 }, mu) end,
  ["an anomaly that the hyperbola has"] = function() orbit.state({ a = -7e6, e = 1.5, anomaly = 3 }, mu) end,
  ["got semimajor"] = function() orbit.state({ semimajor = 7e6 }, mu) end,
  ["does not pass through the centre"] = function() orbit.elements({ 7e6, 0, 0 }, { 3, 0, 0 }, mu) end,
  ["a rate > 0, got 0"] = function() orbit.hill(0, 3) end,
} do
  local ok, why = pcall(call)
  assert(not ok and why:find(expected_text, 1, true), why)
end
