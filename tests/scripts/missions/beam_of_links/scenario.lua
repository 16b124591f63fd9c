-- The elastic beam of Hairer & Wanner (1996, IV.10): forty links of 1/40, clamped, that a force of 1.5 sin^2 t bends at the end until t = pi, up and back.
-- Angles of the first links at t = 5 are those of the Test Set for IVP Solvers.
device {
  type = "lua/push", in_step = true, mounts = { at = "node" },
  evaluate = function(a)
    local f, R = a.t < math.pi and 1.5 * math.sin(a.t) ^ 2 or 0, a.at.R
    return { at = { force = { f * (R[4] - R[1]), f * (R[5] - R[2]), f * (R[6] - R[3]) } } }
  end,
}
local sat = vehicle "vehicle.yaml"
mission { duration = "5 s", integrator = { method = "dopri5", relative = 1e-8 }, output = { rate = "1 Hz" } }
for n, angle in ipairs { -0.5792366591285007e-2, -0.1695298550721735e-1, -0.2769103312973094e-1 } do
  check {
    name = "link " .. n, unit = "rad", equal = { angle, tolerance = 1e-9 },
    value = function()
      local sum = 0
      for i = 1, n do sum = sum + sat:hinge("link" .. i):angle() end
      return sum
    end,
  }
end
