-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
local rod = sat:hinge "rod"
controller {
  name = "attitude",
  rate = "10 Hz",
  step = function(t)
    if t > 0.25 then rod:torque(0 / 0) end
  end,
}
