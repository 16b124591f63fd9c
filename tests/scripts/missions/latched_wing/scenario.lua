-- A wing that swings to its stop is caught there at once and shakes as a cantilever [Meirovitch 1967]: its modes are b'''' = (b / L)^4 phi, cos b cosh b = -1,
-- of mass m and with integral x phi m dx / L = 2 m L / b^2. So mode i takes 2 L / b^2 of the rate w, and 12 / b^4 of the energy, which all of them keep.
local sat = vehicle "vehicle.yaml"
local L, E, rho, w = 4, 70e9, 2700, 0.01
local A, I = math.pi * (0.04 ^ 2 - 0.039 ^ 2), math.pi / 4 * (0.04 ^ 4 - 0.039 ^ 4)
mission { duration = "1 s", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "100 Hz" } }
local wing, modes = sat:hinge "wing", sat:modes "wing"
local caught = persist { t = 0 }
event { name = "caught", direction = "rising", once = true, when = function() return wing:angle() end, action = function() caught.t = mission.time() sat:lock "wing" end }

local tip, share = 0, 0
for i = 1, 5 do                                                             -- in each plane, of the twelve with the first of torsion and length
  local low, high = (i - 1) * math.pi, i * math.pi                          -- one root in each half turn
  for _ = 1, 60 do
    local b = (low + high) / 2
    if (math.cos(b) + 2 / (math.exp(b) + math.exp(-b))) * (i % 2 == 1 and 1 or -1) > 0 then low = b else high = b end
  end
  local rate = (low / L) ^ 2 * math.sqrt(E * I / (rho * A))
  tip = tip + (i % 2 == 1 and 2 or -2) * 2 * L / low ^ 2 * w / rate * math.sin(rate * 0.8)
  share = share + 12 / low ^ 4
end
local function energy()
  local sum = 0
  for i = 1, modes:count() do sum = sum + (modes:etadot(i) ^ 2 + (2 * math.pi * modes:frequency(i) * modes:eta(i)) ^ 2) / 2 end
  return sum
end
check { name = "caught at", unit = "s", value = function() return caught.t end, equal = { 0.2, tolerance = 1e-9 } }
check { name = "tip", unit = "m", value = function() return (select(2, sat:node("wing.tip"):position())) end, equal = { tip, tolerance = 1e-8 } }
check { name = "share of the energy", unit = "1", value = function() return energy() / (rho * A * L ^ 3 / 6 * w ^ 2) end, equal = { share, tolerance = 1e-6 } }
