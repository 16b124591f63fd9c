-- A cantilever on a base that is shaken: of the acceleration of the base its tip has (cos b + cosh b) / (1 + cos b cosh b), b^4 = w^2 m L^4 / (E I),
-- and the base is held by the mass m L (cos b sinh b + sin b cosh b) / b / (1 + cos b cosh b).
local sat = vehicle "vehicle.yaml"
local E, I, line, L = 70e9, 0.05 * 0.01 ^ 3 / 12, 2700 * 5e-4, 2
local model = sat:linearize { inputs = { "shaker.rate" }, outputs = { "beam.tip:acceleration.z", "momentum:linear.z" } }
local unit = math.sqrt(E * I / (line * L ^ 4)) / (2 * math.pi)
for _, b in ipairs { 0.5, 1.8, 2, 4, 5, 7 } do
  local cosh, sinh = 0.5 * (math.exp(b) + math.exp(-b)), 0.5 * (math.exp(b) - math.exp(-b))
  local below = 1 + math.cos(b) * cosh
  local gain, phase = control.response(model.A, model.B, model.C, model.D, b ^ 2 * unit)
  -- Interface modes and eight in each plane: 1e-4 up to the third frequency, b = 7.85.
  local tip = (math.cos(b) + cosh) / below
  check { name = ("tip, b = %g"):format(b), value = function() return gain[1][1] * math.cos(phase[1][1]) / tip end, equal = { 1, tolerance = 2e-4 } }
  -- Momentum is force over i w.
  local mass = 10 + line * L * (math.cos(b) * sinh + math.sin(b) * cosh) / b / below
  check { name = ("apparent mass, b = %g"):format(b), unit = "kg", value = function() return gain[2][1] * 2 * math.pi * b ^ 2 * unit * -math.sin(phase[2][1]) end, equal = { mass, tolerance = 2e-4 * math.abs(mass) } }
end
mission { duration = "0.1 s", integrator = { method = "exponential" } }
sat:hinge "shaker":profile { sine = { amplitude = 1e-3, frequency = "2 Hz" } }
