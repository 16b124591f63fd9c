-- A stage burns half of its mass. One flies straight: the rocket equation. One spins and nutates: what flows to the nozzle takes angular momentum
-- with it, so that the nutation dies out and the spin about the axis of the nozzle grows. Closed forms for all of it are in README.md.

local dry, loaded, radius, reach = 200, 300, 0.5, 1.5               -- as in vehicle.yaml, SI
local exhaust = 250 * 9.80665
local flow = 2000 / exhaust
local k2 = 0.4 * radius ^ 2                                         -- [m^2] of a full sphere
local function across(m) return 150 + k2 * m end
local function along(m) return 60 + k2 * m end

local sat = vehicle "vehicle.yaml"
local straight, spinning = sat:body "straight", sat:body "spinning"
local tank = sat:device "spinning_tank"
local engines = { sat:device "straight_engine", sat:device "spinning_engine" }

mission {
  title = "rocket equation and jet damping",
  duration = "300 s",
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { rate = "1 Hz" },
}

local function truth(t)
  local m = loaded - flow * t
  local ratio = (dry + loaded) / (dry + m)
  local speed, way = exhaust * math.log(ratio), exhaust * (t - (dry + m) / flow * math.log(ratio))
  local nutation = 0.1 * (across(m) / across(loaded)) ^ ((reach ^ 2 - k2) / k2)
  return speed, way, nutation, 0.5 * along(loaded) / along(m), m
end

local worst = persist { speed = 0, way = 0, nutation = 0, spin = 0, propellant = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
local log = signals {
  ["damping/nutation"] = { unit = "rad/s", meaning = "rate across the axis" },
  ["damping/truth"] = { unit = "rad/s", meaning = "the same by the closed form" },
}
controller {
  name = "comparison", rate = "1 Hz",
  step = function(t)
    for _, engine in ipairs(engines) do engine:set("command", 1) end
    local speed, way, nutation, spin, m = truth(t)
    local _, _, vz = straight:velocity()
    local _, _, z = straight:position()
    local wx, wy, wz = spinning:rate()
    local now = math.sqrt(wx * wx + wy * wy)
    see("speed", math.abs(vz - speed))
    see("way", math.abs(z - way))
    see("nutation", math.abs(now - nutation))
    see("spin", math.abs(wz - spin))
    see("propellant", math.abs(tank:get "mass" - m))
    log["damping/nutation"](now)
    log["damping/truth"](nutation)
  end,
}

figure { name = "part of the nutation that is left", value = function() local _, _, n = truth(300) return n / 0.1 end }
-- 300 s at 1e-11 in each step, speeds of some km/s, places of some 100 km.
check { name = "speed by the rocket equation", unit = "m/s", value = function() return worst.speed end, below = 1e-7 }
check { name = "way by its integral", unit = "m", value = function() return worst.way end, below = 1e-5 }
check { name = "nutation by jet damping", unit = "rad/s", value = function() return worst.nutation end, below = 1e-9 }
check { name = "spin by what is left of the inertia", unit = "rad/s", value = function() return worst.spin end, below = 1e-9 }
check { name = "propellant", unit = "kg", value = function() return worst.propellant end, below = 1e-9 }
