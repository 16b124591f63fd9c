-- A telescope stands on six struts with soft springs on a free satellite. A wheel with a small unbalance runs up through the modes of this suspension to
-- 3000 rpm: below them the telescope follows the bus, above it is left in peace. What the motor of the wheel does turns the bus; nothing acts from
-- outside. The loops are closed inside of the sweeps.

local p = parameters { speed = "3000 rpm", run_up = "16 s", finish = "20 s" }

local sat = vehicle "vehicle.yaml"
local bus, telescope, wheel = sat:body "bus", sat:body "telescope", sat:hinge "wheel"
local foot, mirror = sat:node "bus", sat:node "telescope.mirror"

mission {
  title = "six struts keep the unbalance of a wheel from a telescope",
  duration = p.finish,
  integrator = { method = "dop853", relative = 1e-10 },
  output = { rate = "20 Hz", nodes = { "telescope.mirror" } },
}

wheel:profile { rate_table = { { 0, 0 }, { p.run_up, p.speed } } }

-- Roots of the mean square of what shakes both, after the run-up.
local m = persist { n = 0, bus = 0.0, mirror = 0.0, most = 0.0, at = 0.0 }
controller {
  name = "accelerometers", rate = "1 kHz",
  step = function(t)
    local mirror_shakes = vec.norm { mirror:acceleration() }
    if t < p.run_up then
      if mirror_shakes > m.most then m.most, m.at = mirror_shakes, t end
      return
    end
    m.n = m.n + 1
    m.bus = m.bus + vec.norm { foot:acceleration() } ^ 2
    m.mirror = m.mirror + mirror_shakes ^ 2
  end,
}

figure { name = "bus shakes with", unit = "m/s^2", value = function() return (m.bus / m.n) ^ 0.5 end }
figure { name = "mirror shakes with", unit = "m/s^2", value = function() return (m.mirror / m.n) ^ 0.5 end }
figure { name = "wheel at the resonance that shook it most", unit = "Hz", value = function() return m.at / p.run_up * p.speed / (2 * math.pi) end }
check { name = "isolation", unit = "1", value = function() return (m.mirror / m.bus) ^ 0.5 end, below = 0.15 }
