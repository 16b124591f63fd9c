local arguments = require "cardan.arguments"
local vec = require "cardan.vec"
local quat = require "cardan.quat"

--- Attitudes to point at, body to world.
local pointing = {}

-- Of axes at right angles, the columns of a rotation matrix; divided by the largest of the four components [Shepperd 1978].
local function of_axes(x, y, z)
  local trace = x[1] + y[2] + z[3]
  local q
  if trace >= math.max(x[1], y[2], z[3]) then
    q = { 1 + trace, y[3] - z[2], z[1] - x[3], x[2] - y[1] }
  elseif x[1] >= math.max(y[2], z[3]) then
    q = { y[3] - z[2], 1 + 2 * x[1] - trace, y[1] + x[2], z[1] + x[3] }
  elseif y[2] >= z[3] then
    q = { z[1] - x[3], y[1] + x[2], 1 + 2 * y[2] - trace, z[2] + y[3] }
  else
    q = { x[2] - y[1], z[1] + x[3], z[2] + y[3], 1 + 2 * z[3] - trace }
  end
  local n = math.sqrt(q[1] ^ 2 + q[2] ^ 2 + q[3] ^ 2 + q[4] ^ 2)
  local sign = q[1] < 0 and -1 or 1
  for i = 1, 4 do q[i] = sign * q[i] / n end
  return q
end

-- Unit vectors along a, across a and b, and across both; a and b are called so.
local function triad(who, a_called, a, b_called, b)
  arguments.expect(arguments.vector(3, a), who, a_called .. " as three numbers", a, 1)
  arguments.expect(arguments.vector(3, b), who, b_called .. " as three numbers", b, 1)
  local across = vec.cross(a, b)
  if not (vec.norm(across) > 1e-12 * vec.norm(a) * vec.norm(b)) then
    error(who .. ": expected two directions, got (" .. table.concat(a, ", ") .. ") and (" .. table.concat(b, ", ") .. "), which lie on one line", 3)
  end
  local x, y = vec.unit(a), vec.unit(across)
  return x, y, vec.cross(x, y)
end

--- The attitude in which `axis` of the body lies along `along` in the world and `second` as near to `second_along` as it then can: a boresight at its
--- target, a panel towards the Sun. With directions that were measured it is the estimate by two of them, of which the first is trusted
--- (TRIAD) [Black 1964].
---@param axis number[] body axes, of any length, as all
---@param along number[] world axes
---@param second number[] body axes, not along the first
---@param second_along number[] world axes, not along the first
---@return number[] q {w, x, y, z}, w >= 0
function pointing.align(axis, along, second, second_along)
  local x, y, z = triad("pointing.align", "axis", axis, "second", second)
  local u, v, w = triad("pointing.align", "along", along, "second_along", second_along)
  return quat.multiply(of_axes(u, v, w), quat.conjugate(of_axes(x, y, z)))
end

-- How the axes of an orbit turn where force is central, in their own: r x v / r^2 about its normal.
local function turn(r, v) return vec.norm(vec.cross(r, v)) / vec.dot(r, r) end

--- The axes of Hill at a place on an orbit: x outward, z along r x v, y ahead. Their rate is that of an orbit about one centre: an error of the axes where other forces act across it.
---@param r number[] [m] from the centre
---@param v number[] [m/s]
---@return number[] q
---@return number[] rate [rad/s] in the axes themselves
function pointing.hill(r, v)
  local x, z, back = triad("pointing.hill", "r", r, "v", v)
  return of_axes(x, vec.scale(-1, back), z), { 0, 0, turn(r, v) }
end

--- The axes that look down: z to the centre, y against r x v, x ahead. Rate as of `hill`.
---@param r number[] [m] from the centre
---@param v number[] [m/s]
---@return number[] q
---@return number[] rate [rad/s] in the axes themselves
function pointing.nadir(r, v)
  local up, normal, back = triad("pointing.nadir", "r", r, "v", v)
  return of_axes(vec.scale(-1, back), vec.scale(-1, normal), vec.scale(-1, up)), { 0, -turn(r, v), 0 }
end

return pointing
