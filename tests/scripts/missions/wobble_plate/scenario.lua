-- Loops on surfaces and on an inclined seat: an engine whose pistons a wobble plate drives, and a bead that finds its shortest way on an ellipsoid.
local sat = vehicle "vehicle.yaml"
local t = 2
mission { duration = t, integrator = { method = "dop853", relative = 1e-11 } }

-- The pin of the plate stays in x = 0: at the angle a of the shaft the plate is turned by b about its own axis, tan b = - tan a cos(20 deg).
local tilt, rod, plate = math.rad(20), 0.2, { 0.004, 0.004, 0.007 }
local balls = { { 0.1, 0, 0 }, { -0.05, 0.08660254037844387, 0 }, { -0.05, -0.08660254037844387, 0 } }
local function attitude(a)
  local b = math.atan(-math.sin(a) * math.cos(tilt), math.cos(a))
  return quat.multiply(quat.multiply(quat.from_axis_angle({ 0, 0, 1 }, a), quat.from_axis_angle({ 1, 0, 0 }, tilt)), quat.from_axis_angle({ 0, 0, 1 }, b))
end
local function piston(a, i)
  local x = quat.rotate(attitude(a), balls[i])
  return x[3] + math.sqrt(rod ^ 2 - (balls[i][1] - x[1]) ^ 2 - (balls[i][2] - x[2]) ^ 2)
end
-- Differences of sixth order: 1e-12 here.
local function derivative(f, a)
  local h = 0.01
  return (f(a + 3 * h) - f(a - 3 * h) - 9 * (f(a + 2 * h) - f(a - 2 * h)) + 45 * (f(a + h) - f(a - h))) / (60 * h)
end
local function inertia(a)
  local sum, back = 0.02, quat.conjugate(attitude(a))
  for i = 1, 3 do sum = sum + 0.3 * derivative(function(x) return piston(x, i) end, a) ^ 2 end
  for i = 1, 3 do
    local function turn(x) return quat.to_rotation_vector(quat.multiply(back, attitude(x)))[i] end
    sum = sum + plate[i] * derivative(turn, a) ^ 2
  end
  return sum
end
-- I(a) a'^2 stays; by the classical method of Runge and Kutta.
local first, a, N = inertia(0), 0, 500
local function rate(x) return 8 * math.sqrt(first / inertia(x)) end
for _ = 1, N do
  local h = t / N
  local k1 = rate(a)
  local k2 = rate(a + h / 2 * k1)
  local k3 = rate(a + h / 2 * k2)
  a = a + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(a + h * k3))
end
check { name = "angle of the shaft", unit = "rad", equal = { a, tolerance = 1e-8 }, value = function() return sat:hinge "shaft":q() end }
check { name = "rate of the shaft", unit = "rad/s", equal = { rate(a), tolerance = 1e-8 }, value = function() return sat:hinge "shaft":v() end }
for i = 1, 3 do
  check { name = "piston " .. i, unit = "m", equal = { piston(a, i) - rod, tolerance = 1e-9 }, value = function() return sat:hinge("p" .. i):q() end }
end

-- A bead that nothing pushes goes along a geodesic, at its speed; of an ellipsoid (k x . k x) (k v . v), k over half axes squared, stays
-- [Joachimsthal 1843].
local k, x, v = { 1 / 4, 4 / 9, 1 }, { 1.2, 0.96, 0.48 }, { 0.3, -0.5, 0 }
v[3] = -(k[1] * x[1] * v[1] + k[2] * x[2] * v[2]) / (k[3] * x[3])
initial { bead = { position = x, velocity = v } }
local function kept(x, v)
  local g, c = 0, 0
  for i = 1, 3 do g, c = g + (k[i] * x[i]) ^ 2, c + k[i] * v[i] ^ 2 end
  return g * c
end
local bead = sat:body "bead"
check { name = "speed of the bead", unit = "m/s", equal = { vec.norm(v), tolerance = 1e-10 }, value = function() return vec.norm { bead:velocity() } end }
check { name = "Joachimsthal's constant", equal = { kept(x, v), tolerance = 1e-10 }, value = function() return kept({ bead:position() }, { bead:velocity() }) end }
