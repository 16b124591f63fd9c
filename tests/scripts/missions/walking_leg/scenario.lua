-- A leg of Theo Jansen's beasts, three loops on one crank: each joint is where two circles meet.
local sat = vehicle "vehicle.yaml"
mission { duration = "6.4 s", output = { rate = "10 Hz" } }

-- Of the two places at the distances p from P and q from Q the one on the left of the way from P to Q.
local function meet(P, p, Q, q)
  local x, y = Q[1] - P[1], Q[2] - P[2]
  local d = math.sqrt(x ^ 2 + y ^ 2)
  local along = (p ^ 2 - q ^ 2 + d ^ 2) / (2 * d)
  local off = math.sqrt(p ^ 2 - along ^ 2)
  return { P[1] + (along * x - off * y) / d, P[2] + (along * y + off * x) / d }
end
local function leg(turn)
  local pin, pivot = { 15 * math.cos(turn), 15 * math.sin(turn) }, { -38, -7.8 }
  local up, low = meet(pivot, 41.5, pin, 50), meet(pin, 61.9, pivot, 39.3)
  local left = meet(pivot, 40.1, up, 55.8)
  local knee = meet(low, 36.7, left, 39.4)
  return { knee = knee, foot = meet(low, 49, knee, 65.7) }
end

local crank, worst = sat:hinge "crank", persist { knee = 0, foot = 0 }
local nodes = { knee = sat:node "leg.knee", foot = sat:node "leg.foot" }
controller { name = "look", rate = "10 Hz", step = function()
  local expected = leg(crank:angle())
  for name, node in pairs(nodes) do
    local x, y = node:position()
    worst[name] = math.max(worst[name], math.sqrt((x - expected[name][1]) ^ 2 + (y - expected[name][2]) ^ 2))
  end
end }
-- The crank is given, and loops are closed to rounding: 1e-12 of 100.
for name in pairs(nodes) do check { name = name .. " off its way", unit = "m", value = function() return worst[name] end, below = 1e-10 } end
