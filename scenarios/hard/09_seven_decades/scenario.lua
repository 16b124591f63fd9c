-- Seven masses on springs, each of its own frequency, from 0.01 Hz to 10 kHz in one body: all of them swing for a hundred seconds, the fastest a million times.

local sat = vehicle "vehicle.yaml"
local comb = sat:modes "comb"
local w, eta_0, start = {}, {}, 1e-3                  -- [rad/s], [-], the largest rate of each [1/s]
for j = 1, 7 do
  w[j] = 2 * math.pi * 10 ^ (j - 3)
  eta_0[j] = start / w[j]
end
initial { comb = { eta = eta_0 } }
mission {
  title = "seven decades of frequency in one body",
  duration = 100,
  integrator = { method = "exponential", relative = 1e-9 },
  output = { period = 1 },
  ledger = false,                                     -- the wall's impulse is integrated through three places of a step of 3000 swings
}

local worst = persist { amplitude = 0, rate = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", rate = "1.7 Hz",
  step = function(t)
    for j = 1, 7 do
      see("amplitude", math.abs(comb:eta(j) / eta_0[j] - math.cos(w[j] * t)))
      see("rate", math.abs(comb:etadot(j) / start + math.sin(w[j] * t)))
    end
  end,
}
-- A phase of 6e6 rad, and the time that it is made of, have a last bit of 1e-9 rad: 450 steps add as many of them at random, 2e-8.
check { name = "modal coordinates, over their amplitudes", value = function() return worst.amplitude end, below = 1e-7 }
check { name = "modal rates, over theirs", value = function() return worst.rate end, below = 1e-7 }
