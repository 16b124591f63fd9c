-- A joint of 1e9 N m/rad, which swings at 528 Hz, on a vehicle that a motor turns slowly. The swing has no damping: it must neither grow nor die.

local p = parameters { torque = "2 N m" }
local sat = vehicle "vehicle.yaml"
local bus, tower = sat:hinge "bus", sat:hinge "tower"
local J1, J2, k, a0 = 1000, 100, 1e9, 1e-6           -- as in vehicle.yaml; rotors about their common axis
local w = math.sqrt(k * (1 / J1 + 1 / J2))

mission {
  title = "a stiff joint on a slow vehicle",
  duration = 20,
  integrator = { method = "dop853", relative = 1e-12, absolute = 1e-16 },
  output = { period = 0.1 },
}
bus:torque(p.torque)

-- Relative angle: a = a_s + (a0 - a_s) cos w t, a_s where the spring carries its share of the torque; mean angle by the whole inertia.
local a_s = -p.torque * J2 / ((J1 + J2) * k)
local worst = persist { joint = 0, mean = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
controller {
  name = "comparison", period = 0.1,
  step = function(t)
    see("joint", math.abs(tower:angle() - (a_s + (a0 - a_s) * math.cos(w * t))) / a0)
    local mean = (J1 * bus:angle() + J2 * (bus:angle() + tower:angle())) / (J1 + J2)
    see("mean", math.abs(mean - J2 * a0 / (J1 + J2) - 0.5 * p.torque / (J1 + J2) * t * t))
  end,
}
figure { name = "frequency of the joint", unit = "Hz", value = function() return w / (2 * math.pi) end }
-- 66,000 rad of phase in some 3e5 steps, each of 1e-12 of an amplitude of 1e-6 rad (hence `absolute`) and 3e-3 rad/s.
check { name = "joint, over its amplitude", value = function() return worst.joint end, below = 1e-6 }
check { name = "mean angle", unit = "rad", value = function() return worst.mean end, below = 1e-12 }
