local arguments = require "cardan.arguments"
local expect, positive = arguments.expect, arguments.positive

--- Mechanical models of liquid in tanks: pendulums and springs for bodies of a vehicle.
local slosh = {}

-- Zeros of the derivative of the Bessel function J_1.
local zeros = { 1.8411837813406593, 5.3314427735250326, 8.5363163663462858, 11.706004902592064, 14.863588633909033 }

---@class CylinderOptions
---@field radius number [m] of the tank
---@field depth number [m] of the liquid at rest
---@field mass number [kg] of the liquid
---@field acceleration? number [m/s^2] of the tank, or gravity; 0, the default: the rates are 0, lengths do not depend on it
---@field modes? integer 1, the default, to 5

---@class SloshMode
---@field mass number [kg] of the pendulum, or at the spring
---@field length number [m] of the pendulum
---@field pivot number [m] of the pendulum, above the bottom of the tank
---@field height number [m] of its mass at rest, or of the one at the spring, above the bottom of the tank
---@field rate number [rad/s] of small swings of the pendulum in a tank that gives no way
---@field stiffness number [N/m] of the spring

---@class SloshModel
---@field modes SloshMode[]
---@field fixed_mass number [kg] that moves with the tank
---@field fixed_height number [m] of that, above the bottom: the mass centre at rest is the liquid's

--- Liquid in an upright cylinder with a flat bottom, swinging sideways: w^2 = (g/R) x tanh(x h/R), m = M 2 tanh(x h/R) / ((h/R) x (x^2 - 1)),
--- length g/w^2 [Abramson 1966, NASA SP-106], the pivot where the force on the tank acts, h - (R/x) (cosh(x h/R) - 2) / sinh(x h/R).
---@param options CylinderOptions
---@return SloshModel model
function slosh.cylinder(options)
  arguments.expect_keys("slosh.cylinder", options, "radius depth mass acceleration modes")
  for _, key in ipairs { "radius", "depth", "mass" } do expect(positive(options[key]), "slosh.cylinder", key .. " > 0", options[key]) end
  local R, h, M = options.radius, options.depth, options.mass
  local g, n = options.acceleration or 0, options.modes or 1
  expect(g == 0 or positive(g), "slosh.cylinder", "acceleration >= 0", g)
  expect(math.type(n) == "integer" and n >= 1 and n <= #zeros, "slosh.cylinder", "1 to " .. #zeros .. " modes", n)
  local model = { modes = {}, fixed_mass = M, fixed_height = 0 }
  local moment = M * h / 2 -- about the bottom
  for k = 1, n do
    local x = zeros[k]
    local a = x * h / R
    local e = math.exp(-2 * a) -- of a deep tank cosh and sinh overflow
    local tanh = -(e - 1) / (1 + e)
    if a < 1e-3 then tanh = a * (1 - a * a / 3) end -- without the difference: a^4 / 7 is left out
    local m, length = 2 * M * tanh * R / (h * x * (x * x - 1)), R / (x * tanh)
    local rate = math.sqrt(g / length)
    local pivot = h - R / x * ((1 + e) - 4 * math.exp(-a)) / (1 - e)
    local mode = { mass = m, length = length, pivot = pivot, height = pivot - length, rate = rate, stiffness = m * rate * rate }
    model.modes[k] = mode
    model.fixed_mass, moment = model.fixed_mass - m, moment - m * mode.height
  end
  model.fixed_height = moment / model.fixed_mass
  return model
end

return slosh
