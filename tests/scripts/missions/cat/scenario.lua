-- The falling cat [Kane & Scher 1969]: two round halves bent by 2 gamma, whose bend goes once round them and never twists, without angular momentum.
-- Their middle frame turns about the middle of their axes by W while the bend goes round by nu, where
--   I_t W sin^2 gamma + I_a (W cos gamma - nu) cos gamma = 0,
-- and W = nu / 2, half a turn for each round, where (1 - k) cos^2 gamma + 2 k cos gamma = 1, k = I_a / I_t.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", integrator = { method = "dop853", relative = 1e-12 } }
local k = 0.01 / 0.03
local c = (math.sqrt(k * k + 1 - k) - k) / (1 - k)
local gamma, s = math.acos(c), math.sqrt(1 - c * c)
local nu = 2 * math.pi
local W = nu / 2
local rear = sat:hinge "rear"
rear:profile { component = 1, sine = { amplitude = 2 * gamma, frequency = "1 Hz", phase = math.pi / 2 } }
rear:profile { component = 2, sine = { amplitude = 2 * gamma, frequency = "1 Hz" } }
initial { rear = { tilt_1 = 2 * gamma, rate_2 = 2 * gamma * nu }, front = { angular_velocity = { 0, -W * s, W * c - nu } } }
-- Half a turn about the middle of the two axes, (0, -s, c) at the start: the quaternion (0, 0, -s, c) of one sign or the other.
local function off()
  local q = { sat:body "front":attitude() }
  local sign = q[4] < 0 and -1 or 1
  return vec.norm { q[1], q[2], vec.norm { q[3] + sign * s, q[4] - sign * c, 0 } }
end
check { name = "lands on its feet", below = 1e-10, value = off }
