local vec = require "cardan.vec"
local arguments = require "cardan.arguments"

--- Control moment gyros with one gimbal each: where their momentum points, and gimbal rates for a rate of momentum.
local cmg = {}

---@class CmgOptions
---@field gimbals number[][] a unit vector along each gimbal axis, body axes
---@field spins number[][] a unit vector along each spin axis at the gimbal angle 0, across its gimbal axis
---@field h number|number[] [N m s] momentum of the rotors about their spin axes

---@class CmgSteering
---@field lambda? number 0.01 by default, of the damping lambda exp(-mu det(A A*)); 0: least norm, which ends in an error at a singular place
---@field mu? number 10 by default
---@field epsilon? number 0.01 by default, how far the damping is off the diagonal, so that no direction is left without a torque
---@field omega? number [rad/s] pi/2 by default, by which it turns with time
---@field max_rate? number [rad/s] of a gimbal: beyond it all rates are taken down alike

---@class CmgCluster
---@field momentum fun(angles: number[]): number[] sum of the momenta of the rotors, body axes
---@field jacobian fun(angles: number[]): number[][] its derivative by each gimbal angle: a vector for each gyro
---@field momentum_rate fun(angles: number[], rates: number[]): number[] by these gimbal rates; the torque on the body is minus it
---@field measure fun(angles: number[]): number det(A A*), A = jacobian / largest h: 0 where torques of all gyros lie in one plane
---@field rates fun(momentum_rate: number[], angles: number[], t?: number): number[] gimbal rates for a rate of momentum

--- Axes of four gyros on the sides of a pyramid about z, gimbal axes square to its sides: `gimbals`, `spins`. At the angles 0 their momenta
--- sum to 0.
---@param skew? number [rad] of the sides from the base: 54.7356 deg by default, where the momentum that is had is nearly a sphere
---@return CmgOptions axes without h
function cmg.pyramid(skew)
  arguments.expect(skew == nil or arguments.finite(skew), "cmg.pyramid", "a skew in rad", skew)
  local b = skew or math.atan(math.sqrt(2))
  local s, c = math.sin(b), math.cos(b)
  return {
    gimbals = { { s, 0, c }, { 0, s, c }, { -s, 0, c }, { 0, -s, c } },
    spins = { { 0, 1, 0 }, { -1, 0, 0 }, { 0, -1, 0 }, { 1, 0, 0 } },
  }
end

-- Cofactor of a 3 x 3 matrix.
local function minor(m, i, j)
  local r, c = { i % 3 + 1, (i + 1) % 3 + 1 }, { j % 3 + 1, (j + 1) % 3 + 1 }
  return m[r[1]][c[1]] * m[r[2]][c[2]] - m[r[1]][c[2]] * m[r[2]][c[1]]
end
local function determinant(m) return m[1][1] * minor(m, 1, 1) + m[1][2] * minor(m, 1, 2) + m[1][3] * minor(m, 1, 3) end

--- Momentum of gyros that stand so, and how to steer them. Rates are A* (A A* + lambda E)^-1 h'/h_0: least norm away from singular places, damped near them (singularity-robust inverse: Nakamura,
--- Hanafusa 1986; Bedrossian, Paradiso, Bergmann, Rowell 1990), with E off the diagonal as Wie, Bailey, Heiberg 2001 have it.
---@param options CmgOptions
---@param steering? CmgSteering
---@return CmgCluster cluster
function cmg.cluster(options, steering)
  arguments.expect_keys("cmg.cluster", options, "gimbals spins h")
  local gimbals, spins = options.gimbals or {}, options.spins or {}
  local n = #gimbals
  if n == 0 or #spins ~= n then error("cmg.cluster: expected as many spins as gimbals, at least one", 2) end
  local h, most = {}, 0
  for i = 1, n do
    h[i] = type(options.h) == "table" and options.h[i] or options.h
    if type(h[i]) ~= "number" then error("cmg.cluster: expected h, a number or one for each gyro, got " .. tostring(h[i]), 2) end
    most = math.max(most, math.abs(h[i]))
    local g, s = gimbals[i], spins[i]
    if math.abs(vec.norm(g) - 1) > 1e-9 or math.abs(vec.norm(s) - 1) > 1e-9 or math.abs(vec.dot(g, s)) > 1e-9 then
      error("cmg.cluster: expected unit vectors at right angles for gyro " .. i, 2)
    end
  end
  if not (most > 0) then error("cmg.cluster: no gyro has a momentum", 2) end
  local by = { lambda = 0.01, mu = 10, epsilon = 0.01, omega = math.pi / 2, max_rate = math.huge }
  for key, x in pairs(steering or {}) do
    if not by[key] then error("cmg.cluster: unknown key " .. tostring(key) .. " of the steering", 2) end
    by[key] = x
  end
  local across = {}
  for i = 1, n do across[i] = vec.cross(gimbals[i], spins[i]) end
  local function expect(list, what)
    arguments.expect(arguments.numbers(n, list), "cmg", n .. " " .. what, list, 1)
  end

  local cluster = {}
  cluster.momentum = function(angles)
    expect(angles, "gimbal angles")
    local sum = { 0, 0, 0 }
    for i = 1, n do
      local c, s = h[i] * math.cos(angles[i]), h[i] * math.sin(angles[i])
      for k = 1, 3 do sum[k] = sum[k] + c * spins[i][k] + s * across[i][k] end
    end
    return sum
  end
  cluster.jacobian = function(angles)
    expect(angles, "gimbal angles")
    local J = {}
    for i = 1, n do
      local c, s = h[i] * math.cos(angles[i]), h[i] * math.sin(angles[i])
      J[i] = { c * across[i][1] - s * spins[i][1], c * across[i][2] - s * spins[i][2], c * across[i][3] - s * spins[i][3] }
    end
    return J
  end
  cluster.momentum_rate = function(angles, rates)
    expect(rates, "gimbal rates")
    local sum = { 0, 0, 0 }
    for i, column in ipairs(cluster.jacobian(angles)) do
      for k = 1, 3 do sum[k] = sum[k] + rates[i] * column[k] end
    end
    return sum
  end
  local function gram(J)
    local m = { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 } }
    for _, a in ipairs(J) do
      for i = 1, 3 do
        for j = 1, 3 do m[i][j] = m[i][j] + a[i] * a[j] / (most * most) end
      end
    end
    return m
  end
  cluster.measure = function(angles) return determinant(gram(cluster.jacobian(angles))) end
  cluster.rates = function(momentum_rate, angles, t)
    local J = cluster.jacobian(angles)
    local m = gram(J)
    local lambda = by.lambda * math.exp(-by.mu * determinant(m))
    for i = 1, 3 do
      m[i][i] = m[i][i] + lambda
      local j, k = i % 3 + 1, (i + 1) % 3 + 1
      local off = lambda * by.epsilon * math.sin(by.omega * (t or 0) + (i - 1) * math.pi / 2)
      m[j][k], m[k][j] = m[j][k] + off, m[k][j] + off
    end
    local det = determinant(m)
    if not (det > 1e-14) then error("cmg: the torques of all gyros lie in one plane, and lambda is 0", 2) end
    local y = {}
    for i = 1, 3 do
      y[i] = (minor(m, i, 1) * momentum_rate[1] + minor(m, i, 2) * momentum_rate[2] + minor(m, i, 3) * momentum_rate[3]) / (det * most * most)
    end
    local rates, largest = {}, 0
    for i, column in ipairs(J) do
      rates[i] = vec.dot(column, y)
      largest = math.max(largest, math.abs(rates[i]))
    end
    if largest > by.max_rate then
      for i = 1, n do rates[i] = rates[i] * by.max_rate / largest end
    end
    return rates
  end
  return cluster
end

return cmg
