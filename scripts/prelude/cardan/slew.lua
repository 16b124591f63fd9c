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

-- What impulses leave of a mode of w rad/s, as the parts of sum A exp((z + i sqrt(1 - z^2)) w t): cosine, sine and their derivatives in w.
local function left(A, t, z, w)
  local q, C, S, dC, dS = math.sqrt(1 - z * z), 0, 0, 0, 0
  for i = 1, #A do
    local g, c, s = A[i] * math.exp(z * w * t[i]), math.cos(q * w * t[i]), math.sin(q * w * t[i])
    C, S, dC, dS = C + g * c, S + g * s, dC + g * t[i] * (z * c - q * s), dS + g * t[i] * (z * s + q * c)
  end
  return C, S, dC, dS
end

-- Three impulses about a mode of 1 rad/s that leave V of its vibration there, no more at a frequency near it, and nothing at two, one on either side.
local function extra_insensitive(z, V)
  local aside = math.acos((1 - V) / (1 + V)) / math.pi
  local x = { (1 + V) / 4, (1 + V) / 4, math.pi, 2 * math.pi, 1 - aside, 1 + aside } -- shares, times, frequencies: undamped
  local function wrong(damping)
    local A, t = { x[1], 1 - x[1] - x[2], x[2] }, { 0, x[3], x[4] }
    local C1, S1 = left(A, t, damping, x[5])
    local C2, S2 = left(A, t, damping, x[6])
    local C, S, dC, dS = left(A, t, damping, 1)
    local square, by_then = C * C + S * S, math.exp(-2 * damping * x[4])
    return { C1, S1, C2, S2, by_then * square - V * V, 2 * by_then * (C * dC + S * dS - damping * x[4] * square) }
  end
  local steps = math.ceil(z / 0.02) -- Newton's method, from one damping to the next
  for k = 1, steps do
    local damping, far = z * k / steps, math.huge
    for _ = 1, 20 do
      local J, before = { {}, {}, {}, {}, {}, {} }, wrong(damping)
      for j = 1, 6 do
        local h = 1e-6
        x[j] = x[j] + h
        local after = wrong(damping)
        x[j] = x[j] - 2 * h
        local other = wrong(damping)
        x[j] = x[j] + h
        for i = 1, 6 do J[i][j] = (after[i] - other[i]) / (2 * h) end
      end
      local move = matrix(J):solve(vector(before))
      for j = 1, 6 do x[j] = x[j] - move[j] end
      far = move:max_abs()
      if far < 1e-12 then break end
    end
    assert(far < 1e-9, "slew: no shaper found for this damping")
  end
  return { { time = 0, share = x[1] }, { time = x[3], share = 1 - x[1] - x[2] }, { time = x[4], share = x[2] } }
end

--- Impulses after which a mode of this frequency is at rest: `zv`, or with the first (`zvd`) and second (`zvdd`) derivative in the frequency zero as
--- well, so that an error in it matters less. Binomials of K = exp(-pi z / sqrt(1 - z^2)), half a damped period apart [Singer and Seering 1990].
--- `ei`, extra-insensitive, is as long as `zvd` and forgives more: it leaves `remains` of the vibration at this frequency, nothing at two about it and no more than that between
--- and some way beyond. Undamped in closed form [Singhose, Seering and Singer 1990]; with damping the same conditions, solved, near the coefficients of [Singhose, Seering and Singer 1994].
---@param kind "zv"|"zvd"|"zvdd"|"ei"
---@param frequency number [Hz] undamped
---@param damping? number of critical, default 0; of `ei` at most 0.3
---@param remains? number of `ei`, default 0.05, at most 0.15
---@return Impulse[] impulses
function slew.shaper(kind, frequency, damping, remains)
  local n, z = robustness[kind], damping or 0
  expect(n or kind == "ei", "slew", "zv, zvd, zvdd or ei", kind)
  expect(positive(frequency), "slew", "a frequency > 0 Hz", frequency)
  expect(type(z) == "number" and z >= 0 and z < 1, "slew", "a damping from 0 to below 1", z)
  expect(kind == "ei" or remains == nil, "slew", "what remains, of ei alone", remains)
  if kind == "ei" then
    local V = remains or 0.05
    expect(z <= 0.3, "slew", "a damping of ei from 0 to 0.3", z)
    expect(type(V) == "number" and V >= 0.001 and V <= 0.15, "slew", "what remains of the vibration, from 0.001 to 0.15", V)
    local out = extra_insensitive(z, V)
    for _, impulse in ipairs(out) do impulse.time = impulse.time / (2 * math.pi * frequency) end
    return out
  end
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
