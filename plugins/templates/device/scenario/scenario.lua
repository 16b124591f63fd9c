-- Nothing cools the coils: what the rotation loses is in them.
plugin "@NAME@.so"
local sat = vehicle "vehicle.yaml"
local bus, brake = sat:body "bus", sat:device "brake"
mission { duration = "20 s", integrator = { relative = 1e-10 } }
initial { bus = { angular_velocity = { 0, 0.3, 0.4 } } }

local function rotation() return 0.5 * 20 * vec.norm { bus:rate() } ^ 2 end
check { name = "the brake has braked", unit = "J", value = rotation, below = 1.5 }
check {
  name = "the energy is in the coils", unit = "J", below = 1e-6,
  value = function() return math.abs(rotation() + 0.05 * brake:get "warmth" - 0.5 * 20 * 0.5 ^ 2) end,
}
