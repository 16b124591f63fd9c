local arguments = require "cardan.arguments"
local vec = require "cardan.vec"
local quat = require "cardan.quat"

--- Attitude from directions, and from gyros with what corrects them.
local estimation = {}

local expect, expect_keys, positive, vector_of = arguments.expect, arguments.expect_keys, arguments.positive, arguments.vector
-- [a x]
local function cross_matrix(a) return { { 0, -a[3], a[2] }, { a[3], 0, -a[1] }, { -a[2], a[1], 0 } } end
local function unit_matrix(s) return matrix { { s, 0, 0 }, { 0, s, 0 }, { 0, 0, s } } end

---@class Sighting
---@field body number[] the direction as measured, body axes, of any length
---@field world number[] where it is known to be, world axes
---@field sigma number [rad] standard deviation about each axis across it

-- The determinant of what is left of a 4 x 4 matrix without row r and column c, with the sign of a cofactor.
local function cofactor(M, r, c)
  local m = {}
  for i = 1, 4 do
    if i ~= r then
      local row = {}
      for j = 1, 4 do if j ~= c then row[#row + 1] = M[i][j] end end
      m[#m + 1] = row
    end
  end
  local det = vec.dot(m[1], vec.cross(m[2], m[3]))
  return (r + c) % 2 == 0 and det or -det
end

--- The attitude that fits two or more directions best, each by its accuracy: least sum of |body - R' world|^2 / sigma^2 (Wahba's problem), by the
--- largest eigenvalue of Davenport's matrix [Shuster and Oh 1981].
---@param sightings Sighting[]
---@return number[] q {w, x, y, z}, body to world, w >= 0
---@return Matrix covariance [rad^2] of the rotation vector of its error, body axes
---@return number misfit the least sum: its mean is 2 n - 3 for n directions
function estimation.wahba(sightings)
  expect(type(sightings) == "table" and #sightings >= 2, "estimation.wahba", "two or more sightings", type(sightings) == "table" and #sightings or type(sightings))
  local B, total, information = { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 } }, 0, unit_matrix(0)
  local seen = {}
  for k, one in ipairs(sightings) do
    for _, side in ipairs { "body", "world" } do
      expect(type(one) == "table" and vector_of(3, one[side]) and vec.norm(one[side]) > 0, "estimation.wahba", "a direction " .. side .. " of sighting " .. k, type(one) == "table" and one[side] or one)
    end
    expect_keys("estimation.wahba", one, "body world sigma")
    expect(positive(one.sigma), "estimation.wahba", "sigma > 0 of sighting " .. k, one.sigma)
    local b, r, weight = vec.unit(one.body), vec.unit(one.world), 1 / one.sigma ^ 2
    seen[k] = { b = b, r = r, weight = weight }
    total = total + weight
    for i = 1, 3 do for j = 1, 3 do B[i][j] = B[i][j] + weight * b[i] * r[j] end end
    local across = matrix(cross_matrix(b))
    information = information + across * across:t() * weight
  end
  local trace = B[1][1] + B[2][2] + B[3][3]
  -- its quaternion, {x, y, z, w}, takes components in the world to the body as a rotation of axes: that of body to world as we have it
  local K = {
    { 2 * B[1][1] - trace, B[1][2] + B[2][1], B[1][3] + B[3][1], B[2][3] - B[3][2] },
    { B[1][2] + B[2][1], 2 * B[2][2] - trace, B[2][3] + B[3][2], B[3][1] - B[1][3] },
    { B[1][3] + B[3][1], B[2][3] + B[3][2], 2 * B[3][3] - trace, B[1][2] - B[2][1] },
    { B[2][3] - B[3][2], B[3][1] - B[1][3], B[1][2] - B[2][1], trace },
  }
  local largest = matrix(K):eigenvalues()[4]
  for i = 1, 4 do
    for j = 1, 4 do K[i][j] = K[i][j] / total end
    K[i][i] = K[i][i] - largest / total
  end
  local best, place = 0, nil -- the adjugate of a symmetric matrix of rank 3 is the square of what it takes to zero
  for i = 1, 4 do
    local on_diagonal = math.abs(cofactor(K, i, i))
    if on_diagonal > best then best, place = on_diagonal, i end
  end
  if best < 1e-12 then error("estimation.wahba: the directions lie on one line, or fit several attitudes alike", 2) end
  local x, y, z, w = cofactor(K, place, 1), cofactor(K, place, 2), cofactor(K, place, 3), cofactor(K, place, 4)
  local n = (w < 0 and -1 or 1) * math.sqrt(x * x + y * y + z * z + w * w)
  local q = { w / n, x / n, y / n, z / n }
  local misfit, back = 0, quat.conjugate(q)
  for _, one in ipairs(seen) do
    local off = vec.sub(one.b, quat.rotate(back, one.r))
    misfit = misfit + one.weight * vec.dot(off, off)
  end
  return q, information:solve(unit_matrix(1)), misfit
end

---@class AttitudeFilterOptions
---@field q number[] {w, x, y, z} to begin with, body to world
---@field sigma number [rad] of it, about each axis
---@field bias? number[] [rad/s] of the gyros, default none
---@field bias_sigma? number [rad/s] of it, default 0
---@field angle_random_walk number [rad/sqrt(s)] white noise of the gyros
---@field rate_random_walk? number [rad/s/sqrt(s)] of their biases, default 0

---@class AttitudeFilter
---@field q number[] body to world
---@field bias number[] [rad/s]
---@field covariance Matrix 6 x 6, of the rotation vector of the error, body axes [rad^2], and of the error of the bias [rad^2/s^2]
---@field propagate fun(self: AttitudeFilter, angle: number[], dt: number) takes what the gyros turned [rad] in dt [s]: angles of an `integrating_imu`, or rate times dt
---@field attitude fun(self: AttitudeFilter, q: number[], sigma: number|number[]): number takes an attitude that was measured, sigma [rad] about each body axis or all; returns its surprise: squared innovation over its covariance, 3 in the mean
---@field direction fun(self: AttitudeFilter, body: number[], world: number[], sigma: number): number takes a direction that was measured, body axes, and where it is known to be; surprise as of `attitude`, 2 in the mean

-- nav.covariance and the estimate by what was measured: z = H x + noise of covariance R, x the errors of attitude and bias.
local function correct(nav, z, H, R)
  local P = nav.covariance
  local across = H * P
  local S = across * H:t() + R
  local gain = S:solve(across):t()
  local x = gain * z
  nav.q = quat.multiply(nav.q, quat.from_rotation_vector { x[1], x[2], x[3] })
  nav.bias = { nav.bias[1] + x[4], nav.bias[2] + x[5], nav.bias[3] + x[6] }
  local rest = gain * H * -1
  for i = 1, 6 do rest:set(i, i, rest(i, i) + 1) end
  P = rest * P * rest:t() + gain * R * gain:t() -- keeps it positive whatever the gain
  nav.covariance = (P + P:t()) * 0.5
  return z:dot(S:solve(z))
end

local function propagate(nav, angle, dt)
  expect(vector_of(3, angle), "estimation.propagate", "an angle {x, y, z} [rad]", angle)
  expect(positive(dt), "estimation.propagate", "dt > 0 s", dt)
  local turned = vec.sub(angle, vec.scale(dt, nav.bias))
  nav.q = quat.multiply(nav.q, quat.from_rotation_vector(turned))
  local a = vec.norm(turned)
  local W = matrix(cross_matrix(turned))
  -- exp(-W) and the integral of it over dt
  local s1, s2, s3 = 1, 0.5, 1 / 6
  if a > 1e-4 then s1, s2, s3 = math.sin(a) / a, (1 - math.cos(a)) / a ^ 2, (a - math.sin(a)) / a ^ 3 end
  local W2 = W * W
  local back = unit_matrix(1) - W * s1 + W2 * s2
  local added = (unit_matrix(1) - W * s2 + W2 * s3) * dt
  local white, walk = nav.angle_random_walk ^ 2, nav.rate_random_walk ^ 2
  local F, Q = {}, {}
  for i = 1, 3 do
    F[i], Q[i], F[i + 3], Q[i + 3] = {}, {}, {}, {}
    for j = 1, 3 do
      local same = i == j and 1 or 0
      F[i][j], F[i][j + 3], F[i + 3][j], F[i + 3][j + 3] = back(i, j), -added(i, j), 0, same
      Q[i][j], Q[i + 3][j + 3] = same * (white * dt + walk * dt ^ 3 / 3), same * walk * dt
      Q[i][j + 3], Q[i + 3][j] = -same * walk * dt ^ 2 / 2, -same * walk * dt ^ 2 / 2
    end
  end
  F = matrix(F)
  nav.covariance = F * nav.covariance * F:t() + matrix(Q)
end

local function attitude(nav, q, sigma)
  expect(vector_of(4, q) and math.abs(q[1] ^ 2 + q[2] ^ 2 + q[3] ^ 2 + q[4] ^ 2 - 1) < 1e-6, "estimation.attitude", "a quaternion of length 1", q)
  local each = type(sigma) == "number" and { sigma, sigma, sigma } or sigma
  expect(vector_of(3, each) and positive(each[1]) and positive(each[2]) and positive(each[3]), "estimation.attitude", "sigma > 0 rad, one or {x, y, z}", sigma)
  local H, R = {}, {}
  for i = 1, 3 do
    H[i], R[i] = { 0, 0, 0, 0, 0, 0 }, { 0, 0, 0 }
    H[i][i], R[i][i] = 1, each[i] ^ 2
  end
  return correct(nav, vector(quat.error(nav.q, q)), matrix(H), matrix(R))
end

local function direction(nav, body, world, sigma)
  for side, d in pairs { body = body, world = world } do
    expect(vector_of(3, d) and vec.norm(d) > 0, "estimation.direction", "a direction " .. side, d)
  end
  expect(positive(sigma), "estimation.direction", "sigma > 0 rad", sigma)
  local b = vec.unit(quat.rotate(quat.conjugate(nav.q), world))
  local least = math.abs(b[1]) < 0.6 and { 1, 0, 0 } or { 0, 1, 0 }
  local e = vec.unit(vec.cross(b, least))
  local f = vec.cross(b, e)
  local seen = vec.unit(body)
  local z, H = {}, {}
  for i, axis in ipairs { e, f } do -- turned by x the body sees b + b x x
    local row = vec.cross(axis, b)
    z[i], H[i] = vec.dot(axis, seen), { row[1], row[2], row[3], 0, 0, 0 }
  end
  return correct(nav, vector(z), matrix(H), matrix { { sigma ^ 2, 0 }, { 0, sigma ^ 2 } })
end

--- A filter for attitude and the biases of gyros: the attitude by what the gyros turn, its error and that of the biases by Kalman's equations, the error
--- a rotation in body axes that is taken into the quaternion at each measurement (multiplicative) [Lefferts, Markley and Shuster 1982; noise of gyros:
--- Farrenkopf 1978]. What it knows is numbers and matrices: `persist` keeps it.
---@param options AttitudeFilterOptions
---@return AttitudeFilter filter
function estimation.attitude_filter(options)
  local o = options
  local who = "estimation.attitude_filter"
  expect(type(o) == "table" and vector_of(4, o.q) and math.abs(o.q[1] ^ 2 + o.q[2] ^ 2 + o.q[3] ^ 2 + o.q[4] ^ 2 - 1) < 1e-6, who, "q of length 1", type(o) == "table" and o.q or o)
  expect_keys(who, o, "q sigma bias bias_sigma angle_random_walk rate_random_walk")
  expect(positive(o.sigma), who, "sigma > 0 rad", o.sigma)
  expect(o.bias == nil or vector_of(3, o.bias), who, "a bias {x, y, z} [rad/s]", o.bias)
  for _, key in ipairs { "bias_sigma", "angle_random_walk", "rate_random_walk" } do
    local x = o[key]
    expect(x == nil and key ~= "angle_random_walk" or x == 0 or positive(x), who, key .. " >= 0", x)
  end
  local P = {}
  for i = 1, 6 do
    P[i] = { 0, 0, 0, 0, 0, 0 }
    P[i][i] = (i <= 3 and o.sigma or o.bias_sigma or 0) ^ 2
  end
  return {
    q = { o.q[1], o.q[2], o.q[3], o.q[4] },
    bias = o.bias and { o.bias[1], o.bias[2], o.bias[3] } or { 0, 0, 0 },
    covariance = matrix(P),
    angle_random_walk = o.angle_random_walk,
    rate_random_walk = o.rate_random_walk or 0,
    propagate = propagate,
    attitude = attitude,
    direction = direction,
  }
end

return estimation
