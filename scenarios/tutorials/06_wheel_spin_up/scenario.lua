-- A motor spins a wheel up on a satellite that turns slowly about another axis: what the wheel takes up of angular momentum the bus gives,
-- and the growing momentum turns the transverse rate. The wheel is a body on a hinge in one satellite, a device in the other.

local p = parameters { torque = "0.05 N m", spin_up = "20 s" }
local A = 14 + 0.03 + 80 * 5 / 85 * 0.4 ^ 2     -- [kg m^2] across the axis, all together, about the common mass centre
local C, Jw = 9, 0.05                             -- [kg m^2] about the axis: the bus alone, the wheel
local across, along = 0.02, 0.01                  -- [rad/s] at the start, as in vehicle.yaml

local sat = vehicle "vehicle.yaml"
local bus, carrier, wheel, rotor = sat:body "bus", sat:body "carrier", sat:hinge "wheel", sat:device "rotor"

mission {
  title = "a wheel is spun up on a satellite that turns",
  duration = p.spin_up + 10,
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { rate = "10 Hz" },
}

-- README.md: rate of the bus about the axis, phase of the transverse rate, rate of the wheel in the bus.
local function truth(t)
  local on = math.min(t, p.spin_up)
  local h = (C + Jw) * along                      -- about the axis; nobody changes it
  local about = along - p.torque / C * on
  local phase = (h / A - along) * t + p.torque / C * (0.5 * on ^ 2 + on * (t - on))
  return { across * math.cos(phase), across * math.sin(phase), about }, p.torque * on * (1 / Jw + 1 / C)
end

local log = signals { ["truth/rate"] = { unit = "rad/s", components = { "wx", "wy", "wz" }, meaning = "rate of the bus by the closed form" } }
local worst = persist { body = 0, device = 0, wheel = 0, rotor = 0, momentum = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays

local start = vector { across * A, 0, along * (C + Jw) }   -- [N m s] world axes
controller {
  name = "motor", rate = "10 Hz",
  step = function(t)
    local w, spin = truth(t)
    log["truth/rate"](w[1], w[2], w[3])
    see("body", vec.norm(vec.sub({ bus:rate() }, w)))
    see("device", vec.norm(vec.sub({ carrier:rate() }, w)))
    see("wheel", math.abs(wheel:rate() - spin))
    see("rotor", math.abs(rotor:get "rate" - spin))
    local now = { bus:rate() }
    local H = quat.rotate({ bus:attitude() }, { A * now[1], A * now[2], C * now[3] + Jw * (now[3] + wheel:rate()) })
    see("momentum", (vector(H) - start):norm())
    local torque = t < p.spin_up and p.torque or 0
    wheel:torque(torque)
    rotor:set("torque", torque)
  end,
}

-- Steps of 1e-11, rates of the bus of 0.1, of the wheel of 20 rad/s.
check { name = "rate of the bus, wheel as a body", unit = "rad/s", value = function() return worst.body end, below = 1e-10 }
check { name = "rate of the bus, wheel as a device", unit = "rad/s", value = function() return worst.device end, below = 1e-10 }
check { name = "rate of the wheel as a body", unit = "rad/s", value = function() return worst.wheel end, below = 1e-8 }
check { name = "rate of the wheel as a device", unit = "rad/s", value = function() return worst.rotor end, below = 1e-8 }
check { name = "angular momentum stands still in the world", unit = "N m s", value = function() return worst.momentum end, below = 1e-9 }
figure { name = "rate of the wheel at the end", unit = "rpm", value = function() return wheel:rate() * 30 / math.pi end }
