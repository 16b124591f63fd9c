local arguments = require "cardan.arguments"
local vec = require "cardan.vec"
local quat = require "cardan.quat"

--- Turns from rest to rest about one axis, and shapers that leave modes at rest after them.
local slew = {}

-- s(x) from 0 to 1 over x = 0 ... 1 with its first two derivatives; what those reach at most.
local smooth = {
  versine = { rate = 2, acceleration = 2 * math.pi, at = function(x)
    local a = 2 * math.pi * x
    return x - math.sin(a) / (2 * math.pi), 1 - math.cos(a), 2 * math.pi * math.sin(a)
  end },
  quintic = { rate = 15 / 8, acceleration = 10 / math.sqrt(3), at = function(x)
    return x ^ 3 * (10 + x * (6 * x - 15)), 30 * (x * (1 - x)) ^ 2, 60 * x * (1 - x) * (1 - 2 * x)
  end },
}

--- angle(t), rate, acceleration (where it jumps, that after the jump: what a tick holds) of a turn by `angle` that obeys both limits, and its duration.
local function profile(kind, angle, rate, acceleration)
  if angle == 0 then return function() return 0, 0, 0 end, 0 end
  local form = smooth[kind]
  if form then
    local T = math.max(form.rate * angle / rate, math.sqrt(form.acceleration * angle / acceleration))
    return function(t)
      if t < 0 then return 0, 0, 0 elseif t >= T then return angle, 0, 0 end
      local s, ds, dds = form.at(t / T)
      return angle * s, angle * ds / T, angle * dds / T ^ 2
    end, T
  end
  local top = math.min(rate, math.sqrt(angle * acceleration)) -- trapezoid: full acceleration, coasting, full braking
  local ramp = top / acceleration
  local T = ramp + angle / top
  return function(t)
    if t < 0 then return 0, 0, 0 elseif t >= T then return angle, 0, 0 end
    if t < ramp then return acceleration * t * t / 2, acceleration * t, acceleration end
    if t < T - ramp then return top * (t - ramp / 2), top, 0 end
    return angle - acceleration * (T - t) ^ 2 / 2, acceleration * (T - t), -acceleration
  end, T
end

local expect, expect_keys, finite, positive = arguments.expect, arguments.expect_keys, arguments.finite, arguments.positive

---@class Impulse
---@field time number [s]
---@field share number of all, which are 1 together

local robustness = { zv = 1, zvd = 2, zvdd = 3 }

--- Impulses after which a mode of this frequency is at rest: `zv`, or with the first (`zvd`) and second (`zvdd`) derivative in the frequency zero as
--- well, so that an error in it matters less. Binomials of K = exp(-pi z / sqrt(1 - z^2)), half a damped period apart [Singer and Seering 1990].
---@param kind "zv"|"zvd"|"zvdd"
---@param frequency number [Hz] undamped
---@param damping? number of critical, default 0
---@return Impulse[] impulses
function slew.shaper(kind, frequency, damping)
  local n, z = robustness[kind], damping or 0
  expect(n, "slew", "zv, zvd or zvdd", kind)
  expect(positive(frequency), "slew", "a frequency > 0 Hz", frequency)
  expect(type(z) == "number" and z >= 0 and z < 1, "slew", "a damping from 0 to below 1", z)
  local damped = math.sqrt(1 - z * z)
  local K, apart, binomial, out = math.exp(-math.pi * z / damped), 1 / (2 * frequency * damped), 1, {}
  for k = 0, n do
    out[k + 1] = { time = k * apart, share = binomial * K ^ k / (1 + K) ^ n }
    binomial = binomial * (n - k) / (k + 1)
  end
  return out
end

---@class SlewOptions
---@field from number[] {w, x, y, z} body to world
---@field to number[]
---@field rate number [rad/s] at most
---@field acceleration number [rad/s^2] at most
---@field profile? "trapezoid"|"versine"|"quintic" default trapezoid: the shortest; the others begin and end without a jump of acceleration
---@field shapers? Impulse[][] of slew.shaper(), each for a mode
---@field start? number [s] default 0

--- A turn that slew.plan() made.
---@class SlewPlan
---@field angle number [rad] of the whole turn, at most pi
---@field axis number[] of unit length, body axes
---@field duration number [s] with shapers: until their last impulse has acted
---@field at fun(t: number): number[], number[], number[] attitude, rate [rad/s] and acceleration [rad/s^2] of the body in body axes

--- A turn from one attitude at rest to another about the axis between them, the shorter way; shaped, it still obeys the limits.
---@param options SlewOptions
---@return SlewPlan plan
function slew.plan(options)
  expect_keys("slew", options, "from to rate acceleration profile shapers start")
  for _, key in ipairs { "from", "to" } do
    local q = options[key]
    expect(arguments.vector(4, q), "slew", key .. " as {w, x, y, z}", q)
    local sum = q[1] ^ 2 + q[2] ^ 2 + q[3] ^ 2 + q[4] ^ 2
    expect(math.abs(sum - 1) < 1e-6, "slew", key .. " of length 1", math.sqrt(sum))
  end
  expect(positive(options.rate), "slew", "a rate > 0", options.rate)
  expect(positive(options.acceleration), "slew", "an acceleration > 0", options.acceleration)
  local kind, start = options.profile or "trapezoid", options.start or 0
  expect(kind == "trapezoid" or smooth[kind], "slew", "the profile trapezoid, versine or quintic", kind)
  expect(finite(start), "slew", "a start in s", start)

  local impulses = { { time = 0, share = 1 } }
  expect(type(options.shapers or {}) == "table", "slew", "a list of shapers", options.shapers)
  for key, shaper in pairs(options.shapers or {}) do
    expect(math.type(key) == "integer" and type(shaper) == "table", "slew", "shapers as a list, each by slew.shaper", key)
    local both, sum = {}, 0
    for _, impulse in ipairs(shaper) do
      expect(type(impulse) == "table" and type(impulse.time) == "number" and impulse.time >= 0 and impulse.time < math.huge and type(impulse.share) == "number", "slew",
        "impulses with a time >= 0 and a share", type(impulse) == "table" and impulse.time or impulse)
      sum = sum + impulse.share
    end
    expect(math.abs(sum - 1) < 1e-9, "slew", "shapers as a list, each with shares that are 1 together", sum)
    for _, a in ipairs(impulses) do
      for _, b in ipairs(shaper) do both[#both + 1] = { time = a.time + b.time, share = a.share * b.share } end
    end
    impulses = both
  end
  local last = 0
  for _, impulse in ipairs(impulses) do last = math.max(last, impulse.time) end

  local turn = quat.error(options.from, options.to)
  local angle = vec.norm(turn)
  local axis = angle > 0 and vec.scale(1 / angle, turn) or { 1, 0, 0 }
  local base, T = profile(kind, angle, options.rate, options.acceleration)
  local plan = { angle = angle, axis = axis, duration = angle > 0 and T + last or 0 }
  plan.at = function(t)
    local x, rate, acceleration = 0, 0, 0
    for _, impulse in ipairs(impulses) do
      local a, b, c = base(t - start - impulse.time)
      x, rate, acceleration = x + impulse.share * a, rate + impulse.share * b, acceleration + impulse.share * c
    end
    return quat.multiply(options.from, quat.from_axis_angle(axis, x)), vec.scale(rate, axis), vec.scale(acceleration, axis)
  end
  return plan
end

return slew
