-- A bus with a rotor along the normal of its orbit, at rest in axes that turn with the orbit: x up, y ahead. About it, with inertias A, B, C of both,
-- n the rate of the orbit and n H the momentum of the rotor against the bus [Roberson & Hooker 1966],
--   A a'' = (A + B - C - H) b' - (C - B + H) a,   B b'' = -(A + B - C - H) a' - (4 (C - A) + H) b      (time in 1/n),
-- pitch swings by itself, with the inertia of the bus alone; and the mass centre as Hill's equations say, by 1 in the plane and across it.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s" }
local n = math.sqrt(398600.4418e9 / 7e6 ^ 3)
local A, B, C, rotor = 80.5, 120.5, 151, 1
local function roots(H)
  local p, q = 4 * (C - A) + H, C - B + H
  local b, c = A * p + B * q + (A + B - C - H) ^ 2, p * q
  local D = math.sqrt(b * b - 4 * A * B * c)
  return { math.sqrt((b - D) / (2 * A * B)), math.sqrt((b + D) / (2 * A * B)), math.sqrt(3 * (B - A) / (C - rotor)), 1 }
end
initial { frame = { rate = n } }
for _, rate in ipairs { 0, 5, -5 } do
  initial { rotor = { rate = rate } }
  local poles = sat:linearize {}.poles
  for i, w in ipairs(roots(rate * rotor / n)) do
    local least = math.huge
    for _, p in ipairs(poles) do least = math.min(least, math.sqrt(p.re ^ 2 + (p.im - w * n) ^ 2) / (w * n)) end
    -- Poles have sixteen digits less those by which the entries of the model differ, 5 1/s to 1e-6 1/s^2.
    check { name = string.format("rotor at %g rad/s, %d", rate, i), below = 1e-9, value = function() return least end }
  end
end
