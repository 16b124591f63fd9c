-- A slew by four control moment gyros. Nothing from outside: what the rotors and gimbals have, the bus has the other way round.
local J, spin, I, h = { 100, 90, 80 }, 0.1, 0.1, 10     -- [kg m^2] of the bus; of a rotor, of a gimbal; [N m s]
local axes = cmg.pyramid()
axes.h = h
local cluster = cmg.cluster(axes, { max_rate = 0.5 })

local sat = vehicle "vehicle.yaml"
local bus, gimbal, rotor, motor = sat:body "bus", {}, {}, {}
for i = 1, 4 do gimbal[i], rotor[i], motor[i] = sat:hinge("gimbal_" .. i), sat:hinge("rotor_" .. i), sat:device("motor_" .. i) end
mission { duration = "100 s", integrator = { method = "dopri5", relative = 1e-10, max_step = "3 ms" }, output = { rate = "1 Hz" } }   -- currents are stable up to 7 ms

local function list(f)
  local out = {}
  for i = 1, 4 do out[i] = f(i) end
  return out
end
local target = quat.from_axis_angle({ 0.6, -0.5, 0.7 }, math.rad(40))
local m = persist { balance = 0, largest = 0, torque = 0 }
controller {
  name = "slew", rate = "20 Hz",
  step = function(t)
    local q, w = { bus:attitude() }, { bus:rate() }
    local angles, rates = list(function(i) return gimbal[i]:angle() end), list(function(i) return gimbal[i]:rate() end)
    -- Total momentum, body axes: everything turns with the bus, gimbals and rotors with the gimbals, rotors about their axes.
    local now = cmg.cluster { gimbals = axes.gimbals, spins = axes.spins, h = list(function(i) return spin * rotor[i]:rate() end) }
    local total = now.momentum(angles)
    for k = 1, 3 do
      total[k] = total[k] + (J[k] + 4 * (spin + I)) * w[k]
      for i = 1, 4 do total[k] = total[k] + (spin + I) * rates[i] * axes.gimbals[i][k] end
    end
    m.balance, m.largest = math.max(m.balance, vec.norm(total)), math.max(m.largest, vec.norm(w))
    -- J w' + w x (J w + h) = -h'
    local e, u = quat.error(target, q), {}
    for k = 1, 3 do u[k] = -J[k] * (0.2 ^ 2 * e[k] + 2 * 0.8 * 0.2 * w[k]) end
    local hdot = vec.scale(-1, vec.add(u, vec.cross(w, cluster.momentum(angles))))
    local command = cluster.rates(hdot, angles, t)
    if t > 1 then
      local near = vec.sub(cluster.momentum_rate(angles, command), hdot)
      m.torque = math.max(m.torque, vec.norm(near) / (vec.norm(hdot) + 1e-3))
    end
    for i = 1, 4 do motor[i]:set("voltage", command[i]) end        -- gear times constant is 1 V s
  end,
}
check { name = "momentum of the whole", unit = "N m s", below = 1e-7, value = function() return m.balance end }   -- 40 N m s in rotors to 1e-10, some steps
check { name = "rate of the slew", unit = "rad/s", value = function() return m.largest end, equal = { 0.05, tolerance = 0.02 } }
check { name = "attitude", unit = "rad", below = 1e-6, value = function() return vec.norm(quat.error(target, { bus:attitude() })) end }   -- exp(-16), ten times for what the servos take
check { name = "steering gives what is asked for", below = 0.05, value = function() return m.torque end }
