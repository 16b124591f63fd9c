-- A damper stops a wheel: its rate runs through all doubles down to the smallest ones. Beside it a mote of 1e-300 kg m2 swings as if it were of 1 kg m2.

local sat = vehicle "vehicle.yaml"
local wheel, mote = sat:hinge "wheel", sat:hinge "mote"
mission {
  title = "down to the smallest numbers",
  duration = 800,
  integrator = { method = "dop853", relative = 1e-12, absolute = 1e-310 },
  output = { period = 5 },
}

local worst = persist { decay = 0, late = 0, swing = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", period = 5,
  step = function(t)
    if t <= 700 then see("decay", math.abs(wheel:rate() / math.exp(-t) - 1)) end
    if t >= 750 then see("late", math.abs(wheel:rate())) end
    see("swing", math.abs(mote:angle() - math.cos(t)))
  end,
}
-- Some 5000 steps of 1e-12, of a rate that falls by e^-700: all of them count as much as the first.
check { name = "rate, relative, down to 1e-304 rad/s", value = function() return worst.decay end, below = 5e-9 }
-- e^-750 is a tenth of 5e-324, the smallest double: of the last few of them h v' rounds to nothing, and they stay.
check { name = "rate in the end", unit = "rad/s", value = function() return worst.late end, below = 1e-322 }
check { name = "swing of the mote", unit = "rad", value = function() return worst.swing end, below = 5e-9 }
