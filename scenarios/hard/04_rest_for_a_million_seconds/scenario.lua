-- Nothing acts, nothing moves, for twelve days: to the last bit, and in next to no steps.

local sat = vehicle "vehicle.yaml"
local bus = sat:body "bus"
mission {
  title = "rest for a million seconds",
  duration = 1e6,
  integrator = { method = "exponential", relative = 1e-9 },
  output = { period = 1e4 },
}
local start = persist { attitude = nil }
controller { name = "first", period = 1e6, step = function(t) if t == 0 then start.attitude = { bus:attitude() } end end }
local function moved()
  local q, sum = { bus:attitude() }, 0
  for i = 1, 4 do sum = sum + math.abs(q[i] - start.attitude[i]) end
  return sum + vec.norm { bus:rate() } + vec.norm { bus:velocity() } + vec.norm { bus:position() } + math.abs(sat:hinge("panel"):rate())
end
check { name = "has moved", value = moved, equal = { 0, tolerance = 0 } }
