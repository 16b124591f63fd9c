-- Free of torques a body of revolution nutates: the rate across its axis turns in the body by (1 - J_xx / J_yy) times the rate about it.
plugin "@NAME@.so"
local boom = (vehicle "vehicle.yaml"):body "boom"
mission { duration = "20 s", integrator = { relative = 1e-10 } }
local spin, across = math.rad(20), math.rad(5)
initial { boom = { angular_velocity = { spin, across, 0 } } }

local R, r, L = 0.1, 0.098, 2.0
check {
  name = "mass", unit = "kg", below = 1e-9,
  value = function() return math.abs(boom:mass() - math.pi * 2700 * (R ^ 2 - r ^ 2) * L) end,
}
check {
  name = "nutation", unit = "rad/s", below = 1e-7,
  value = function()
    local angle = (1 - 6 * (R ^ 2 + r ^ 2) / (3 * (R ^ 2 + r ^ 2) + L ^ 2)) * spin * mission.time()
    return vec.norm(vec.sub({ boom:rate() }, { spin, across * math.cos(angle), -across * math.sin(angle) }))
  end,
}
