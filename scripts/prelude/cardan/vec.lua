local expect_three = require("cardan.arguments").expect_three

--- Vectors as arrays of three numbers. Every function returns a new array.
local vec = {}

--- a + b, and so on.
---@param a number[]
---@param b number[]
---@param ... number[] more of them
---@return number[] sum
function vec.add(a, b, ...)
  expect_three("vec.add", a)
  expect_three("vec.add", b)
  local sum = { a[1] + b[1], a[2] + b[2], a[3] + b[3] }
  return select("#", ...) > 0 and vec.add(sum, ...) or sum
end

--- a - b.
---@param a number[]
---@param b number[]
---@return number[] difference
function vec.sub(a, b)
  expect_three("vec.sub", a)
  expect_three("vec.sub", b)
  return { a[1] - b[1], a[2] - b[2], a[3] - b[3] }
end

--- s a; the two may come in either order.
---@param s number
---@param a number[]
---@return number[] product
function vec.scale(s, a)
  if type(a) == "number" then s, a = a, s end
  if type(s) ~= "number" or type(a) == "number" or not a then
    error("vec.scale: expected a number and an array of three numbers, got " .. type(s) .. " and " .. type(a), 2)
  end
  expect_three("vec.scale", a)
  return { s * a[1], s * a[2], s * a[3] }
end

---@param a number[]
---@param b number[]
---@return number product
function vec.dot(a, b)
  expect_three("vec.dot", a)
  expect_three("vec.dot", b)
  return a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
end

--- a x b.
---@param a number[]
---@param b number[]
---@return number[] product
function vec.cross(a, b)
  expect_three("vec.cross", a)
  expect_three("vec.cross", b)
  return { a[2] * b[3] - a[3] * b[2], a[3] * b[1] - a[1] * b[3], a[1] * b[2] - a[2] * b[1] }
end

--- Its length.
---@param a number[]
---@return number length
function vec.norm(a)
  expect_three("vec.norm", a)
  return math.sqrt(a[1] * a[1] + a[2] * a[2] + a[3] * a[3])
end

--- The vector of length one along a.
---@param a number[]
---@return number[] unit
function vec.unit(a)
  expect_three("vec.unit", a)
  local n = vec.norm(a)
  if n == 0 then error("vec.unit: the zero vector has no direction", 2) end
  return vec.scale(1 / n, a)
end

return vec
