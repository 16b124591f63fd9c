-- A mission begins in the posture that links on a spinning hub take, and stays there.
local sat = vehicle "vehicle.yaml"
local found = sat:equilibrium { move = { "upper", "lower" } }
assert(found.reached, found.message)
initial(found.initial)
sat:hinge "hub":profile { hold = 2 }

-- There the energy of springs and weights, less that of the spin, has no slope.
local function potential(a, b)
  local function of_link(x, z, slope)
    local across, along = 0.1, 0.01                                     -- [kg m^2] about its centre
    return 9.81 * z - 0.5 * 2 ^ 2 * (x * x + across * math.cos(slope) ^ 2 + along * math.sin(slope) ^ 2)
  end
  local x, z = 1 + math.cos(a), -math.sin(a)                            -- of the tip of the upper link
  return 0.5 * 3 * a * a + of_link(1 + 0.5 * math.cos(a), 0.5 * z, a) + of_link(x + 0.5 * math.cos(a + b), z - 0.5 * math.sin(a + b), a + b)
end
local a, b, h = found.q["upper.angle"], found.q["lower.angle"], 1e-5
local function flat(name, slope) check { name = name, unit = "J/rad", value = function() return slope end, equal = { 0, tolerance = 1e-8 } } end
flat("slope along the upper link", (potential(a + h, b) - potential(a - h, b)) / (2 * h))
flat("slope along the lower link", (potential(a, b + h) - potential(a, b - h)) / (2 * h))

mission { title = "at rest on a spinning hub", duration = "5 s", output = { rate = "10 Hz" } }
local upper, lower = sat:hinge "upper", sat:hinge "lower"
check { name = "the upper link stays", unit = "rad", value = function() return upper:angle() - a end, equal = { 0, tolerance = 1e-12 } }
check { name = "the lower link stays", unit = "rad", value = function() return lower:angle() - b end, equal = { 0, tolerance = 1e-12 } }
