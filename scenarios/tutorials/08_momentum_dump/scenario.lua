-- Wheels that have taken up angular momentum give it away: the coils pull at the magnetic field of Earth against the momentum, the wheels run
-- down so that the satellite does not turn. A coil has no torque along the field, so that this part of the momentum stays.

local p = parameters { time_constant = "600 s", period = "10 s", stiffness = 0.02, damping = 0.9 }

local sat = vehicle "vehicle.yaml"
local radius = 6878.137e3                 -- [m]; a circular orbit, in which the field keeps its size
initial { bus = { position = { radius, 0, 0 }, velocity = { 0, math.sqrt(398600.4418e9 / radius), 0 } } }
local bus, coils = sat:body "bus", sat:device "coils"
local wheels = { sat:device "wheel_x", sat:device "wheel_y", sat:device "wheel_z" }

mission {
  title = "momentum of the wheels is dumped by magnetic coils",
  duration = "3600 s",
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { rate = "0.1 Hz" },
}

local function momentum() return { wheels[1]:get "momentum", wheels[2]:get "momentum", wheels[3]:get "momentum" } end
local start = momentum()                  -- [N m s]
local keep = 1 - p.period / p.time_constant
local log = signals {
  ["dump/torque"] = { unit = "N m", components = { "x", "y", "z" }, meaning = "of the coils on the bus" },
  ["dump/truth"] = { unit = "N m s", components = { "x", "y", "z" }, meaning = "momentum of the wheels by the law of the controller" },
}
local worst = persist { momentum = 0, attitude = 0, ticks = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays

controller {
  name = "dump", period = p.period,
  step = function(t)
    local h = momentum()
    local left = keep ^ worst.ticks         -- each tick takes the same part of what is across the field, which is along z
    worst.ticks = worst.ticks + 1
    local truth = { left * start[1], left * start[2], start[3] }
    see("momentum", vec.norm(vec.sub(h, truth)))
    local error = quat.to_rotation_vector { bus:attitude() }
    see("attitude", vec.norm(error))

    local B = { coils:get "field_x", coils:get "field_y", coils:get "field_z" }          -- [T] axes of the bus
    local wanted = vec.scale(-1 / p.time_constant, h)
    local moment = vec.scale(1 / vec.dot(B, B), vec.cross(B, wanted))                      -- moment x B is wanted, across B
    local torque = vec.cross(moment, B)
    local w = { bus:rate() }
    for i, axis in ipairs { "x", "y", "z" } do
      coils:set("moment_" .. axis, moment[i])
      wheels[i]:set("torque", torque[i] + p.stiffness * error[i] + p.damping * w[i])     -- the wheels take what the coils bring, and hold the attitude
    end
    log["dump/torque"](torque[1], torque[2], torque[3])
    log["dump/truth"](truth[1], truth[2], truth[3])
  end,
}

figure { name = "momentum at the end", unit = "N m s", value = function() return vec.norm(momentum()) end }

-- The recursion is exact while the attitude holds, to the rounding of torques of 1e-3 N m and of a dipole whose axis is z.
check { name = "momentum of the wheels, tick by tick", unit = "N m s", value = function() return worst.momentum end, below = 1e-9 }
check { name = "attitude, largest error", unit = "rad", value = function() return worst.attitude end, below = 1e-9 }
check { name = "momentum along the field stays", unit = "N m s", value = function() return momentum()[3] end, equal = { 0.3, tolerance = 1e-9 } }
-- A dipole of 7.77e15 T m^3, as of Earth: on the equator its field points north.
check { name = "field in the orbit, to the north", unit = "T", value = function() return coils:get "field_z" end,
        equal = { 7.77e15 / radius ^ 3, tolerance = 1e-14 } }
