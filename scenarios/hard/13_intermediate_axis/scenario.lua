-- A body that turns about its intermediate axis turns over, again and again; after 1e5 turns it must be where Euler and Poinsot say.

local body = vehicle("vehicle.yaml"):body "brick"
local A, B, C = 1, 2, 2.5                             -- as in vehicle.yaml, SI
local k, periods = 0.99, 21120                        -- modulus: 1 never comes back to turn over; turns over twice a period

-- omega = (a cn, b sn, c dn) of p t and k where 2 T B < L^2 (Landau and Lifshitz, Mechanics, section 37); it begins without b.
local b = 2 * math.pi
local a = b * math.sqrt(B * (C - B) / (A * (C - A)))
local c = a / k * math.sqrt(A * (B - A) / (C * (C - B)))
local p = c * math.sqrt((C - B) * (C - A) / (A * B))
local momentum = math.sqrt((A * a) ^ 2 + (C * c) ^ 2)

-- Means of 1 and k' (Abramowitz and Stegun, 16.4 and 17.6): the period 4 K / p, and sn by the amplitude.
local x, y, z = { [0] = 1 }, math.sqrt(1 - k ^ 2), {}
repeat
  local n = #x + 1
  x[n], y, z[n] = (x[n - 1] + y) / 2, math.sqrt(x[n - 1] * y), (x[n - 1] - y) / 2
until z[n] < 1e-16
local period = 2 * math.pi / x[#x] / p
local function sn(u)
  local phi = 2 ^ #x * x[#x] * u
  for n = #x, 1, -1 do phi = (phi + math.asin(z[n] / x[n] * math.sin(phi))) / 2 end
  return math.sin(phi)
end
-- The turn about the momentum in a period: the trapezoidal rule is exact but for round-off on what is smooth and comes back.
local points, turn = 400, 0
for i = 1, points do
  local s2 = sn(p * period * i / points) ^ 2
  local w1, w2 = a * a * (1 - s2), b * b * s2
  turn = turn + momentum * (A * w1 + B * w2) / (A * A * w1 + B * B * w2) * period / points
end
local function about_momentum(angle)
  local s = math.sin(angle / 2) / momentum
  return { math.cos(angle / 2), s * A * a, 0, s * C * c }
end

initial { brick = { angular_velocity = { a, 0, c } } }
mission {
  title = "1e5 turns beside the intermediate axis",
  duration = periods * period,
  integrator = { method = "dop853", relative = 1e-13 },
  output = { period = 1000 },
}
local function rates()
  local w = { body:rate() }
  return w, (A * w[1] ^ 2 + B * w[2] ^ 2 + C * w[3] ^ 2) / (A * a ^ 2 + C * c ^ 2) - 1
end
-- Each of 2.6e6 steps loses energy by 3e-16 of itself, a three-hundredth of its tolerance and always in the same sense: 7e-10. The period
-- hangs on the energy by K'(k), large beside the separatrix, and the phase on the sum of all periods: 1e-4 rad. Ten times the
-- tolerance is ten times the error in all three, so that it is the method's and not the truth's.
check { name = "energy, relative", value = function() local _, lost = rates() return math.abs(lost) end, below = 1e-8 }
check { name = "rates, relative", value = function()
  local w = rates()
  return math.sqrt((w[1] - a) ^ 2 + w[2] ^ 2 + (w[3] - c) ^ 2) / b
end, below = 1e-4 }
check { name = "attitude", unit = "rad", value = function()
  local e = quat.error(about_momentum(math.fmod(periods * turn, 4 * math.pi)), { body:attitude() })
  return math.sqrt(e[1] ^ 2 + e[2] ^ 2 + e[3] ^ 2)
end, below = 1e-3 }
figure { name = "period", unit = "s", value = function() return period end }
figure { name = "turn in a period", unit = "rad", value = function() return turn end }
