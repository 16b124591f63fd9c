--- Vectors as arrays of three numbers. Every function returns a new array.
local vec = {}

function vec.add(a, b) return { a[1] + b[1], a[2] + b[2], a[3] + b[3] } end

function vec.sub(a, b) return { a[1] - b[1], a[2] - b[2], a[3] - b[3] } end

function vec.scale(s, a) return { s * a[1], s * a[2], s * a[3] } end

function vec.dot(a, b) return a[1] * b[1] + a[2] * b[2] + a[3] * b[3] end

function vec.cross(a, b)
  return { a[2] * b[3] - a[3] * b[2], a[3] * b[1] - a[1] * b[3], a[1] * b[2] - a[2] * b[1] }
end

function vec.norm(a) return math.sqrt(vec.dot(a, a)) end

--- The vector of length one along a.
function vec.unit(a)
  local n = vec.norm(a)
  if n == 0 then error("vec.unit: the zero vector has no direction", 2) end
  return vec.scale(1 / n, a)
end

return vec
