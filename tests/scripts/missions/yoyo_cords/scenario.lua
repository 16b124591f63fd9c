-- Fedor (1961), NASA TN D-708, and Eide, Vaughan (1962), NASA TN D-1012: despin by two masses on cords of finite mass, which are let go
-- where the cords have swung out. While they unwind, at w0, I (w0 - w) = S (w0 + w), with S the sum of m l^2 of what is unwound, l from
-- where it leaves the drum, and I the inertia of all as it was wound; then momentum and energy tell both rates where the cords are radial.
local sat = vehicle "vehicle.yaml"
local N, R, L, w0, tip, bead = 4, 0.5, 3.0, 10.0, 0.3, 0.03
mission { duration = 0.9, integrator = { method = "dop853", relative = 1e-11 }, output = { rate = "50 Hz" } }
local hub, frame, swing = sat:hinge "hub", sat:hinge "frame_a", sat:hinge "tip_a"
local seen = persist { worst = 0, stage = "unwinds" }

local I = 20 + 2 * (tip + N * bead) * R ^ 2
local function from_tip(k) return (k - 0.5) * L / N end
local function unwinding(l)
  local S = 2 * tip * l ^ 2
  for k = 1, N do S = S + 2 * bead * math.max(0, l - from_tip(k)) ^ 2 end
  return w0 * (I - S) / (I + S)
end
controller { name = "looks", rate = "50 Hz", step = function()
  if seen.stage == "unwinds" then seen.worst = math.max(seen.worst, math.abs(hub:rate() - unwinding(R * frame:angle()))) end
end }
local function both(what) what "a" what "b" end
for k = 1, N do  -- a lump leaves the drum as fast as the drum is there
  event { name = "lump " .. k, once = true, direction = "rising", when = function() return R * frame:angle() - from_tip(k) end,
          action = function() both(function(s) sat:attach("bead_" .. s .. k, { to = "tip_" .. s, as_found = true }) end) end }
end
sequence { name = "release", run = function()
  wait_until(function() return R * frame:angle() - L end, { direction = "rising" })
  seen.unwound, seen.rate, seen.stage = mission.time(), hub:rate(), "swings"
  both(function(s)
    sat:open("cord_" .. s)
    sat:attach("tip_" .. s, { to = "hub.end_" .. s, at = "cord", type = "revolute", axis = { 0, 0, 1 } })
  end)
  wait "1 ms"
  wait_until(function() return swing:q() - math.pi / 2 end, { direction = "rising" })
  seen.stage = "gone"
  both(function(s) sat:detach("tip_" .. s) end)
end }

-- Radial: v = R w + l u, u the rate of a cord; momentum a w + b u = I w0, twice the energy A w^2 + 2 B w u + G u^2 = I w0^2.
local first, second = tip * L, tip * L ^ 2
for k = 1, N do first, second = first + bead * (L - from_tip(k)), second + bead * (L - from_tip(k)) ^ 2 end
local a, b, A, B, G, H = I + 2 * first * R, 2 * (first * R + second), I, 2 * first * R, 2 * second, I * w0
local p, q, r = A - 2 * B * a / b + G * (a / b) ^ 2, B * H / b - G * H * a / b ^ 2, G * (H / b) ^ 2 - H * w0
local left = (-q - math.sqrt(q * q - p * r)) / p

check { name = "rate while the cords unwind", unit = "rad/s", value = function() return seen.worst end, below = 1e-7 }
check { name = "time of unwinding", unit = "s", value = function() return seen.unwound end, equal = { L / R / w0, tolerance = 1e-7 } }
check { name = "rate with the cords unwound", unit = "rad/s", value = function() return seen.rate end, equal = { unwinding(L), tolerance = 1e-7 } }
check { name = "rate after the release", unit = "rad/s", value = function() return hub:rate() end, equal = { left, tolerance = 1e-7 } }
