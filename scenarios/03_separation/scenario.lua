-- A stack of three stages that spins and coasts is taken apart: a clamp opens, springs push the stages apart, and where they have done their
-- work the stage flies by itself. Twice. Everything is along the spin axis, so that the books know the end: each pair is two masses on a spring.

local p = parameters { first = "10 s", second = "30 s", finish = "60 s" }

local sat = vehicle "vehicle.yaml"
local middle, upper = sat:hinge "middle", sat:hinge "upper"

mission {
  title = "a stack of three stages is taken apart",
  duration = p.finish,
  integrator = { method = "dop853", relative = 1e-12 },
  output = { rate = "10 Hz", nodes = { "middle", "upper" } },
}

phase { name = "stack", duration = p.first, exit_ = function() sat:unlock "upper" end }
phase { name = "upper stage away", duration = p.second - p.first, exit_ = function() sat:unlock "middle" end }
phase { name = "middle stage away" }
event { name = "upper springs at rest", once = true, direction = "rising", when = function() return upper:q() end,
        action = function() sat:detach "upper" end }
event { name = "middle springs at rest", once = true, direction = "rising", when = function() return middle:q() end,
        action = function() sat:detach "middle" end }

-- Two masses a and b on a spring k that is compressed by x: at rest length after a quarter of a period, apart by v.
local function pushed(a, b, k, x)
  local omega = math.sqrt(k * (a + b) / (a * b))
  return { after = 0.5 * math.pi / omega, v = omega * x }
end

-- Heights of the origins at the end; as in vehicle.yaml, SI.
local lower_mass, middle_mass, upper_mass, x, v = 900, 400, 150, 0.05, 3
local pair_mass = lower_mass + middle_mass
local all = pair_mass + upper_mass
local function books()
  local one, two = pushed(pair_mass, upper_mass, 30e3, x), pushed(lower_mass, middle_mass, 40e3, x)
  local t1, t2 = p.first + one.after, p.second + two.after
  local function centre(lower, d2, d3)       -- of all, with the lower stage at `lower`
    return lower + (middle_mass * (2 + d2 + 0.8) + upper_mass * (2 + d2 + 1.6 + d3 + 0.5)) / all
  end
  local lower_1 = centre(0, -x, -x) + v * t1 - centre(0, -x, 0)                       -- the lower stage at t1
  local pair_v = v - one.v * upper_mass / all
  local upper_end = lower_1 + (2 - x) + 1.6 + (pair_v + one.v) * (p.finish - t1)
  local between = middle_mass / pair_mass                                             -- the centre of the pair over the lower stage, per distance
  local lower_2 = lower_1 + pair_v * (t2 - t1) - between * x                          -- the springs lengthen by x about the centre of both
  local lower_v = pair_v - two.v * between
  return {
    lower = lower_2 + lower_v * (p.finish - t2),
    middle = lower_2 + 2 + (lower_v + two.v) * (p.finish - t2),
    upper = upper_end,
  }
end
local function height(name)
  local _, _, z = sat:body(name):position()
  return z
end
local function apart(name) return math.abs(height(name) - books()[name]) end

for _, name in ipairs { "lower", "middle", "upper" } do
  check { name = name .. " stage where the books have it", unit = "m", value = function() return apart(name) end, below = 1e-10 }
end
check { name = "spin of the upper stage kept", unit = "rad/s", value = function()
  local wx, wy, wz = sat:body("upper"):rate()
  return math.abs(wx) + math.abs(wy) + math.abs(wz - 0.5)
end, below = 1e-14 }
figure { name = "upper stage over the middle one", unit = "m", value = function() return height "upper" - height "middle" end }
