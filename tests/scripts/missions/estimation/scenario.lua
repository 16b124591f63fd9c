-- Attitudes to point at against orbits; estimates against noise of known size; a filter on the readings of gyros and a star tracker in flight.
local sat = vehicle "vehicle.yaml"
local function near(name, value, expected, tolerance)
  local off = math.abs(value - expected)
  assert(off <= tolerance, ("%s: %.17g, expected %.17g"):format(name, value, expected))
end
local function same(name, a, b, tolerance) near(name, vec.norm(vec.sub(a, b)), 0, tolerance) end
local function normal() return math.sqrt(-2 * math.log(1 - math.random())) * math.cos(2 * math.pi * math.random()) end
local function noise(sigma) return { sigma * normal(), sigma * normal(), sigma * normal() } end
local function any_direction() return vec.unit(noise(1)) end
local function any_attitude() return quat.from_rotation_vector(vec.scale(math.pi * math.random(), any_direction())) end
--- Mean of `n` numbers of chi-square with `freedom` each: within 4.5 standard deviations, sqrt(2 freedom / n).
local function chi_square(name, sum, n, freedom) near(name, sum / n, freedom, 4.5 * math.sqrt(2 * freedom / n)) end

-- Rotation vectors, back and forth.
for _, a in ipairs { 0, 1e-12, 1e-3, 1, 3.1 } do
  local turn = vec.scale(a, vec.unit { 1, -2, 0.5 })
  same("rotation vector", quat.to_rotation_vector(quat.from_rotation_vector(turn)), turn, 1e-15 + 2e-16 * a)
end

-- Alignment: the first exactly, the second in the half plane of its direction; of two that can both be met, both.
for _ = 1, 200 do
  local q, a, b = any_attitude(), any_direction(), any_direction()
  local found = pointing.align(vec.scale(3, a), quat.rotate(q, a), b, vec.scale(0.1, quat.rotate(q, b)))
  same("both", quat.error(q, found), { 0, 0, 0 }, 1e-15 / vec.norm(vec.cross(a, b)) * 4)
  local along, second = any_direction(), any_direction()
  found = pointing.align(a, along, b, second)
  same("first", quat.rotate(found, a), along, 2e-15)
  local got = quat.rotate(found, b)
  local aside = vec.sub(got, vec.scale(vec.dot(got, along), along)) -- across the first as the second direction is
  local wanted = vec.sub(second, vec.scale(vec.dot(second, along), along))
  near("second", vec.dot(vec.unit(aside), vec.unit(wanted)), 1, 1e-13)
end
for _, turn in ipairs { { math.pi, 0, 0 }, { 0, math.pi, 0 }, { 0, 0, math.pi } } do -- where one component alone is not small
  local q = quat.from_rotation_vector(turn)
  local found = pointing.align({ 1, 2, 3 }, quat.rotate(q, { 1, 2, 3 }), { -1, 0, 1 }, quat.rotate(q, { -1, 0, 1 }))
  same("half a turn", quat.error(q, found), { 0, 0, 0 }, 1e-14)
end

-- Axes of an orbit, and their rate by differences along it.
local mu, e = 3.986004418e14, 0.3
local function at(nu) return orbit.state({ a = 9e6, e = e, inclination = 1.1, node = 0.4, periapsis = 2, anomaly = nu }, mu) end
for _, nu in ipairs { 0, 1, 3, 5 } do
  local r, v = at(nu)
  local out, down, across = vec.unit(r), vec.scale(-1, vec.unit(r)), vec.unit(vec.cross(r, v))
  local q, rate = pointing.hill(r, v)
  same("hill x", quat.rotate(q, { 1, 0, 0 }), out, 1e-15)
  same("hill z", quat.rotate(q, { 0, 0, 1 }), across, 1e-15)
  local p, turning = pointing.nadir(r, v)
  same("nadir z", quat.rotate(p, { 0, 0, 1 }), down, 1e-15)
  same("nadir y", quat.rotate(p, { 0, 1, 0 }), vec.scale(-1, across), 1e-15)
  assert(vec.dot(quat.rotate(p, { 1, 0, 0 }), v) > 0, "x ahead")
  same("one rate", quat.rotate(p, turning), quat.rotate(q, rate), 1e-18)
  local h = 1e-3 -- a true anomaly turns by |r x v| / r^2 in a second
  local later = at(nu + h * vec.norm(rate))
  local ahead = vec.sub(vec.unit(later), out)
  near("rate", vec.norm(ahead) / h / vec.norm(rate), 1, 1e-5)
  assert(vec.dot(quat.rotate(q, { 0, 1, 0 }), ahead) > 0, "y ahead")
end

-- Directions without noise give the attitude, also where w is zero; with noise its covariance and the misfit are what they are said to be.
for _, turn in ipairs { { math.pi, 0, 0 }, { 0, 0, math.pi }, { 0.3, -2, 1 }, { 0, 0, 0 } } do
  local q, seen = quat.from_rotation_vector(turn), {}
  for k, r in ipairs { { 1, 0.2, 0 }, { 0, 1, 0.1 }, { 0.3, 0, -2 } } do seen[k] = { body = quat.rotate(quat.conjugate(q), r), world = r, sigma = 0.001 * k } end
  local found, _, misfit = estimation.wahba(seen)
  same("wahba", quat.error(q, found), { 0, 0, 0 }, 1e-14)
  near("no misfit", misfit, 0, 1e-20)
end
local off, misfits, rounds = 0, 0, 400
for _ = 1, rounds do
  local q, seen = any_attitude(), {}
  for k = 1, 4 do
    local r, sigma = any_direction(), 1e-4 * k
    seen[k] = { body = vec.add(quat.rotate(quat.conjugate(q), r), noise(sigma)), world = r, sigma = sigma }
  end
  local found, covariance, misfit = estimation.wahba(seen)
  local x = vector(quat.error(found, q))
  off, misfits = off + x:dot(covariance:solve(x)), misfits + misfit
end
chi_square("covariance", off, rounds, 3)
chi_square("misfit", misfits, rounds, 2 * 4 - 3)

-- What a large turn makes of errors: the covariance is that of differences of the turn itself.
local start = { q = { 1, 0, 0, 0 }, sigma = 0.02, bias = { 0.1, -0.2, 0.3 }, bias_sigma = 0.05, angle_random_walk = 0 }
local angle, pause, small = { 0.9, 0.4, -1.1 }, 0.7, 1e-5
local function turned_from(k, h)
  local x = { 0, 0, 0, 0, 0, 0 }
  x[k] = h
  local nav = estimation.attitude_filter(start)
  nav.q = quat.multiply(nav.q, quat.from_rotation_vector { x[1], x[2], x[3] })
  nav.bias = vec.add(nav.bias, { x[4], x[5], x[6] })
  nav:propagate(angle, pause)
  return nav
end
local F = {}
for row = 1, 6 do F[row] = {} end
for k = 1, 6 do
  local less, more = turned_from(k, -small), turned_from(k, small)
  local turn, drift = quat.error(less.q, more.q), vec.sub(more.bias, less.bias)
  for i = 1, 3 do
    F[i][k], F[i + 3][k] = turn[i] / (2 * small), drift[i] / (2 * small)
  end
end
F = matrix(F)
local begun, ended = estimation.attitude_filter(start).covariance, turned_from(1, 0).covariance
near("turned covariance", (F * begun * F:t() - ended):max_abs() / ended:max_abs(), 0, 1e-8)

-- The filter: errors and innovations as large as its covariances say, over many histories of noise, the same walk of biases and turning.
local errors, trackers, directions, histories, ticks = 0, 0, 0, 100, 40
local white, walk, dt = 1e-4, 4e-4, 0.5 -- angle and bias that wander together
for _ = 1, histories do
  local q, bias = any_attitude(), noise(1e-3)
  local nav = estimation.attitude_filter { q = quat.multiply(q, quat.from_rotation_vector(noise(0.01))), sigma = 0.01, bias_sigma = 1e-3, angle_random_walk = white, rate_random_walk = walk }
  for k = 1, ticks do
    local before = bias -- angle and bias after dt together: noise of covariance dt^2/2, dt^3/3
    local step = noise(1)
    bias = vec.add(bias, vec.scale(walk * math.sqrt(dt), step))
    local wander = vec.scale(walk * dt ^ 1.5, vec.add(vec.scale(0.5, step), vec.scale(math.sqrt(1 / 12), noise(1))))
    local turn = { 0.4 * dt, -0.3 * dt * math.sin(k / 5), 0.2 * dt }
    q = quat.multiply(q, quat.from_rotation_vector(turn))
    local read = vec.add(vec.add(turn, vec.scale(dt, before)), vec.add(wander, noise(white * math.sqrt(dt))))
    nav:propagate(read, dt)
    if k % 2 == 0 then
      trackers = trackers + nav:attitude(quat.multiply(q, quat.from_rotation_vector { 1e-4 * normal(), 1e-4 * normal(), 8e-4 * normal() }), { 1e-4, 1e-4, 8e-4 })
    else
      local r = any_direction()
      directions = directions + nav:direction(vec.add(quat.rotate(quat.conjugate(q), r), noise(3e-4)), r, 3e-4)
    end
  end
  local x = quat.error(nav.q, q)
  local drift = vec.sub(bias, nav.bias)
  local error = vector { x[1], x[2], x[3], drift[1], drift[2], drift[3] }
  errors = errors + error:dot(nav.covariance:solve(error))
end
chi_square("errors", errors, histories, 6)
chi_square("trackers", trackers, histories * ticks / 2, 3)
chi_square("directions", directions, histories * ticks / 2, 2)

for expected, call in pairs {
  ["expected two directions, got (1, 0, 0) and (-2, 0, 0), which lie on one line"] = function() pointing.align({ 1, 0, 0 }, { 0, 0, 1 }, { -2, 0, 0 }, { 1, 0, 0 }) end,
  ["pointing.align: expected second as three numbers, got {0, 1}"] = function() pointing.align({ 1, 0, 0 }, { 0, 0, 1 }, { 0, 1 }, { 1, 0, 0 }) end,
  ["pointing.align: expected along as three numbers, got {0, 0, 1, 0}"] = function() pointing.align({ 1, 0, 0 }, { 0, 0, 1, 0 }, { 0, 1, 0 }, { 1, 0, 0 }) end,
  ["pointing.hill: expected v as three numbers, got nil"] = function() pointing.hill { 7e6, 0, 0 } end,
  ["pointing.nadir: expected r as three numbers, got 7000000.0"] = function() pointing.nadir(7e6, { 0, 7e3, 0 }) end,
  ["which lie on one line"] = function() pointing.nadir({ 7e6, 0, 0 }, { 100, 0, 0 }) end,
  ["two or more sightings, got 1"] = function() estimation.wahba { {} } end,
  ["sigma > 0 of sighting 2, got nil"] = function() estimation.wahba { { body = { 1, 0, 0 }, world = { 1, 0, 0 }, sigma = 1 }, { body = { 1, 0, 0 }, world = { 1, 0, 0 } } } end,
  ["the directions lie on one line"] = function()
    estimation.wahba { { body = { 1, 0, 0 }, world = { 0, 1, 0 }, sigma = 1 }, { body = { -1, 0, 0 }, world = { 0, -1, 0 }, sigma = 1 } }
  end,
  ["q of length 1, got {1, 1, 0, 0}"] = function() estimation.attitude_filter { q = { 1, 1, 0, 0 }, sigma = 1, angle_random_walk = 1 } end,
  ["estimation.attitude_filter: expected one of the keys q, sigma, bias, bias_sigma, angle_random_walk, rate_random_walk, got bias_sgima"] = function()
    estimation.attitude_filter { q = { 1, 0, 0, 0 }, sigma = 1, angle_random_walk = 1, bias_sgima = 1 }
  end,
  ["one of the keys body, world, sigma, got weight"] = function()
    estimation.wahba { { body = { 1, 0, 0 }, world = { 1, 0, 0 }, sigma = 1, weight = 1 }, { body = { 0, 1, 0 }, world = { 0, 1, 0 }, sigma = 1 } }
  end,
  ["angle_random_walk >= 0, got nil"] = function() estimation.attitude_filter { q = { 1, 0, 0, 0 }, sigma = 1 } end,
  ["dt > 0 s, got 0"] = function() estimation.attitude_filter({ q = { 1, 0, 0, 0 }, sigma = 1, angle_random_walk = 0 }):propagate({ 0, 0, 0 }, 0) end,
} do
  local ok, why = pcall(call)
  assert(not ok and why:find(expected, 1, true) and why:find("scenario.lua:", 1, true) == 1, why) -- told of the line here
end

-- In flight.
mission { duration = "120 s", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "2 Hz" } }
local bus, gyros, tracker = sat:body "bus", sat:device "gyros", sat:device "tracker"
local nav = persist(estimation.attitude_filter { q = { 1, 0, 0, 0 }, sigma = 0.1, bias_sigma = 1e-3, angle_random_walk = 1e-4, rate_random_walk = 1e-7 })
local seen = persist { sum = 0, number = 0 }
local function read(device, name, n)
  local x = {}
  for i = 1, n do x[i] = device:get(name:format(n == 4 and i or ("xyz"):sub(i, i))) end
  return x
end
controller { name = "navigation", rate = "20 Hz", step = function(t)
  if t == 0 then return end
  nav:propagate(read(gyros, "angle_%s", 3), 0.05)
  if t * 2 == math.floor(t * 2) and tracker:valid "attitude_1" then
    seen.sum, seen.number = seen.sum + nav:attitude(read(tracker, "attitude_%d", 4), { 5e-5, 5e-5, 4e-4 }), seen.number + 1
  end
end }
local function error_over_sigma()
  local x, worst = quat.error(nav.q, { bus:attitude() }), 0
  for i = 1, 3 do worst = math.max(worst, math.abs(x[i]) / math.sqrt(nav.covariance(i, i))) end
  return worst
end
check { name = "attitude, in standard deviations", value = error_over_sigma, below = 4 }
check { name = "better than the tracker about its boresight", value = function() return math.sqrt(nav.covariance(3, 3)) end, below = 2e-4 }
check { name = "biases", unit = "rad/s", value = function() return vec.norm(vec.sub(nav.bias, { 2e-4, 2e-4, 2e-4 })) end, below = 5e-5 }
check { name = "innovations", value = function() return seen.sum / seen.number end, within = { 3 - 4.5 * math.sqrt(6 / 240), 3 + 4.5 * math.sqrt(6 / 240) } }
