-- Filters at ticks against what they stand for: the response in s where it is meant to be exact, what sines become, what is at rest stays there.
vehicle "../phases/vehicle.yaml"
mission { duration = "10 ms" }
local function near(name, value, expected, tolerance)
  local off = math.abs(value - expected)
  assert(off <= tolerance, ("%s: %.17g, expected %.17g"):format(name, value, expected))
end
local rate = 50
-- {filter, where it is exact [Hz], coefficients of s^2, s, 1 above and below}
local function hz(f) return 2 * math.pi * f end
local cases = {
  low_pass = { filter.low_pass(8, rate), 8, { 0, 0, hz(8) ^ 2 }, { 1, math.sqrt(2) * hz(8), hz(8) ^ 2 } },
  damped = { filter.low_pass(20, rate, 0.3), 20, { 0, 0, hz(20) ^ 2 }, { 1, 0.6 * hz(20), hz(20) ^ 2 } },
  lag = { filter.lag(3, rate), 3, { 0, 0, hz(3) }, { 0, 1, hz(3) } },
  lead = { filter.lead(1, 9, rate), 3, { 0, 1 / hz(1), 1 }, { 0, 1 / hz(9), 1 } },
  notch = { filter.notch(7, rate, 0.4, 0.1), 7, { 1, 0.04 * hz(7), hz(7) ^ 2 }, { 1, 0.4 * hz(7), hz(7) ^ 2 } },
  section = { filter.section({ 2, -3, 50 }, { 1, 4, 90 }, rate, 11), 11, { 2, -3, 50 }, { 1, 4, 90 } },
}
local function in_s(above, below, f)
  local w = hz(f)
  local nr, ni, dr, di = above[3] - above[1] * w * w, above[2] * w, below[3] - below[1] * w * w, below[2] * w
  return math.sqrt((nr * nr + ni * ni) / (dr * dr + di * di)), math.atan(ni, nr) - math.atan(di, dr)
end
local function turned(a) return (a + math.pi) % (2 * math.pi) - math.pi end
for name, case in pairs(cases) do
  local one, exact, above, below = table.unpack(case)
  local gain, phase = one:response(exact)
  local wanted, angle = in_s(above, below, exact)
  near(name .. " gain", gain, wanted, 1e-13)
  near(name .. " phase", turned(phase - angle), 0, 1e-13)
  near(name .. " slow", (one:response(0)), above[3] / below[3], 1e-13)
  local f = 5.3 -- a sine of 1 becomes one of the gain, late by the phase
  gain, phase = one:response(f)
  for k = 0, 2000 do
    local y = one:step(math.sin(hz(f) * k / rate))
    if k > 1900 then near(name .. " sine", y, gain * math.sin(hz(f) * k / rate + phase), 1e-11) end -- its argument is rounded at 1e-13
  end
  one:rest(2.5)
  for _ = 1, 5 do near(name .. " rest", one:step(2.5), 2.5 * above[3] / below[3], 1e-13) end
end
near("flat to 3 dB", (filter.low_pass(8, rate):response(8)), math.sqrt(0.5), 1e-14)
near("nothing is left", (filter.notch(7, rate):response(7)), 0, 1e-14)
local _, ahead = filter.lead(1, 9, rate):response(3)
near("lead", ahead, math.asin((9 - 1) / (9 + 1)), 1e-13)
local w, width, depth = 7, 0.4, 0.1 -- of the notch in s: the two places width apart
for _, side in ipairs { -1, 1 } do
  local f = w * (math.sqrt(1 + width ^ 2 / 4) + side * width / 2)
  near("width", (in_s(cases.notch[3], cases.notch[4], f)), math.sqrt((1 + depth ^ 2) / 2), 1e-13)
end
local both = filter.chain(cases.notch[1], cases.lag[1])
local g1, p1 = cases.notch[1]:response(4)
local g2, p2 = cases.lag[1]:response(4)
local g, p = both:response(4)
near("chain gain", g, g1 * g2, 1e-14)
near("chain phase", p, turned(p1 + p2), 1e-14)
both:rest(3)
near("chain rest", both:step(3), 3, 1e-14)

for expected, call in pairs {
  ["a frequency from above 0 to below half the rate, 25.0 Hz, got 25"] = function() filter.low_pass(25, rate) end,
  ["a rate > 0 Hz, got nil"] = function() filter.lag(1) end,
  ["a damping > 0, got 0"] = function() filter.low_pass(1, rate, 0) end,
  ["a width > 0, got -1"] = function() filter.notch(1, rate, -1) end,
  ["coefficients below of one sign, got 1, -4, 90"] = function() filter.section({ 0, 0, 1 }, { 1, -4, 90 }, rate, 5) end,
  ["no higher power of s above than below, got n2 = 1, d2 = 0"] = function() filter.section({ 1, 0, 1 }, { 0, 4, 90 }, rate, 5) end,
  ["three coefficients above, of s^2 first, got 2"] = function() filter.section({ 0, 1 }, { 1, 4, 90 }, rate, 5) end,
  ["filters of one rate, 50 Hz, got 10"] = function() filter.chain(filter.lag(1, 50), filter.lag(1, 10)) end,
  ["one filter or more, got none"] = function() filter.chain() end,
} do
  local ok, why = pcall(call)
  assert(not ok and why:find(expected, 1, true), why)
end
check { name = "reached", value = function() return 1 end, equal = { 1, tolerance = 0 } }
