-- A chain of point masses that grow, shrink or alternate by 1e12 swings in all of its modes at once.

local p = parameters { masses = "grow", amplitude = "1e-14 m" }   -- or "shrink", "alternate": the vehicle file
local sat = vehicle(p.masses .. ".yaml")
local links, gravity, rod = 4, 9.81, 0.1              -- as in vehicle files, SI
local masses, hinges = {}, {}
for i = 1, links do
  local name = ("mass_%d"):format(i)
  masses[i], hinges[i] = sat:body(name):mass(), sat:hinge(name)
end

-- Small motion: a rod carries the weight of all below it and turns their momentum, so that its slope is omega^2 / g times the place of their
-- mass centre. From the lowest mass, at 1, up to the hinge, which must stand at zero.
local function hang(lambda)
  local x, mass, moment, places = 1, 0, 0, {}
  for i = links, 1, -1 do
    mass, moment, places[i] = mass + masses[i], moment + masses[i] * x, x
    x = x - rod * lambda / gravity * moment / mass
  end
  return x, places
end
-- Likewise from the hinge down, the uppermost mass at 1.
local function stand(lambda)
  local weight = 0
  for i = 1, links do weight = weight + masses[i] * gravity end
  local x, pull, places = 0, weight / rod, {}         -- pull: weight below times slope
  for i = 1, links do
    x = x + rod * pull / weight
    places[i] = x
    pull, weight = pull - lambda * masses[i] * x, weight - masses[i] * gravity
  end
  return places
end
-- Each recurrence keeps its digits as far as places grow; they meet at the mass whose own equation is then nearest to being met (Fernando 1997).
local function shape(lambda)
  local _, up = hang(lambda)
  local down = stand(lambda)
  local best, at = math.huge, 1
  for k = 1, links do
    local below = 0
    for i = k, links do below = below + masses[i] * gravity / rod end
    local left = below * (1 - (k > 1 and down[k - 1] / down[k] or 0)) / masses[k] - lambda
    if k < links then left = left + (below / masses[k] - gravity / rod) * (1 - up[k + 1] / up[k]) end
    if math.abs(left) < best then best, at = math.abs(left), k end
  end
  local places, largest = {}, 0
  for i = 1, links do
    places[i] = i < at and down[i] / down[at] or up[i] / up[at]
    largest = math.max(largest, math.abs(places[i]))
  end
  for i = 1, links do places[i] = p.amplitude * places[i] / largest end
  return places
end
local modes, grid = {}, 1.001
local low = 0.01 * gravity / rod
while #modes < links do
  if hang(low) * hang(low * grid) < 0 then
    local a, b = low, low * grid
    for _ = 1, 50 do
      local middle = 0.5 * (a + b)
      if hang(a) * hang(middle) > 0 then a = middle else b = middle end
    end
    modes[#modes + 1] = { omega = math.sqrt(a), places = shape(a) }
  end
  low = low * grid
end
local fastest = modes[links].omega
local per_second = 10 ^ math.ceil(math.log(fastest / 300, 10))       -- runs: 30 to 300 rad of the fastest each
local duration = 1 / per_second
for _, mode in ipairs(modes) do                       -- each mode comes as far as p.amplitude, or would at the speed that it begins with
  mode.speed = math.max(mode.omega, 1 / duration)
end
local function place(i, t)
  local x = 0
  for _, mode in ipairs(modes) do x = x + mode.places[i] * mode.speed * math.sin(mode.omega * t) / mode.omega end
  return x
end

local start, above, slope = {}, 0, 0
for i = 1, links do
  local v = 0
  for _, mode in ipairs(modes) do v = v + mode.places[i] * mode.speed end
  start[("mass_%d"):format(i)] = { rate = (v - above) / rod - slope }
  above, slope = v, (v - above) / rod
end
initial(start)

mission {
  title = "masses that " .. p.masses .. " by 1e12",
  duration = duration,
  integrator = { method = "dop853", relative = 1e-12, absolute = 1e-30 },
  output = { rate = 10 * per_second },
}
local worst, farthest = persist {}, persist {}
for i = 1, links do worst[i], farthest[i] = 0, 0 end
controller {
  name = "comparison", rate = 1000 * per_second,
  step = function(t)
    local inclination, x = 0, 0
    for i = 1, links do
      inclination = inclination + hinges[i]:angle()
      x = x + rod * inclination
      local want = place(i, t)
      local e = math.abs(x - want)
      if not (e <= worst[i]) then worst[i] = e end    -- a NaN stays
      farthest[i] = math.max(farthest[i], math.abs(want))
    end
  end,
}
figure { name = "slowest frequency", unit = "rad/s", value = function() return modes[1].omega end }
figure { name = "fastest frequency", unit = "rad/s", value = function() return fastest end }
-- Each of 100 to 200 rad of the fastest adds 1e-12 or less; an amplitude of 1e-13 m already has 7e-11 of what is not small.
for i = 1, links do
  check { name = ("mass %d, over its amplitude"):format(i), value = function() return worst[i] / farthest[i] end, below = 1e-10 }
end
