-- A slider-crank that is told where the crank is and how fast it turns, and nothing of the rod and the slider: the loop is open by more than a metre.

local sat = vehicle "vehicle.yaml"
local crank, rod, slider = sat:hinge "crank", sat:hinge "rod", sat:hinge "slider"
local r, l, g = 0.4, 1.0, 9.81                       -- as in vehicle.yaml, SI
mission {
  title = "a mechanism that is told half of its start",
  duration = 10,
  integrator = { method = "dop853", relative = 1e-12 },
  output = { period = 0.1 },
}

-- Of the crank's angle a and rate w: angle of the rod to the line of the slider, sin b = r / l sin a; rates of both.
local function truth(a, w)
  local b = math.asin(r / l * math.sin(a))
  local b_rate = r / l * math.cos(a) * w / math.cos(b)
  return { rod = -a - b, rod_rate = -w - b_rate, slider = r * math.cos(a) + l * math.cos(b), slider_rate = -r * math.sin(a) * w - l * math.sin(b) * b_rate }, b, b_rate
end
-- Kinetic and potential energy, as functions of a and w alone. Mass centres: 0.2 m along the crank, 0.5 m along the rod.
local function energy(a, w)
  local x, b, b_rate = truth(a, w)
  local vx, vy = -r * math.sin(a) * w - 0.5 * math.sin(b) * b_rate, 0.5 * r * math.cos(a) * w
  return 0.5 * (0.1 + 3 * 0.2 ^ 2) * w ^ 2 + 0.5 * 2 * (vx ^ 2 + vy ^ 2) + 0.5 * 0.2 * b_rate ^ 2 + 0.5 * 5 * x.slider_rate ^ 2
    + 3 * g * 0.2 * math.sin(a) + 2 * g * 0.5 * r * math.sin(a)
end

local worst = persist { start = 0, closed = 0, energy = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
local energy_0 = energy(0.7, 5)
controller {
  name = "comparison", period = 0.1,
  step = function(t)
    local a, w = crank:angle(), crank:rate()
    local x = truth(a, w)
    local e = math.max(math.abs(math.sin(rod:angle() - x.rod)), math.abs(slider:q() - x.slider),
                       math.abs(rod:rate() - x.rod_rate), math.abs(slider:rate() - x.slider_rate))
    see(t == 0 and "start" or "closed", e)
    see("energy", math.abs(energy(a, w) / energy_0 - 1))
  end,
}
-- The assembler ends where rounding begins: of 1 m and 7 rad/s.
check { name = "rod and slider at the start (rad, m, rad/s, m/s)", value = function() return worst.start end, below = 1e-12 }
check { name = "and later", value = function() return worst.closed end, below = 1e-10 }
-- Some 1e3 steps of 1e-12, and as many projections.
check { name = "energy by the crank alone, relative", value = function() return worst.energy end, below = 1e-9 }
