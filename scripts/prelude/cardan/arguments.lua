-- What functions of the other modules ask of what they are given. No module for scripts: nothing of it is global.

local function finite(x) return type(x) == "number" and x == x and math.abs(x) < math.huge end
local function positive(x) return finite(x) and x > 0 end

-- n finite numbers.
local function vector(n, x)
  if type(x) ~= "table" or #x ~= n then return false end
  for i = 1, n do if not finite(x[i]) then return false end end
  return true
end

local function length(x) return #x end

-- n numbers, in a table or a vector: of a quaternion three of its four would be taken. NaN is no fault here, a controller may go on with it.
local function numbers(n, x)
  if type(x) ~= "table" and not (type(x) == "userdata" and pcall(length, x)) or #x ~= n then return false end
  for i = 1, n do if type(x[i]) ~= "number" then return false end end
  return true
end

-- {1, 2} as such, anything else as Lua tells it.
local function told(x)
  if type(x) ~= "table" or #x == 0 or #x > 6 then return tostring(x) end
  local all = {}
  for i = 1, #x do all[i] = tostring(x[i]) end
  return "{" .. table.concat(all, ", ") .. "}"
end

-- Unless it is good, an error at the place in the script that called `who`. `deeper`: calls between the function `who` and this one.
local function expect(good, who, what, got, deeper)
  if not good then error(who .. ": expected " .. what .. ", got " .. told(got), 3 + (deeper or 0)) end
end

-- Several values are no list: vec.norm(bus:rate()) is handed the first of them.
local function expect_numbers(n, who, what, x)
  if numbers(n, x) then return end
  error(who .. ": expected " .. what .. ", got " .. told(x) .. (type(x) == "number" and "; several values need braces: { bus:rate() }" or ""), 4)
end
local function expect_three(who, x) expect_numbers(3, who, "three numbers", x) end
local function expect_quaternion(who, x) expect_numbers(4, who, "four numbers w, x, y, z", x) end

-- `known`: names with a space between.
local function expect_keys(who, options, known)
  expect(type(options) == "table", who, "a table with the keys " .. known:gsub(" ", ", "), options, 1)
  for key in pairs(options) do
    expect((" " .. known .. " "):find(" " .. tostring(key) .. " ", 1, true), who, "one of the keys " .. known:gsub(" ", ", "), key, 1)
  end
end

return {
  finite = finite, positive = positive, vector = vector, numbers = numbers,
  expect = expect, expect_keys = expect_keys, expect_three = expect_three, expect_quaternion = expect_quaternion,
}
