local arguments = require("cardan.arguments")
local expect, expect_three, expect_quaternion = arguments.expect, arguments.expect_three, arguments.expect_quaternion

--- Quaternions as arrays {w, x, y, z} of length one; nothing here normalises. q turns components in the axes of a body into the world:
--- v_world = quat.rotate(q, v_body).
local quat = {}

local function product(p, q)
  return {
    p[1] * q[1] - p[2] * q[2] - p[3] * q[3] - p[4] * q[4],
    p[1] * q[2] + p[2] * q[1] + p[3] * q[4] - p[4] * q[3],
    p[1] * q[3] - p[2] * q[4] + p[3] * q[1] + p[4] * q[2],
    p[1] * q[4] + p[2] * q[3] - p[3] * q[2] + p[4] * q[1],
  }
end
local function conjugate(q) return { q[1], -q[2], -q[3], -q[4] } end
local function to_rotation_vector(q)
  local s = math.sqrt(q[2] ^ 2 + q[3] ^ 2 + q[4] ^ 2)
  if s < 1e-150 then return { 0.0, 0.0, 0.0 } end
  local sign = q[1] < 0 and -1 or 1 -- q and -q are one rotation: take the shorter way
  local k = sign * 2 * math.atan(s, sign * q[1]) / s
  return { k * q[2], k * q[3], k * q[4] }
end

--- The product p q, and so on: first the last of them, p at the end.
---@param p number[]
---@param q number[]
---@param ... number[] more of them
---@return number[] product
function quat.multiply(p, q, ...)
  expect_quaternion("quat.multiply", p)
  expect_quaternion("quat.multiply", q)
  return select("#", ...) > 0 and quat.multiply(product(p, q), ...) or product(p, q)
end

--- The inverse rotation.
---@param q number[]
---@return number[] conjugate
function quat.conjugate(q)
  expect_quaternion("quat.conjugate", q)
  return conjugate(q)
end

--- A rotation by `angle` [rad] about `axis` (of any length).
---@param axis number[]
---@param angle number [rad]
---@return number[] q
function quat.from_axis_angle(axis, angle)
  expect_three("quat.from_axis_angle", axis)
  expect(type(angle) == "number", "quat.from_axis_angle", "an angle in rad", angle)
  local n = math.sqrt(axis[1] ^ 2 + axis[2] ^ 2 + axis[3] ^ 2)
  if n == 0 then error("quat.from_axis_angle: the zero vector is no axis", 2) end
  local s = math.sin(angle / 2) / n
  return { math.cos(angle / 2), s * axis[1], s * axis[2], s * axis[3] }
end

--- The rotation by a rotation vector: about it, by its length.
---@param vector number[] [rad]
---@return number[] q
function quat.from_rotation_vector(vector)
  expect_three("quat.from_rotation_vector", vector)
  local a = math.sqrt(vector[1] ^ 2 + vector[2] ^ 2 + vector[3] ^ 2)
  local k = a < 1e-8 and 0.5 or math.sin(a / 2) / a
  return { math.cos(a / 2), k * vector[1], k * vector[2], k * vector[3] }
end

--- The rotation vector [rad] (axis times angle, at most pi) of q.
---@param q number[]
---@return number[] vector [rad]
function quat.to_rotation_vector(q)
  expect_quaternion("quat.to_rotation_vector", q)
  return to_rotation_vector(q)
end

--- The rotation vector [rad] that takes q_ref to q, in the axes of the body.
---@param q_ref number[]
---@param q number[]
---@return number[] vector [rad]
function quat.error(q_ref, q)
  expect_quaternion("quat.error", q_ref)
  expect_quaternion("quat.error", q)
  return to_rotation_vector(product(conjugate(q_ref), q))
end

--- The components of v after the rotation q.
---@param q number[]
---@param v number[]
---@return number[] v
function quat.rotate(q, v)
  expect_quaternion("quat.rotate", q)
  expect_three("quat.rotate", v)
  local w, x, y, z = q[1], q[2], q[3], q[4]
  local tx, ty, tz = 2 * (y * v[3] - z * v[2]), 2 * (z * v[1] - x * v[3]), 2 * (x * v[2] - y * v[1])
  return { v[1] + w * tx + y * tz - z * ty, v[2] + w * ty + z * tx - x * tz, v[3] + w * tz + x * ty - y * tx }
end

return quat
