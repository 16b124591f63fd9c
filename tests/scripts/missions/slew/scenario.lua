-- Turns within limits, shapers by what makes them, and the same torque for the rigid bus plain and shaped: what is left in the boom.
local sat = vehicle "vehicle.yaml"
local plain, shaped = sat:hinge "plain", sat:hinge "shaped"
local modes = { plain = sat:modes "plain_boom", shaped = sat:modes "shaped_boom" }
local function near(name, value, expected, tolerance)
  local off = math.abs(value - expected)
  assert(off <= tolerance, ("%s: %.17g, expected %.17g"):format(name, value, expected))
end

-- Shapers: published shares; with the mode exp(s t), s = z w + i w_d, the sum of shares is zero, of zvd and zvdd its derivatives too.
local published = { zv = { 0.503927, 0.496073 }, zvd = { 0.253942, 0.499969, 0.246088 } }
for kind, order in pairs { zv = 0, zvd = 1, zvdd = 2 } do
  for i, share in ipairs(published[kind] or {}) do near(kind, slew.shaper(kind, 0.3, 0.005)[i].share, share, 1e-6) end
  local f, z = 0.37, 0.08
  local w = 2 * math.pi * f
  for power = 0, order do
    local re, im, all = 0, 0, 0
    for _, impulse in ipairs(slew.shaper(kind, f, z)) do
      local size = impulse.share * impulse.time ^ power * math.exp(z * w * impulse.time)
      local phase = w * math.sqrt(1 - z * z) * impulse.time
      re, im, all = re + size * math.cos(phase), im + size * math.sin(phase), all + impulse.share
    end
    near(kind .. " re", re, 0, 1e-13)
    near(kind .. " im", im, 0, 1e-13)
    near(kind .. " sum", all, 1, 1e-15)
  end
end

-- What a shaper leaves of a mode, over what one impulse does [Singer and Seering 1990]; of a mode of f Hz that it was not made for as well.
local function remains(shaper, f, z)
  local w, re, im = 2 * math.pi * f, 0, 0
  for _, impulse in ipairs(shaper) do
    local size = impulse.share * math.exp(z * w * (impulse.time - shaper[#shaper].time))
    local phase = w * math.sqrt(1 - z * z) * impulse.time
    re, im = re + size * math.cos(phase), im + size * math.sin(phase)
  end
  return math.sqrt(re * re + im * im)
end
-- The frequency between a and b at which what remains is level, or least.
local function where(shaper, z, a, b, level)
  local rises = level and remains(shaper, b, z) > level
  for _ = 1, 100 do
    local m = (a + b) / 2
    local beyond
    if level then beyond = (remains(shaper, m, z) > level) == rises else beyond = remains(shaper, m + 1e-7, z) > remains(shaper, m, z) end
    if beyond then b = m else a = m end
  end
  return (a + b) / 2
end
-- Extra-insensitive, undamped: shares (1 + V)/4, (1 - V)/2, (1 + V)/4 half a period apart; zero where cos(pi f / f_0) = -(1 - V)/(1 + V), and no more than V to
-- where it is -(1 - 3V)/(1 + V); of zvd to where it is 2 V - 1. The published widths of 5 % are 0.399 and 0.286 of the frequency.
for _, V in ipairs { 0.05, 0.1 } do
  local f, ei = 0.25, slew.shaper("ei", 0.25, 0, V)
  for i, share in ipairs { (1 + V) / 4, (1 - V) / 2, (1 + V) / 4 } do
    near("ei", ei[i].share, share, 1e-15)
    near("ei time", ei[i].time, 2 * (i - 1), 1e-14)
  end
  local zero, edge = math.acos((1 - V) / (1 + V)) / math.pi, math.acos((1 - 3 * V) / (1 + V)) / math.pi
  near("at the frequency", remains(ei, f, 0), V, 1e-14)
  for _, side in ipairs { -1, 1 } do
    near("zero beside it", remains(ei, f * (1 + side * zero), 0), 0, 1e-14)
    near("edge", where(ei, 0, f * (1 + side * zero), f * (1 + 1.5 * side * edge), V), f * (1 + side * edge), 1e-12)
  end
  near("edge of zvd", where(slew.shaper("zvd", f), 0, f, 1.3 * f, V), f * (1 + 2 * math.asin(math.sqrt(V)) / math.pi), 1e-12)
end
near("5 %", 2 * math.acos(0.85 / 1.05) / math.pi, 0.399, 1e-3)
near("5 % of zvd", 4 * math.asin(math.sqrt(0.05)) / math.pi, 0.286, 2e-3)
-- Damped: V there and at most V near it, zero on both sides; within a hundredth of the coefficients of Singhose, Seering and Singer 1994.
for _, z in ipairs { 0.001, 0.05, 0.1, 0.2, 0.3 } do
  local f, V = 0.7, 0.05
  local ei, period = slew.shaper("ei", f, z), 1 / (f * math.sqrt(1 - z * z))
  near("sum", ei[1].share + ei[2].share + ei[3].share, 1, 1e-15)
  near("damped, at the frequency", remains(ei, f, z), V, 1e-11)
  near("extreme there", (remains(ei, f + 1e-4, z) - remains(ei, f - 1e-4, z)) / 2e-4, 0, 1e-6)
  assert(remains(ei, 1.01 * f, z) < V and remains(ei, 0.99 * f, z) < V)
  for _, side in ipairs { -1, 1 } do
    local a, b = f * (1 + 0.05 * side), f * (1 + 0.35 * side)
    near("damped, zero", remains(ei, where(ei, z, math.min(a, b), math.max(a, b)), z), 0, 1e-6)
  end
  near("first share", ei[1].share, 0.24968 + 0.24961 * V + 0.80008 * z + 1.23328 * V * z + 0.49599 * z ^ 2 + 3.17316 * V * z ^ 2, 2e-3)
  near("last share", ei[3].share, 0.25149 + 0.21474 * V - 0.83249 * z + 1.41498 * V * z + 0.85181 * z ^ 2 - 4.90094 * V * z ^ 2, 2e-3)
  near("second", ei[2].time / period, 0.4999 + 0.46159 * V * z + 4.26169 * V * z ^ 2 + 1.75601 * V * z ^ 3 + 8.57843 * V ^ 2 * z - 108.644 * V ^ 2 * z ^ 2 + 336.989 * V ^ 2 * z ^ 3, 0.015)
  near("last", ei[3].time / period, 1, 0.025)
end

-- Profiles: the turn asked for, no faster than allowed, as fast as that; rate and acceleration are derivatives.
local from, turn = quat.from_axis_angle({ 1, 2, -0.5 }, 0.7), { 0.3, -0.2, 0.5 }
local far = vec.norm(turn)
local to = quat.multiply(from, quat.from_axis_angle(turn, far))
for _, limits in ipairs { { 0.02, 0.001 }, { 5, 0.001 } } do
  for _, kind in ipairs { "trapezoid", "versine", "quintic" } do
    for _, shapers in ipairs { {}, { slew.shaper("zv", 0.01, 0.01), slew.shaper("zvd", 0.03) } } do
      local rate, acceleration = table.unpack(limits)
      local plan = slew.plan { from = from, to = to, rate = rate, acceleration = acceleration, profile = kind, shapers = shapers, start = 3 }
      near("angle", plan.angle, far, 1e-14)
      near("axis", vec.norm(vec.sub(plan.axis, vec.unit(turn))), 0, 1e-14)
      near("before", vec.norm(quat.error(from, (plan.at(3)))), 0, 1e-15)
      near("end", vec.norm(quat.error(to, (plan.at(3 + plan.duration)))), 0, 1e-14)
      local fastest, hardest, h = 0, 0, 1e-4 * plan.duration
      for i = 0, 1000 do
        local t = 3 + i / 1000 * plan.duration
        local q, w, a = plan.at(t)
        fastest, hardest = math.max(fastest, vec.norm(w)), math.max(hardest, vec.norm(a))
        local ahead, w2 = plan.at(t + h)
        near("rate", vec.norm(vec.sub(vec.scale(1 / h, quat.error(q, ahead)), vec.scale(0.5, vec.add(w, w2)))), 0, 1.1 * acceleration * h)
        near("acceleration", vec.norm(vec.sub(vec.scale(1 / h, vec.sub(w2, w)), a)), 0, kind == "trapezoid" and 2.1 * acceleration or 0.01 * acceleration)
      end
      assert(fastest <= rate * (1 + 1e-12) and hardest <= acceleration * (1 + 1e-12), "too fast")
      if #shapers == 0 then assert(fastest > 0.999 * rate or hardest > 0.999 * acceleration, "slower than it may be") end
    end
  end
end
do -- what ticks hold begins and ends with them
  local plan = slew.plan { from = from, to = to, rate = 0.02, acceleration = 0.001, start = 3 }
  local function hardness(t) local _, _, a = plan.at(t) return vec.dot(a, plan.axis) end
  for at, acceleration in pairs { [2.999] = 0, [3] = 0.001, [23] = 0, [3 + plan.duration - 20] = -0.001, [3 + plan.duration] = 0 } do
    near("held from " .. at, hardness(at + (at > 20 and 1e-9 or 0)), acceleration, 1e-15)
  end
end
local none = slew.plan { from = from, to = { -from[1], -from[2], -from[3], -from[4] }, rate = 1, acceleration = 1 }
assert(none.duration < 1e-6 and vec.norm(quat.error(from, (none.at(1)))) < 1e-15)
for expected, call in pairs {
  ["zv, zvd, zvdd or ei, got umzv"] = function() slew.shaper("umzv", 1) end,
  ["a damping of ei from 0 to 0.3, got 0.4"] = function() slew.shaper("ei", 1, 0.4) end,
  ["what remains of the vibration, from 0.001 to 0.15, got 0.2"] = function() slew.shaper("ei", 1, 0, 0.2) end,
  ["what remains, of ei alone, got 0.05"] = function() slew.shaper("zvd", 1, 0, 0.05) end,
  ["a frequency > 0 Hz, got 0"] = function() slew.shaper("zv", 0) end,
  ["a damping from 0 to below 1, got 1"] = function() slew.shaper("zv", 1, 1) end,
  ["a rate > 0, got nil"] = function() slew.plan { from = from, to = to, acceleration = 1 } end,
  ["to of length 1, got 2"] = function() slew.plan { from = from, to = { 2, 0, 0, 0 }, rate = 1, acceleration = 1 } end,
  ["each with shares that are 1 together, got 0"] = function()
    slew.plan { from = from, to = to, rate = 1, acceleration = 1, shapers = slew.shaper("zv", 1) }  -- not in a list
  end,
  ["a start in s, got inf"] = function() slew.plan { from = from, to = to, rate = 1, acceleration = 1, start = math.huge } end,
  ["impulses with a time >= 0 and a share, got -1"] = function()
    slew.plan { from = from, to = to, rate = 1, acceleration = 1, shapers = { { { time = -1, share = 1 } } } }
  end,
  ["the profile trapezoid, versine or quintic, got cubic"] = function() slew.plan { from = from, to = to, rate = 1, acceleration = 1, profile = "cubic" } end,
} do
  local ok, why = pcall(call)
  assert(not ok and why:find(expected, 1, true), why)
end

-- The boom after a turn: shaped for its first two modes in the plane of the turn, with the bus free to turn back.
initial { plain = { angle = 0 } }
mission { duration = "80 s", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "10 Hz" } }
local m, L, r = 2700 * 4 * 0.04 * 0.02, 4, 0.5
local inertia = 80 + m * (L * L / 3 + L * r + r * r)
local target = quat.from_axis_angle({ 0, 1, 0 }, math.rad(60))
local still = { 1, 0, 0, 0 }
local now = sat:system_modes { elastic = 6 }
local shapers = {}
for i = now.first_elastic, now.first_elastic + 5, 2 do  -- each twice: two vehicles
  shapers[#shapers + 1] = slew.shaper("zv", now.frequency[i], now.damping[i])
end
local limits = { from = still, to = target, rate = math.rad(2), acceleration = math.rad(0.5) }
local bare = slew.plan(limits)
limits.shapers = shapers
local soft = slew.plan(limits)
local left = persist { plain = 0, shaped = 0 }
controller { name = "turn", rate = "200 Hz", step = function(t)
  for name, plan in pairs { plain = bare, shaped = soft } do
    local _, _, acceleration = plan.at(t)
    sat:hinge(name):force(inertia * acceleration[2])
    if t > plan.duration + 0.01 then
      local one = modes[name]
      left[name] = math.max(left[name], math.abs(one:eta(1)) + math.abs(one:eta(2)) + math.abs(one:eta(3)))
    end
  end
end }
check { name = "both turn", unit = "deg", value = function() return math.deg(math.abs(plain:angle() - shaped:angle())) end, below = 0.1 }
check { name = "where they should", unit = "deg", value = function() return math.deg(shaped:angle()) end, equal = { 60, tolerance = 0.05 } }
check { name = "plain, something is left", value = function() return left.plain end, above = 1e-3 }
check { name = "shaped, 1 % of that", value = function() return left.shaped / left.plain end, below = 0.01 }
