-- A cantilever swings in its lowest mode: frequency and decay are known.
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = "cvode_bdf", relative = 1e-9 }, output = { rate = "100 Hz", nodes = { "boom.tip" } } }
initial { boom = { eta = { "0.1", 0, 0, 0 } } }
local modes, tip = sat:modes "boom", sat:node "boom.tip"
local log = signals { ["boom/tip"] = { unit = "m", frame = "world", meaning = "deflection of the tip, z" } }
controller { name = "log", rate = "100 Hz", step = function() log["boom/tip"](select(3, tip:position())) end }

-- (1.875104 / L)^2 sqrt(E I / (rho A)) for the 2 cm side (Euler-Bernoulli); meshes of 40 elements are exact to 1e-6.
local omega = (1.8751040687 / 4) ^ 2 * math.sqrt(70e9 * 0.02 ^ 2 / (12 * 2700))
check { name = "number of modes", value = function() return modes:count() end, equal = { 4 } }
check { name = "frequency", unit = "Hz", value = function() return modes:frequency(1) end, equal = { omega / (2 * math.pi), tolerance = 1e-5 } }
local damped = omega * math.sqrt(1 - 1e-6)
check {
  name = "amplitude at the end",
  value = function() return modes:eta(1) end,
  equal = { 0.1 * math.exp(-0.001 * omega * 2) * (math.cos(damped * 2) + 0.001 * math.sin(damped * 2)), tolerance = 1e-5 },
}
check { name = "rate of the others", value = function() return math.abs(modes:etadot(2)) + math.abs(modes:etadot(3)) end, below = 1e-6 }
