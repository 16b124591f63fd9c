-- Springs unfold two panels until latches catch them; stops take what overshoots. The hub is pushed back meanwhile, and after all is over it
-- stands still, where the mass centre wants it. The time to the latch and the rate there follow from the energy (README.md).

local hub_mass, mass, arm, inertia = 120, 12, 0.9, 3.3             -- as in vehicle.yaml, SI
local k, rest, start = 4, math.rad(-20), math.rad(90)
local hold, damping = 5000, 40                                      -- of the latch
local total = hub_mass + 2 * mass

-- Both panels move alike: the energy is I(a) a'^2 + k (a - rest)^2. The hub goes up and down as the panels go down and up.
local function I(a) return inertia + mass * arm ^ 2 - 2 * (mass * arm * math.cos(a)) ^ 2 / total end
local rate = -math.sqrt(k * ((start - rest) ^ 2 - rest ^ 2) / I(0))
-- a = rest + (start - rest) cos u: the time is an integral without a singularity; Simpson's rule.
local last = math.acos(-rest / (start - rest))
local function slowness(u) return math.sqrt(I(rest + (start - rest) * math.cos(u)) / k) end
local time, n = 0, 400
for i = 0, n do time = time + (i % 2 == 1 and 4 or (i == 0 or i == n) and 1 or 2) * slowness(last * i / n) * last / n / 3 end

local sat = vehicle "vehicle.yaml"
local hub, right, left = sat:body "hub", sat:hinge "right", sat:hinge "left"
local latches = { sat:device "latch_right", sat:device "latch_left" }

mission {
  title = "two panels unfold and latch",
  duration = "12 s",
  integrator = { method = "dopri5", relative = 1e-10 },
  output = { rate = "100 Hz", reactions = { "right" } },
}

local m = persist { worst = 0, difference = 0 }
event {
  name = "panels are out", direction = "falling",
  when = function() return right:angle() end,
  action = function(t) if not m.time then m.time, m.rate = t, right:rate() end end,
}
controller {
  name = "comparison", rate = "100 Hz",
  step = function(t)
    local x, y, z = hub:position()
    local expected = -2 * mass * arm * (math.sin(right:angle()) - math.sin(start)) / total   -- the mass centre stays
    local e = math.abs(z - expected) + math.abs(x) + math.abs(y)
    if not (e <= m.worst) then m.worst = e end              -- a NaN stays
    local d = math.abs(right:angle() - left:angle())
    if not (d <= m.difference) then m.difference = d end
  end,
}

figure { name = "time to the latch", unit = "s", value = function() return time end }
check { name = "time to the latch by the energy", unit = "s", value = function() return m.time end, equal = { time, tolerance = 1e-8 } }
check { name = "rate at the latch by the energy", unit = "rad/s", value = function() return m.rate end, equal = { rate, tolerance = 1e-8 } }
check { name = "both latches hold", value = function() return latches[1]:get "closed" + latches[2]:get "closed" end, equal = { 2 } }
check { name = "panels move alike", unit = "rad", value = function() return m.difference end, below = 1e-9 }
check { name = "hub where the mass centre wants it", unit = "m", value = function() return m.worst end, below = 1e-9 }
-- The spring pushes on against that of the latch; the swing about it has a decay time of 2 I / 40 = 0.5 s.
check { name = "angle at the end", unit = "deg", value = function() return math.deg(right:angle()) end, equal = { math.deg(k * rest / (k + hold)), tolerance = 1e-6 } }
check { name = "rate at the end", unit = "rad/s", value = function() return math.abs(right:rate()) end, below = 1e-6 }
