-- A rotor of 1e5 rad/s on a bus that turns at 1e-3 rad/s: the bus nutates at h / J_t = 11.1 rad/s, and the rotor turns 1e8 rad meanwhile.

local sat = vehicle "vehicle.yaml"
local body, rotor = sat:body "bus", sat:hinge "rotor"
local J_t, J_r, spin, w0 = 900.06, 0.1, 1e5, 1e-3   -- of both about a transverse axis; of the rotor about its own
local nutation = J_r * spin / J_t                    -- [rad/s]: the bus does not turn about z

mission {
  title = "nutation beside a rotor of 1e5 rad/s",
  duration = 1000,
  integrator = { method = "dop853", relative = 1e-12, absolute = 1e-15 },
  output = { rate = "5 Hz" },
}

local worst = persist { rate = 0, axial = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", rate = "5 Hz",
  step = function(t)
    local x, y, z = body:rate()
    see("rate", math.sqrt((x - w0 * math.cos(nutation * t)) ^ 2 + (y - w0 * math.sin(nutation * t)) ^ 2) / w0)
    see("axial", math.abs(z))
  end,
}
figure { name = "rate of nutation", unit = "rad/s", value = function() return nutation end }
-- 1e4 rad of nutation in some 1e4 steps, each of 1e-12 of 1e-3 rad/s: hence `absolute`.
check { name = "rates of the bus, over the largest", value = function() return worst.rate end, below = 1e-7 }
check { name = "rate about the axis of the rotor", unit = "rad/s", value = function() return worst.axial end, below = 1e-12 }
check { name = "speed of the rotor", unit = "rad/s", value = function() return rotor:rate() end, equal = { spin, tolerance = 1e-6 } }
