-- A panel swings out by its spring until it passes zero, where a latch would catch it. What is not known before the flight is drawn anew in
-- every run. README.md has the formulas.

local p = parameters {
  stiffness = { "0.4 N m/rad", normal = "0.02 N m/rad", within = "0.05 N m/rad" },   -- of the spring, inspected
  inertia = { "3.3 kg m^2", normal = "0.1 kg m^2" },                                 -- of the panel about its middle, across the swing
  stowed = { "90 deg", uniform = "3 deg" },                                          -- where its clamps leave it: 87 to 93 deg
  slowest = "9.5 s",
  fastest = "0.29 rad/s",
}

local sat = vehicle("vehicle.yaml", {
  ["bodies.panel.hinge.spring.stiffness"] = p.stiffness,
  ["bodies.panel.inertia"] = { 2.1, p.inertia, 4.8 },
  ["bodies.panel.hinge.initial.angle"] = p.stowed,
})
local panel = sat:hinge "panel"

mission { title = "a deployment by chance", duration = "60 s", integrator = { relative = 1e-11 }, output = { rate = "2 Hz" } }

local out = persist { t = 0, rate = 0 }
event { name = "out", when = function() return panel:angle() end, direction = "falling", once = true,
        action = function(t) out.t, out.rate = t, -panel:rate(); stop() end }

-- Without friction I a'' + k a = 0.
local w = math.sqrt(p.stiffness / (12 * 0.9 ^ 2 + p.inertia))
check { name = "time against its formula", unit = "s", value = function() return math.abs(out.t - math.pi / (2 * w)) end, below = 1e-8 }
check { name = "rate against its formula", unit = "rad/s", value = function() return math.abs(out.rate - w * p.stowed) end, below = 1e-10 }
check { name = "out in time", unit = "s", value = function() return out.t end, below = p.slowest }
check { name = "rate at the latch", unit = "rad/s", value = function() return out.rate end, below = p.fastest }
figure { name = "energy that the latch takes", unit = "J", value = function() return 0.5 * p.stiffness * p.stowed ^ 2 end }
