-- Gains from the vehicle that they steer: a motor turns a hub by 30 deg and holds it, while a boom swings on its spring. What is measured is
-- the angle of the hub, ten times a second; a filter tells the rest, a regulator commands the torque. Both are designed here, by the linear
-- model of the vehicle at rest.

local p = parameters { target = "30 deg", angle_weight = 10, torque_weight = 1e-4, disturbance = 0.01, angle_noise = 1e-8 }

local sat = vehicle "vehicle.yaml"
local hub, boom = sat:hinge "hub", sat:hinge "boom"
local rate = 10                                                   -- [Hz]

mission {
  title = "a regulator and a filter by the linear model",
  duration = "20 s",
  integrator = { method = "dop853", relative = 1e-12 },
  output = { rate = rate },
}

local plant = sat:linearize { inputs = { "hub.angle" }, outputs = { "hub.angle" } }
local Ad, Bd, Wd = control.discretise(plant.A, plant.B, 1 / rate, { 0, 0, p.disturbance, p.disturbance })
local K = control.dlqr(Ad, Bd, { p.angle_weight, p.angle_weight, 1, 1 }, p.torque_weight)   -- hub and boom: angles, then rates
local L = control.dkalman(Ad, plant.C, Wd, p.angle_noise)

local m = persist { z = { -p.target, 0, 0, 0 } }                  -- what the filter has for the next tick, from the target on
local log = signals {
  ["filter/error"] = { unit = "rad", components = { "hub", "boom" }, meaning = "angles of the filter less those of the vehicle" },
  ["motor/torque"] = { unit = "N m" },
}
controller {
  name = "regulator", rate = rate,
  step = function()
    local z = vector(m.z)
    z = z + L * (vector { hub:angle() - p.target } - plant.C * z)
    local u = -1 * (K * z)
    hub:torque(u[1])
    log["filter/error"](z[1] + p.target - hub:angle(), z[2] - boom:angle())
    log["motor/torque"](u[1])
    m.z = (Ad * z + Bd * u):table()
  end,
}

local closed = control.poles(Ad - Bd * K, 1 / rate)
figure { name = "damping of the swing, as it is", value = function() return plant.poles[4].damping end }
figure { name = "damping of the swing, in the loop", value = function() return closed[1].damping end }
figure { name = "frequency of the swing, in the loop", unit = "Hz", value = function() return closed[1].frequency end }
check { name = "it is there", unit = "rad", value = function() return math.abs(hub:angle() - p.target) end, below = 1e-4 }
check { name = "it stands still", unit = "rad/s", value = function() return math.max(math.abs(hub:rate()), math.abs(boom:rate())) end, below = 1e-4 }
