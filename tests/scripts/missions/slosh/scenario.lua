-- The first mode of a liquid in a cylinder as a pendulum. Numbers by mpmath in 30 digits: mass and pivot by the energy of the surface and by the
-- pressure on wall and bottom, integrated, of the flow cosh(x z / R) J_1(x r / R); so the closed forms are checked by the flow they stand for.
local sat = vehicle "vehicle.yaml"
local model = slosh.cylinder { radius = 0.7, depth = 0.9, mass = 300, acceleration = 2 }
local first = model.modes[1]
local tank, pendulum = sat:hinge "tank", sat:hinge "pendulum"
local small = 1e-5
initial { pendulum = { angle = small } }
mission { duration = "20 s", integrator = { method = "dopri5", relative = 1e-12, absolute = 1e-18 }, output = { rate = "10 Hz" } }
tank:profile { rate_table = { { 0, 0 }, { 1, 0 } } }
local worst, force = 0, 0
controller { name = "look", rate = "5 Hz", step = function(t)
  local angle = small * math.cos(first.rate * t)
  worst = math.max(worst, math.abs(pendulum:angle() - angle))
  force = math.max(force, math.abs(tank:applied() + first.mass * 2 * angle))    -- held against m g angle
end }
local function is(name, value, expected, unit)
  check { name = name, unit = unit, value = function() return value end, equal = { expected, tolerance = 1e-13 * math.abs(expected) } }
end
is("mass", first.mass, 104.20459354017377, "kg")
is("length", first.length, 0.38693093995535013, "m")
is("pivot", first.pivot, 0.65688806483790112, "m")
is("mass that stays", model.fixed_mass, 195.79540645982623, "kg")
is("its height", model.fixed_height, 0.54582091306757764, "m")
is("rate", first.rate, 2.273517328226368, "rad/s")
is("rate of the spring", math.sqrt(first.stiffness / first.mass), first.rate, "rad/s")
-- w^2 R / g, m / M, L / R of published tables; four modes of a shallow and of a deep tank leave the mass centre where it is
for _, row in ipairs { { 0.5, 1.337026, 0.660108, 0.747929 }, { 1, 1.750798, 0.432197, 0.571168 }, { 2, 1.838854, 0.226967, 0.543817 } } do
  local m = slosh.cylinder { radius = 1, depth = row[1], mass = 1, acceleration = 1 }.modes[1]
  for i, value in ipairs { m.rate ^ 2, m.mass, m.length } do
    check { name = ("h/R %g, %d"):format(row[1], i), value = function() return value end, equal = { row[i + 1], tolerance = 6e-7 } }
  end
end
for _, depth in ipairs { 1e-5, 0.3, 5000 } do
  local m = slosh.cylinder { radius = 1.5, depth = depth, mass = 7, modes = 4 }
  local mass, moment = m.fixed_mass, m.fixed_mass * m.fixed_height
  for _, mode in ipairs(m.modes) do mass, moment = mass + mode.mass, moment + mode.mass * mode.height end
  check { name = ("mass of %g m"):format(depth), value = function() return mass end, equal = { 7, tolerance = 1e-13 } }
  check { name = ("mass centre of %g m"):format(depth), value = function() return moment / 7 / depth end, equal = { 0.5, tolerance = 1e-12 } }
  assert(m.modes[1].rate == 0)
end
check { name = "swing", unit = "rad", below = 1e-13, value = function() return worst end }      -- small^3, times the time
check { name = "force on the tank", unit = "N", below = 1e-10, value = function() return force end }
local ok, why = pcall(slosh.cylinder, { radius = 1, depth = 0, mass = 1 })
assert(not ok and why:find("expected depth > 0, got 0", 1, true), why)
ok, why = pcall(slosh.cylinder, { radius = 1, height = 0, mass = 1 })
assert(not ok and why:find("one of the keys radius, depth, mass, acceleration, modes, got height", 1, true), why)
