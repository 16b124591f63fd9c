-- A drive turns as prescribed, and the free bus turns the other way: angular momentum stays zero. The wheel, free on its
-- shaft, does not take part.
local sat = vehicle "vehicle.yaml"
mission { duration = "5 s", integrator = { method = "cvode_adams", relative = 1e-11 }, output = { rate = "10 Hz", reactions = { "drive" } } }
local bus, drive, wheel = sat:body "bus", sat:hinge "drive", sat:hinge "wheel"
drive:profile { rate_table = { { 0, 0 }, { "1 s", "0.3 rad/s" }, { 3, 0.3 }, { 4, 0 } } }

local torque, moment
controller { name = "look", rate = "2 Hz", step = function(t)
  if t == 0.5 then torque, moment = drive:applied(), (select(3, drive:reaction())) end
end }
-- The bus takes 1/15 of the motion (1 + 14 kg m^2 without the wheel), so the drive's own rate in space is 14/15 of it.
check { name = "angle", unit = "rad", value = function() return drive:angle() end, equal = { 0.3 * (0.5 + 2 + 0.5), tolerance = 1e-8 } }
check { name = "angle of the bus", unit = "rad", value = function() return quat.to_rotation_vector({ bus:attitude() })[3] end,
        equal = { -0.9 / 15, tolerance = 1e-9 } }
check { name = "angle of the wheel in space", unit = "rad", value = function() return wheel:angle() - 0.9 / 15 end, equal = { 0, tolerance = 1e-9 } }
check { name = "torque of the drive", unit = "N m", value = function() return torque end, equal = { 0.3 * 14 / 15, tolerance = 1e-9 } }
check { name = "reaction about the axis", unit = "N m", value = function() return moment end, equal = { 0.3 * 14 / 15, tolerance = 1e-9 } }
