-- Machines of which each has a closed form, in one vehicle.
local sat = vehicle "vehicle.yaml"
mission { duration = "4 s", integrator = { method = "dopri5", relative = 1e-11 }, output = { rate = "10 Hz" } }
local g = 9.81
local function is(name, unit, expected, tolerance, value) check { name = name, unit = unit, value = value, equal = { expected, tolerance = tolerance } } end

-- A screw without friction: m g falls, m + I / p^2 moves, p the way of a radian.
local p = 0.05 / (2 * math.pi)
local nut = sat:hinge "nut"
is("angle of the nut", "rad", -0.5 * g * 16 / (1 + 0.02 / (3 * p ^ 2)) / p, 1e-8, function() return nut:angle() end)

-- Between two springs with a way of 6 cm without: half a period at each and twice the way.
local function period(of)
  local seen = persist {}
  event { name = of .. " through the middle", direction = "rising", when = function() return sat:hinge(of):q() end,
          action = function() seen.first, seen.last, seen.n = seen.first or mission.time(), mission.time(), (seen.n or -1) + 1 end }
  return function() return (seen.last - seen.first) / seen.n end
end
is("period between springs", "s", 2 * math.pi * math.sqrt(2 / 800) + 4 * 0.03 / 0.5, 1e-9, period "slider")

-- A motor from rest: L i' = U - R i - k w, J w' = k i.
local R, L, k, J = 2, 0.05, 0.05, 0.002
local root = math.sqrt(R ^ 2 / L ^ 2 / 4 - k ^ 2 / (L * J))
local a, b = -R / L / 2 + root, -R / L / 2 - root
local rotor = sat:hinge "rotor"
is("rate of the motor", "rad/s", 12 / k * (1 - (b * math.exp(4 * a) - a * math.exp(4 * b)) / (b - a)), 1e-7, function() return rotor:rate() end)

-- Above its critical speed the disc whirls by e r^2 / sqrt((1 - r^2)^2 + (2 d r)^2), r = 30 / 20, d = 60 / (2 * 5 * 20) [Jeffcott 1919].
local mounting = sat:hinge "mounting"
is("whirl", "m", 4.999 / 5 * 0.5e-3 * 2.25 / math.sqrt(1.25 ^ 2 + 0.9 ^ 2), 1e-9, function() return math.sqrt(mounting:q "x" ^ 2 + mounting:q "y" ^ 2) end)

-- The gear is alone with its motor until the play is through.
local motor, gear = sat:hinge "motor", sat:hinge "gear"
motor:torque(0.01)
assert(motor:applied() == 0.01)
local touch = persist {}
event { name = "teeth", direction = "rising", once = true, when = function() return gear:angle() - math.rad(0.5) end, action = function() touch.t = mission.time() end }
is("play is through", "s", math.sqrt(2 * math.rad(0.5) * (1e-3 + 100 * 1e-3) / 0.1), 1e-9, function() return touch.t end)

-- The rocker: y cos u + z sin u = c.
local crank, rocker = sat:hinge "crank", sat:hinge "rocker"
local worst = persist { rocker = 0 }
local function angle(turn, near)
  local x, y, z = 0.6 - 0.1 * math.cos(turn), 0.1 - 0.1 * math.sin(turn), 0.2
  local c = (0.8 ^ 2 - x ^ 2 - y ^ 2 - z ^ 2 - 0.5 ^ 2) / (2 * 0.5)
  local middle, half = math.atan(z, y), math.acos(c / math.sqrt(y ^ 2 + z ^ 2))
  local one, other = middle + half - near, middle - half - near
  return math.min(math.abs(one - 2 * math.pi * math.floor(one / (2 * math.pi) + 0.5)), math.abs(other - 2 * math.pi * math.floor(other / (2 * math.pi) + 0.5)))
end
controller { name = "rocker", rate = "10 Hz", step = function() worst.rocker = math.max(worst.rocker, angle(crank:angle(), rocker:angle())) end }
check { name = "rocker", unit = "rad", value = function() return worst.rocker end, below = 1e-9 }

-- Two frequencies of the bob, by [k / M, e / sqrt(M I); ., d / I].
local A, B, C = 2.8 / 0.5, 9.27e-3 / math.sqrt(0.5 * 1e-4), 7.86e-4 / 1e-4
local apart = math.sqrt((A - C) ^ 2 / 4 + B ^ 2)
local function nearest(frequencies, w)
  local best = math.huge
  for i = 1, #frequencies do
    local f = 2 * math.pi * frequencies[i]
    if math.abs(f - w) < math.abs(best - w) then best = f end
  end
  return best
end
local poles, found = sat:linearize({ inputs = {}, outputs = {} }).poles, {}
for i, pole in ipairs(poles) do found[i] = pole.im / (2 * math.pi) end
for i, side in ipairs { -1, 1 } do
  local w = math.sqrt((A + C) / 2 + side * apart)
  is(("Wilberforce %d"):format(i), "rad/s", w, 1e-9, function() return nearest(found, w) end)
end

-- North by the spin: with the horizontal part W of the rate of the earth, ((J s + J W) W - (I_across - I_gimbal along) W^2) / I about the vertical.
local W = 0.5 * math.cos(math.rad(30))
local w = math.sqrt((0.008 * (300 + W) * W - (0.003 + 0.004 - 0.003) * W ^ 2) / (0.003 + 0.004))
is("gyrocompass", "rad/s", w, 1e-9, function() return nearest(found, w) end)
