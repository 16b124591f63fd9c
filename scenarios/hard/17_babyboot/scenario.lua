-- Kane's "babyboot": a plate turns about a rod that swings. Let go from the horizontal it is chaotic.

local sat = vehicle "vehicle.yaml"
local rod, plate = sat:hinge "rod", sat:hinge "plate"
local moment = 0.01 * 0.075 + 0.1 * 0.2                             -- first moment about the axis of the swing [kg m], as in vehicle.yaml
local swung = 5e-6 + 0.01 * 0.075 ^ 2 + 0.1 * 0.2 ^ 2               -- about the axis of the swing but for the plate's own [kg m^2]

mission {
  title = "babyboot, a chaotic pendulum of two bodies",
  duration = 10,
  integrator = { method = "dop853", relative = 1e-13 },
  output = { period = 0.1 },
}
local function energy()
  local q, w, u = plate:angle(), rod:rate(), plate:rate()
  local J = swung + 2.5e-4 * math.cos(q) ^ 2 + 5e-5 * math.sin(q) ^ 2
  return 0.5 * J * w ^ 2 + 0.5 * 2e-4 * u ^ 2 - 9.81 * moment * math.cos(rod:angle())
end
local seen = persist { before = 0, energy = 0 }
controller {
  name = "comparison", period = 0.1,
  step = function(t)
    if t == 0 then seen.before = energy() end
    local e = math.abs(energy() - seen.before)
    if not (e <= seen.energy) then seen.energy = e end               -- a NaN stays
  end,
}
-- At 10 s. In 42 digits: Gragg's method, extrapolated to order 22, on the equations of motion of these two hinges, with 300 and with 450 steps,
-- which agree in 20 digits. Published, in degrees: MotionGenesis (Drake, multibody/benchmarks/chaotic_babyboot).
-- A method adds 1e-13 a step, and what is off grows by some 1e6 in angles, more in the rate of the plate.
local rows = {
  { "swing of the rod", "rad", function() return rod:angle() end, -1.0701134366014188, 1e-7, -61.312983340691 },
  { "turn of the plate", "rad", function() return plate:angle() end, -16.222449647007136, 1e-6, -929.47789677244 },
  { "rate of the rod", "rad/s", function() return rod:rate() end, -6.7440080753737698, 1e-6 },
  { "rate of the plate", "rad/s", function() return plate:rate() end, -2.7795696723106602, 2e-5 },
}
for _, row in ipairs(rows) do
  local name, unit, value, exact, limit, published = table.unpack(row)
  check { name = name, unit = unit, value = function() return math.abs(value() - exact) end, below = limit }
  -- Its four programs differ by 2e-8 of the angles.
  if published then
    check { name = name .. ", as published, relative", value = function() return math.abs(math.deg(value()) / published - 1) end, below = 1e-7 }
  end
end
-- Of 0.2 J, lost in the same sense in 900 steps of 1e-13 each at most.
check { name = "energy", unit = "J", value = function() return seen.energy end, below = 1e-12 }
