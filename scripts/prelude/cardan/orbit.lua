local arguments = require "cardan.arguments"
local vec = require "cardan.vec"

--- Orbits about one centre: elements, transfers between two places, relative motion. For plans and initial states; the motion itself is the vehicle's.
local orbit = {}

local expect, finite, positive = arguments.expect, arguments.finite, arguments.positive
local function triple(v) return arguments.vector(3, v) end
local function combine(a, x, b, y) return { a * x[1] + b * y[1], a * x[2] + b * y[2], a * x[3] + b * y[3] } end

---@class OrbitElements
---@field a number [m] semi-major axis, negative of a hyperbola; of a parabola infinite
---@field p number [m] semi-latus rectum; a state may be given by p in place of a
---@field e number eccentricity
---@field inclination number [rad] 0 to pi
---@field node number [rad] of the ascending node; 0 in the plane of the equator
---@field periapsis number [rad] its argument, from the node; 0 of a circle
---@field anomaly number [rad] the true one

--- Place and velocity of elements.
---@param elements OrbitElements
---@param mu number [m^3/s^2]
---@return number[] r [m]
---@return number[] v [m/s]
function orbit.state(elements, mu)
  arguments.expect_keys("orbit", elements, "a p e inclination node periapsis anomaly")
  expect(positive(mu), "orbit", "mu > 0", mu)
  local e = elements.e or 0
  expect(finite(e) and e >= 0, "orbit", "e >= 0", e)
  local p = elements.p
  expect(not (p and elements.a), "orbit", "a or p, not both", "both")
  if not p then
    local a = elements.a
    expect(finite(a) and a * (1 - e * e) > 0, "orbit", "a > 0 of an ellipse, a < 0 of a hyperbola, p of a parabola", a)
    p = a * (1 - e * e)
  end
  expect(positive(p), "orbit", "p > 0", p)
  local angle = {}
  for _, key in ipairs { "inclination", "node", "periapsis", "anomaly" } do
    angle[key] = elements[key] or 0
    expect(finite(angle[key]), "orbit", key .. " in rad", angle[key])
  end
  local c, s = math.cos(angle.anomaly), math.sin(angle.anomaly)
  expect(1 + e * c > 0, "orbit", "an anomaly that the hyperbola has", angle.anomaly)
  local cn, sn, ci, si = math.cos(angle.node), math.sin(angle.node), math.cos(angle.inclination), math.sin(angle.inclination)
  local cw, sw = math.cos(angle.periapsis), math.sin(angle.periapsis)
  local P = { cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si } -- towards the periapsis
  local Q = { -cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si }
  local r, k = p / (1 + e * c), math.sqrt(mu / p)
  return combine(r * c, P, r * s, Q), combine(-k * s, P, k * (e + c), Q)
end

--- Elements of a place and a velocity.
---@param r number[] [m]
---@param v number[] [m/s]
---@param mu number [m^3/s^2]
---@return OrbitElements elements
function orbit.elements(r, v, mu)
  expect(triple(r), "orbit", "r as three numbers", r)
  expect(triple(v), "orbit", "v as three numbers", v)
  expect(positive(mu), "orbit", "mu > 0", mu)
  local R, h = vec.norm(r), vec.cross(r, v)
  local H = vec.norm(h)
  expect(R > 0 and H > 0, "orbit", "motion that does not pass through the centre", "momentum of zero")
  local p, radial = H * H / mu, vec.dot(r, v) / R
  local ec, es = p / R - 1, radial * H / mu -- e cos, e sin of the anomaly
  local e = math.sqrt(ec * ec + es * es)
  local tilt = math.sqrt(h[1] ^ 2 + h[2] ^ 2)
  local node = tilt > 1e-12 * H and math.atan(h[1], -h[2]) or 0
  local N = { math.cos(node), math.sin(node), 0 }
  local argument = math.atan(vec.dot(r, vec.cross(h, N)) / H, vec.dot(r, N)) -- of the place, from the node
  local anomaly = e > 1e-12 and math.atan(es, ec) or argument
  local function once(x) return x % (2 * math.pi) end
  local energy = vec.dot(v, v) / 2 - mu / R
  return { a = -mu / (2 * energy), p = p, e = e, inclination = math.atan(tilt, h[3]), node = once(node),
           periapsis = e > 1e-12 and once(argument - anomaly) or 0, anomaly = once(anomaly) }
end

--- (1 - cos s) / s^2 and (s - sin s) / s^3 of s = sqrt(z) [Stumpff 1959].
local function stumpff(z)
  if math.abs(z) < 1 then
    local C, S, c, s = 0, 0, 1 / 2, 1 / 6
    for k = 1, 12 do
      C, S = C + c, S + s
      c, s = -c * z / ((2 * k + 1) * (2 * k + 2)), -s * z / ((2 * k + 2) * (2 * k + 3))
    end
    return C, S
  end
  local s = math.sqrt(math.abs(z))
  if z > 0 then return 2 * (math.sin(s / 2) / s) ^ 2, (s - math.sin(s)) / s ^ 3 end
  local up, down = math.exp(s), math.exp(-s)
  return ((up + down) / 2 - 1) / -z, ((up - down) / 2 - s) / s ^ 3
end

--- The velocities with which one goes from r1 to r2 in `time`, without a whole turn between [Bate, Mueller and White 1971, universal variables].
---@param r1 number[] [m]
---@param r2 number[] [m]
---@param time number [s]
---@param mu number [m^3/s^2]
---@param long? boolean the way of more than half a turn
---@return number[] v1 [m/s]
---@return number[] v2 [m/s]
function orbit.lambert(r1, r2, time, mu, long)
  expect(triple(r1), "orbit", "r1 as three numbers", r1)
  expect(triple(r2), "orbit", "r2 as three numbers", r2)
  expect(positive(time), "orbit", "a time > 0 s", time)
  expect(positive(mu), "orbit", "mu > 0", mu)
  local R1, R2 = vec.norm(r1), vec.norm(r2)
  expect(R1 > 0 and R2 > 0, "orbit", "places apart from the centre", "one at it")
  local sum = vec.norm(vec.add(vec.scale(1 / R1, r1), vec.scale(1 / R2, r2))) -- 2 |cos| of half the angle
  expect(sum > 1e-10, "orbit", "places that are not opposite: every plane has such an orbit", "opposite places")
  local A = (long and -1 or 1) * math.sqrt(R1 * R2 / 2) * sum
  local function flight(z) -- y and the time; nothing where the orbit does not reach r2
    local C, S = stumpff(z)
    local y = R1 + R2 + A * (z * S - 1) / math.sqrt(C)
    if not (y > 0) then return end
    local chi = math.sqrt(y / C)
    return y, (chi ^ 3 * S + A * math.sqrt(y)) / math.sqrt(mu)
  end
  local low, high = -1, 4 * math.pi ^ 2
  while true do -- the time rises with z
    local y, t = flight(low)
    if not y or t < time then break end
    expect(low > -1e5, "orbit", "a time that an orbit takes", time)
    low = 2 * low
  end
  while true do
    local z = (low + high) / 2
    if z <= low or z >= high then break end
    local y, t = flight(z)
    if not y or t < time then low = z else high = z end
  end
  local y = flight(high)
  expect(y, "orbit", "a time that an orbit takes", time)
  local f, g, gdot = 1 - y / R1, A * math.sqrt(y / mu), 1 - y / R2
  return combine(1 / g, r2, -f / g, r1), combine(gdot / g, r2, -1 / g, r1)
end

--- How small deviations from a circular orbit go on: [x, y, z, x', y', z'] after `time` from those now, x outward, y along the orbit, z along its
--- momentum, in axes that turn with it [Clohessy and Wiltshire 1960].
---@param rate number [rad/s] of the orbit
---@param time number [s]
---@return Matrix transition
function orbit.hill(rate, time)
  expect(positive(rate), "orbit", "a rate > 0", rate)
  expect(finite(time), "orbit", "a time in s", time)
  local n, a = rate, rate * time
  local c, s = math.cos(a), math.sin(a)
  local versed = 2 * math.sin(a / 2) ^ 2 -- 1 - cos
  return matrix {
    { 4 - 3 * c, 0, 0, s / n, 2 * versed / n, 0 },
    { 6 * (s - a), 1, 0, -2 * versed / n, (4 * s - 3 * a) / n, 0 },
    { 0, 0, c, 0, 0, s / n },
    { 3 * n * s, 0, 0, c, 2 * s, 0 },
    { -6 * n * versed, 0, 0, -2 * s, 4 * c - 3, 0 },
    { 0, 0, -n * s, 0, 0, c },
  }
end

return orbit
