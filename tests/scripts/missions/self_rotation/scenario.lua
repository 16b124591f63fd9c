-- A cat that falls, or an astronaut, turns about its axis without angular momentum: the bend of its waist goes round once.
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = "dopri5", relative = 1e-11 }, output = { rate = "10 Hz" } }

-- Seen from the plane between the halves, which turns about z at u', each half nutates with its axis e, half a bend off, at w:
-- omega = u' z + w (z - e). Across z their momenta cancel; along it J (omega . e) e_z + I (omega - (omega . e) e)_z = 0 gives u' [Kane & Scher 1969].
local I, J, bend, w = 3, 0.6, 0.9, math.pi
local c, s = math.cos(bend / 2), math.sin(bend / 2)
local turn = -w * (1 - c) * (I * (1 + c) - J * c) / (J * c ^ 2 + I * s ^ 2)

local waist = sat:hinge "trunk"
waist:profile { component = "tilt_1", sine = { amplitude = bend, frequency = "0.5 Hz", phase = math.pi / 2 } }
waist:profile { component = "tilt_2", sine = { amplitude = bend, frequency = "0.5 Hz", phase = 0 } }
local half = quat.from_rotation_vector { bend / 2, 0, 0 } -- from the legs to the plane between, as it begins
local z, e = { 0, 0, 1 }, quat.rotate(quat.conjugate(half), { 0, 0, 1 })
initial { legs = { angular_velocity = quat.rotate(half, vec.add(vec.scale(turn, z), vec.scale(w, vec.sub(z, e)))) } }

-- After one round the bend is what it was, and both have turned by 2 u', here by half a turn.
local after = quat.from_rotation_vector(vec.scale(2 * turn, quat.rotate(half, z)))
check { name = "attitude after one round", unit = "rad", below = 1e-9,
  value = function() return vec.norm(quat.error(after, { sat:body("legs"):attitude() })) end }
