-- A universal joint between two shafts of 1e6 and 2e6 kg m2 whose cross has 1e-6 kg m2: all that one shaft has of the other passes through it.

local sat = vehicle "vehicle.yaml"
local shaft, cross = sat:hinge "shaft_1", sat:hinge "cross"
local second = sat:body "shaft_2"
local J1, J2, bend = 1e6, 2e6, math.rad(40)           -- as in vehicle.yaml, SI; the angle between the shafts

-- Rate of the second shaft over that of the first at its angle a; the rate of the first follows from the energy.
local function ratio(a) return math.cos(bend) / (1 - (math.sin(bend) * math.cos(a)) ^ 2) end
local energy = J1 + J2 * ratio(0.3) ^ 2               -- twice, at 1 rad/s
local function rate(a) return math.sqrt(energy / (J1 + J2 * ratio(a) ^ 2)) end
local turn, n = 0, 400                                -- [s]; of a smooth periodic function the trapezoidal rule has all digits
for i = 1, n do turn = turn + 2 * math.pi / n / rate(2 * math.pi * i / n) end

mission {
  title = "heavy shafts and a light cross",
  duration = 50 * turn,
  integrator = { method = "dop853", relative = 1e-12 },
  output = { rate = "5 Hz" },
}
local worst = persist { first = 0, second = 0, cross = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", rate = "5 Hz",
  step = function(t)
    local a, w = shaft:angle(), shaft:rate()
    local x, y, z = second:rate()
    see("first", math.abs(w / rate(a) - 1))
    see("second", vec.norm { x, y, z - ratio(a) * rate(a) })
    -- The second axis of the cross is square to the second shaft: tan of its angle is tan(bend) sin a.
    see("cross", math.abs(math.tan(cross:angle()) - math.tan(bend) * math.sin(a)))
  end,
}
figure { name = "a turn of the first shaft", unit = "s", value = function() return turn end }
-- Some 3600 steps of 1e-12 of the rates, in the same sense: 4e-9, and 270 s later 1e-6 rad. Loops are closed to round-off.
check { name = "rate of the first shaft by its angle, relative", value = function() return worst.first end, below = 1e-8 }
check { name = "rate of the second", unit = "rad/s", value = function() return worst.second end, below = 1e-8 }
check { name = "angle of the cross, as a tangent", value = function() return worst.cross end, below = 1e-12 }
check { name = "first shaft after fifty turns", unit = "rad", value = function() return shaft:angle() - 0.3 - 100 * math.pi end, equal = { 0, tolerance = 1e-6 } }
