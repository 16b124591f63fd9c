local arguments = require("cardan.arguments")
local expect_three = arguments.expect_three

--- Sharing a body torque among actuators with fixed axes.
local allocation = {}

--- `axes`: a vector for each actuator, the torque of a command of 1, body axes; not all in one plane. Returns a function that takes a body torque
--- {x, y, z} to the commands of the actuators with the least sum of squares: u = A' (A A')^-1 torque.
---@param axes number[][]
---@return fun(torque: number[]): number[] share
function allocation.least_norm(axes)
  arguments.expect(type(axes) == "table", "allocation.least_norm", "a list of axes", axes)
  local m = { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 } } -- A A'
  for _, a in ipairs(axes) do
    expect_three("allocation.least_norm", a)
    for i = 1, 3 do
      for j = 1, 3 do m[i][j] = m[i][j] + a[i] * a[j] end
    end
  end
  local function minor(i, j)
    local r, c = { i % 3 + 1, (i + 1) % 3 + 1 }, { j % 3 + 1, (j + 1) % 3 + 1 }
    return m[r[1]][c[1]] * m[r[2]][c[2]] - m[r[1]][c[2]] * m[r[2]][c[1]]
  end
  local det = m[1][1] * minor(1, 1) + m[1][2] * minor(1, 2) + m[1][3] * minor(1, 3)
  if not (det > 1e-12 * ((m[1][1] + m[2][2] + m[3][3]) / 3) ^ 3) then error("allocation.least_norm: the axes lie in one plane", 2) end
  local shares = {}
  for k, a in ipairs(axes) do
    shares[k] = {}
    for i = 1, 3 do
      shares[k][i] = (a[1] * minor(1, i) + a[2] * minor(2, i) + a[3] * minor(3, i)) / det
    end
  end
  return function(torque)
    expect_three("allocation.least_norm", torque)
    local u = {}
    for k, s in ipairs(shares) do u[k] = s[1] * torque[1] + s[2] * torque[2] + s[3] * torque[3] end
    return u
  end
end

return allocation
