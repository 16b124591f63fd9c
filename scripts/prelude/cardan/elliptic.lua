--- Elliptic integral and functions, in which pendulums, tops and tumbling bodies have their closed forms. The parameter is m = k^2.
local elliptic = {}

--- Means (a_n), (c_n) of the arithmetic-geometric mean of 1 and sqrt(m1) [Abramowitz, Stegun 1964, 17.6].
local function means(m, m1)
  for _, x in ipairs { m or "nothing", m1 } do
    if type(x) ~= "number" then error("elliptic: expected a number, got " .. tostring(x), 3) end
  end
  m1 = m1 or 1 - m
  if not (m >= 0 and m1 > 0) then error("elliptic: expected a parameter 0 <= m < 1, got " .. tostring(m), 3) end
  if math.abs(m + m1 - 1) > 1e-8 then error("elliptic: expected m1 = 1 - m, got " .. tostring(m1) .. " beside m = " .. tostring(m), 3) end
  local a, c, b = { 1 }, { math.sqrt(m) }, math.sqrt(m1)
  while c[#c] > 1e-15 * a[#a] and #a < 40 do
    local mean = 0.5 * (a[#a] + b)
    c[#c + 1] = 0.5 * (a[#a] - b)
    b = math.sqrt(a[#a] * b)
    a[#a + 1] = mean
  end
  return a, c
end

--- The complete integral of the first kind: a quarter of the period of sn and cn.
---@param m number parameter k^2, 0 to 1
---@param m1 number? 1 - m, where m is so near to 1 that the difference loses digits
---@return number K
function elliptic.K(m, m1)
  local a = means(m, m1)
  return 0.5 * math.pi / a[#a]
end

--- Jacobi's functions of argument u.
---@param u number
---@param m number parameter k^2, 0 to 1
---@param m1 number? 1 - m, where m is so near to 1 that the difference loses digits
---@return number sn
---@return number cn
---@return number dn
---@return number am amplitude [rad]: sn = sin am
function elliptic.jacobi(u, m, m1)
  if type(u) ~= "number" then error("elliptic: expected a number, got " .. tostring(u), 2) end
  local a, c = means(m, m1)
  local am = 2 ^ (#a - 1) * a[#a] * u -- descending Landen steps [Abramowitz, Stegun 1964, 16.4]
  for n = #a, 2, -1 do am = 0.5 * (am + math.asin(c[n] / a[n] * math.sin(am))) end
  local sn, cn = math.sin(am), math.cos(am)
  return sn, cn, math.sqrt((m1 or 1 - m) + m * cn * cn), am
end

return elliptic
