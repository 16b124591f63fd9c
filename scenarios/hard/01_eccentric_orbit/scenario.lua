-- Twenty revolutions with e = 0.99: at the perigee the satellite is 199 times as fast as at the apogee, and steps must follow.

local p = parameters { perigee = "7000 km", eccentricity = 0.99, revolutions = 20 }
local mu = 398600.4418e9                           -- as in vehicle.yaml, SI
local a = p.perigee / (1 - p.eccentricity)
local period = 2 * math.pi * math.sqrt(a ^ 3 / mu)
local speed = math.sqrt(mu / p.perigee * (1 + p.eccentricity))

local body = vehicle("vehicle.yaml"):body "body"
initial { body = { position = { p.perigee, 0, 0 }, velocity = { 0, speed, 0 }, rate = { 0, 0, 0 } } }

mission {
  title = "twenty revolutions with an eccentricity of 0.99",
  duration = p.revolutions * period,
  integrator = { method = "dop853", relative = 1e-13 },
  output = { period = 2000 },
}

local function energy()
  local r, v = { body:position() }, { body:velocity() }
  return 0.5 * vec.dot(v, v) - mu / vec.norm(r)
end
local at_start = -mu / (2 * a)

figure { name = "period", unit = "s", value = function() return period end }
-- 60,000 steps of 1e-13 each, of a difference of two numbers a hundred times as large, at random signs: 2e-9 of the energy. Half as
-- much again of that is the error of the period, and twenty periods are 1e8 s.
check { name = "back at the perigee, across", unit = "m", below = 1,
  value = function() local x, _, z = body:position() return math.abs(vec.norm { body:position() } - p.perigee) + math.abs(z) end }
check { name = "back in time", unit = "s", below = 0.3, value = function() local _, y = body:position() return math.abs(y) / speed end }
check { name = "energy of the orbit, relative", below = 2e-9, value = function() return math.abs(energy() / at_start - 1) end }
