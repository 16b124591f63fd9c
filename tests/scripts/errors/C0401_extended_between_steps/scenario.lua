-- exit: 2
local sat = vehicle "vehicle.yaml"
mission {
  duration = 1, integrator = { method = "extended", relative = 1e-20 },
  output = { rate = "10 Hz", between_steps = true },
}
