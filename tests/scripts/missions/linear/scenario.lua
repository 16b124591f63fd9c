-- The linear model of a pendulum, before the run at 60 degrees and at rest, in the run at the lowest point, against the closed form.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", integrator = { method = "dopri5", relative = 1e-10 } }
local J, mgc, c = 0.7, 2 * 9.81 * 0.5, 0.3

local function near(name, x, expected) check { name = name, value = function() return x end, equal = { expected, tolerance = 1e-12 } } end
local all = sat:linearize()
near("states", #all.A, 2)
near("slope", all.A[2][1], -mgc * math.cos(math.pi / 3) / J)
near("damping", all.A[2][2], -c / J)
near("force", all.B[2][1], 1 / J)
near("drift", all.drift[2], -mgc * math.sin(math.pi / 3) / J)
near("product of the poles", all.poles[1].re ^ 2 + all.poles[1].im ^ 2, mgc * math.cos(math.pi / 3) / J)
near("names", all.state_names[1] == "rod.angle" and all.state_units[2] == "rad/s" and all.input_names[1] == "rod.angle" and 1 or 0, 1)

-- a push on the end in node x, one metre below; what is seen there
local ports = sat:linearize { inputs = { "rod.end:force.x" }, outputs = { "rod.angle", "rod.end:acceleration.x", "rod.end:attitude.y" } }
near("push", ports.B[2][1], -1 / J)
near("angle", ports.C[1][1], 1)
near("acceleration", ports.D[2][1], math.cos(math.pi / 3) / J)
near("attitude", ports.C[3][1], 1)

local stiffness, time
local rod = sat:hinge "rod"
controller { name = "look", rate = "2 Hz", step = function(t)
  if t == 0.5 then stiffness, time = sat:linearize().A[2][1] + mgc * math.cos(rod:angle()) / J, sat:linearize().t end
end }
check { name = "slope in the run", value = function() return stiffness end, equal = { 0, tolerance = 1e-12 } }
check { name = "time", value = function() return time end, equal = { 0.5, tolerance = 0 } }
