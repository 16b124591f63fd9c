-- What hangs at rest is pulled by nothing but rounding, and the dense twin, which rounds elsewhere, says so too.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", output = { rate = "5 Hz" } }
for _, name in ipairs { "one", "two", "wire" } do
  check { name = name .. " stays", unit = "rad/s", value = function() return math.abs(sat:hinge(name):rate()) end, below = 1e-12 }
end
