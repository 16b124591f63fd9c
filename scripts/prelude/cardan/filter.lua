local arguments = require "cardan.arguments"
local expect, finite, positive = arguments.expect, arguments.finite, arguments.positive

--- Filters for controllers, at ticks: sections of second order, and chains of them.
local filter = {}

local function expect_band(who, frequency, rate)
  expect(positive(rate), who, "a rate > 0 Hz", rate, 1)
  expect(positive(frequency) and frequency < rate / 2, who, "a frequency from above 0 to below half the rate, " .. rate / 2 .. " Hz", frequency, 1)
end

---@class Section
---@field sections number[][] of each b0, b1, b2, a1, a2 of (b0 + b1 / z + b2 / z^2) / (1 + a1 / z + a2 / z^2)
---@field memory number[][] of each two numbers
---@field rate number [Hz]
---@field step fun(self: Section, x: number): number takes the sample of this tick, returns what is let through
---@field rest fun(self: Section, x: number) as if x had been the input for ever
---@field response fun(self: Section, frequency: number): number, number its gain and phase [rad], from -pi to pi

local function step(self, x)
  for k, s in ipairs(self.sections) do
    local m = self.memory[k]
    local y = s[1] * x + m[1]
    m[1], m[2] = s[2] * x - s[4] * y + m[2], s[3] * x - s[5] * y
    x = y
  end
  return x
end

local function rest(self, x)
  for k, s in ipairs(self.sections) do
    local below = 1 + s[4] + s[5]
    if below == 0 then error("filter: a section that integrates has no rest", 2) end
    local y = x * (s[1] + s[2] + s[3]) / below
    self.memory[k][2] = s[3] * x - s[5] * y
    self.memory[k][1] = y - s[1] * x
    x = y
  end
end

local function response(self, frequency)
  local turn = 2 * math.pi * frequency / self.rate
  local c1, s1, c2, s2 = math.cos(turn), math.sin(turn), math.cos(2 * turn), math.sin(2 * turn)
  local re, im = 1, 0
  for _, s in ipairs(self.sections) do
    local nr, ni = s[1] + s[2] * c1 + s[3] * c2, -s[2] * s1 - s[3] * s2
    local dr, di = 1 + s[4] * c1 + s[5] * c2, -s[4] * s1 - s[5] * s2
    local n = dr * dr + di * di
    local fr, fi = (nr * dr + ni * di) / n, (ni * dr - nr * di) / n
    re, im = re * fr - im * fi, re * fi + im * fr
  end
  return math.sqrt(re * re + im * im), math.atan(im, re)
end

local function of_sections(sections, rate)
  local memory = {}
  for k = 1, #sections do memory[k] = { 0, 0 } end
  return { sections = sections, memory = memory, rate = rate, step = step, rest = rest, response = response }
end

--- (n2 s^2 + n1 s + n0) / (d2 s^2 + d1 s + d0) at ticks, by the trapezoidal rule, whose frequencies are bent so that the response is right at one of
--- them (bilinear with prewarping) [Tustin 1947].
---@param above number[] n2, n1, n0
---@param below number[] d2, d1, d0, stable: none of another sign than d0, and d1 not zero
---@param rate number [Hz] of the ticks
---@param exact_at number [Hz] below half the rate
---@return Section filter begins as if its input had been zero for ever
function filter.section(above, below, rate, exact_at)
  for name, list in pairs { above = above, below = below } do
    expect(type(list) == "table" and #list == 3, "filter.section", "three coefficients " .. name .. ", of s^2 first", type(list) == "table" and #list or type(list))
    for i = 1, 3 do expect(finite(list[i]), "filter.section", "finite coefficients " .. name, list[i]) end
  end
  expect_band("filter.section", exact_at, rate)
  local sign = below[3] < 0 and -1 or 1
  expect(below[3] ~= 0 and sign * below[2] > 0 and sign * below[1] >= 0, "filter.section", "coefficients below of one sign", table.concat(below, ", "))
  expect(below[1] ~= 0 or above[1] == 0, "filter.section", "no higher power of s above than below", "n2 = " .. above[1] .. ", d2 = 0")
  local w = 2 * math.pi * exact_at
  local c = w / math.tan(w / (2 * rate)) -- s = c (z - 1) / (z + 1)
  local function in_z(p)
    if below[1] == 0 then return p[2] * c + p[3], p[3] - p[2] * c, 0 end -- of first order: nothing to be cancelled at half the rate
    return p[1] * c * c + p[2] * c + p[3], 2 * (p[3] - p[1] * c * c), p[1] * c * c - p[2] * c + p[3]
  end
  local b0, b1, b2 = in_z(above)
  local a0, a1, a2 = in_z(below)
  return of_sections({ { b0 / a0, b1 / a0, b2 / a0, a1 / a0, a2 / a0 } }, rate)
end

--- Second order, 1 at zero frequency: w^2 / (s^2 + 2 z w s + w^2).
---@param frequency number [Hz] w
---@param rate number [Hz] of the ticks
---@param damping? number z, default sqrt(1/2): flat, 3 dB down at the frequency
---@return Section filter
function filter.low_pass(frequency, rate, damping)
  expect_band("filter.low_pass", frequency, rate)
  damping = damping or math.sqrt(0.5)
  expect(positive(damping), "filter.low_pass", "a damping > 0", damping)
  local w = 2 * math.pi * frequency
  return filter.section({ 0, 0, w * w }, { 1, 2 * damping * w, w * w }, rate, frequency)
end

--- First order: w / (s + w).
---@param frequency number [Hz] w
---@param rate number [Hz] of the ticks
---@return Section filter
function filter.lag(frequency, rate)
  expect_band("filter.lag", frequency, rate)
  local w = 2 * math.pi * frequency
  return filter.section({ 0, 0, w }, { 0, 1, w }, rate, frequency)
end

--- (1 + s / zero) / (1 + s / pole), 1 at zero frequency: with zero below pole it advances the phase, most at the frequency between them, sqrt(zero pole),
--- where it is exact.
---@param zero number [Hz]
---@param pole number [Hz]
---@param rate number [Hz] of the ticks
---@return Section filter
function filter.lead(zero, pole, rate)
  expect(positive(zero), "filter.lead", "a zero > 0 Hz", zero)
  expect(positive(pole), "filter.lead", "a pole > 0 Hz", pole)
  local between = math.sqrt(zero * pole)
  expect_band("filter.lead", between, rate)
  return filter.section({ 0, 1 / (2 * math.pi * zero), 1 }, { 0, 1 / (2 * math.pi * pole), 1 }, rate, between)
end

--- (s^2 + depth 2 z w s + w^2) / (s^2 + 2 z w s + w^2): 1 far away, `depth` at the frequency, sqrt((1 + depth^2) / 2) at the two that lie width apart about it.
---@param frequency number [Hz] w, of a mode
---@param rate number [Hz] of the ticks
---@param width? number of the frequency, 2 z, default 0.5
---@param depth? number the gain there, default 0; above 1 it amplifies
---@return Section filter
function filter.notch(frequency, rate, width, depth)
  expect_band("filter.notch", frequency, rate)
  width, depth = width or 0.5, depth or 0
  expect(positive(width), "filter.notch", "a width > 0", width)
  expect(depth == 0 or positive(depth), "filter.notch", "a depth >= 0", depth)
  local w = 2 * math.pi * frequency
  return filter.section({ 1, depth * width * w, w * w }, { 1, width * w, w * w }, rate, frequency)
end

--- All of them one after the other; each keeps its own memory, the chain has another.
---@param ... Section of one rate
---@return Section filter
function filter.chain(...)
  local sections, rate = {}, nil
  for k, one in ipairs { ... } do
    expect(type(one) == "table" and type(one.sections) == "table", "filter.chain", "filters", type(one))
    expect(rate == nil or one.rate == rate, "filter.chain", "filters of one rate, " .. tostring(rate) .. " Hz", one.rate)
    rate = one.rate
    for _, s in ipairs(one.sections) do sections[#sections + 1] = s end
  end
  expect(#sections > 0, "filter.chain", "one filter or more", "none")
  return of_sections(sections, rate)
end

return filter
