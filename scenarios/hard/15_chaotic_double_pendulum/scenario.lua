-- A double pendulum that turns over: what is off grows by a thousand every four seconds.

local sat = vehicle "vehicle.yaml"
local upper, lower = sat:hinge "upper", sat:hinge "lower"

mission {
  title = "a chaotic double pendulum",
  duration = 12,
  integrator = { method = "dop853", relative = 1e-13 },
  output = { period = 0.1 },
}
-- By the dense twin in 113 bits, extrapolated midpoint rule of order 22 with 80 and with 120 steps a second: 16 digits of both agree.
local truth = {
  [4] = { 3.0952324528914636, -3.5099325127969485 },
  [8] = { 7.9657507484754690, 0.9740836098604112 },
  [12] = { -0.8570468803176614, -16.0766661665585247 },
}
local off = persist { [4] = 0, [8] = 0, [12] = 0, energy = 0, before = 0 }
local function energy()
  local p, r = upper:angle(), lower:angle()
  local w, u = upper:rate(), upper:rate() + lower:rate()
  return w ^ 2 + u ^ 2 / 2 + w * u * math.cos(r) - 9.81 * (2 * math.cos(p) + math.cos(p + r))
end
controller {
  name = "comparison", period = 1,
  step = function(t)
    local want = truth[t]
    if want then off[t] = math.max(math.abs(upper:angle() - want[1]), math.abs(lower:angle() - want[2])) end
    if t == 0 then off.before = energy() end
    local e = math.abs(energy() - off.before)
    if not (e <= off.energy) then off.energy = e end
  end,
}
-- A method adds 1e-13 a step; to be off doubles in 0.4 s, which is a thousand times in four seconds.
for _, at in ipairs { { 4, 1e-10 }, { 8, 1e-7 }, { 12, 1e-4 } } do
  check { name = ("angles after %d s"):format(at[1]), unit = "rad", value = function() return off[at[1]] end, below = at[2] }
end
check { name = "energy", unit = "J", value = function() return off.energy end, below = 1e-10 }
