-- Propellant that sloshes in an accelerated tank is a pendulum whose gravity is the thrust. Here its pivot is the mass centre of the stage, so
-- that slosh and attitude leave each other alone and the swing is exactly that of a pendulum; then the engine is shut off, and it goes on in a circle.

local p = parameters { angle = "40 deg", burn = "8 s" }
local stage_mass, mass, length, thrust = 400, 60, 0.4, 800         -- as in vehicle.yaml, SI
local w = math.sqrt(thrust / (stage_mass * length))                 -- [rad/s] of small swings: F / M is what the free pendulum feels, not F / (M + m)
local function truth(t)
  local sn, cn, dn = elliptic.jacobi(w * t, math.sin(p.angle / 2) ^ 2)
  local k = math.sin(p.angle / 2)
  return 2 * math.asin(k * cn / dn), -2 * k * w * math.sqrt(1 - k * k) * sn / dn      -- sn/dn: the derivative of cn/dn is -(1 - m) sn/dn^2
end

local sat = vehicle "vehicle.yaml"
local stage, slosh, engine = sat:body "stage", sat:hinge "slosh", sat:device "engine"
initial { slosh = { angle = p.angle } }
mission {
  title = "slosh under thrust",
  duration = p.burn + 4,
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { rate = "50 Hz" },
}

local log = signals { ["truth/angle"] = { unit = "rad", meaning = "of the pendulum by elliptic functions, then on a circle" } }
local m = persist { angle = 0, attitude = 0 }
local function see(name, e) if not (e <= m[name]) then m[name] = e end end   -- a NaN stays
phase { name = "burn", duration = p.burn, enter = function() engine:set("command", 1) end }
phase { name = "coast", enter = function() engine:set("command", 0) end }
controller {
  name = "comparison", rate = "50 Hz",
  step = function(t)
    local angle, rate = truth(math.min(t, p.burn))
    angle = angle + rate * math.max(0, t - p.burn)
    log["truth/angle"](angle)
    see("angle", math.abs(slosh:angle() - angle))
    see("attitude", vec.norm(quat.to_rotation_vector { stage:attitude() }))
  end,
}
check { name = "swing by elliptic functions", unit = "rad", value = function() return m.angle end, below = 1e-8 }
check { name = "stage does not turn", unit = "rad", value = function() return m.attitude end, below = 1e-10 }
check { name = "momentum along the thrust", unit = "N s", equal = { thrust * p.burn, tolerance = 1e-6 },
  value = function()
    local s = sim:operators()
    return s:momentum(sim:v())[6]
  end }
check { name = "propellant used", unit = "kg", value = function() return engine:get "propellant" end, equal = { thrust * p.burn / (300 * 9.80665), tolerance = 1e-9 } }
