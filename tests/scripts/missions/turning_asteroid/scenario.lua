-- What holds is asked for in the gravity of the instant: beside a body whose equator is an ellipse, degree 2 and order 2 with C = 0.1 [Kaula 1966], and which turns by 0.1 rad/s, the pull across is
-- 6 C mu R^2 / r^4 sin 2 w t = 0.0375 sin 0.2 t, and passes 0.01875 N of friction at pi / 1.2 s.
local sat = vehicle "vehicle.yaml"
mission { duration = "3 s", output = { rate = "1 Hz" } }
local m = persist { begins = 0 }
sequence { name = "waits", run = function()
  wait_until(function() return sat:hinge("m"):v() - 1e-12 end, { direction = "rising" })
  m.begins = mission.time()
end }
-- 1e-12 m/s at 0.0375 0.2 cos(pi / 6) m/s^3 is 1.8e-5 s later.
check { name = "begins to slide", unit = "s", value = function() return m.begins end, equal = { math.pi / 1.2, tolerance = 2.5e-5 } }
