-- The tool of an arm moves along a straight line, rest to rest, by forces at the tool: the inertia that it feels, Lambda, comes from the
-- spatial operators, and so do the torques. Geometry and equations of this arm stand in any textbook, and check both.

local p = parameters {
  from = { 1.5, 0.2 }, to = { 0.7, 1.1 },  -- [m] x and z of the tool
  time = "3 s", rate = "500 Hz",
  bandwidth = 20,                            -- [rad/s] of the loop on the tool
}
local m1, m2, l1, l2, c1, c2, I1, I2, g = 6, 4, 1, 0.8, 0.5, 0.4, 0.5, 0.2133333333333333, 9.81     -- as in vehicle.yaml, SI

-- The textbook: angles, rates and accelerations of the joints for a tool at x, z [Craig 2005, 4 and 6].
local function joints(x, v, a)
  local elbow = -math.acos((x[1] ^ 2 + x[2] ^ 2 - l1 ^ 2 - l2 ^ 2) / (2 * l1 * l2))
  local shoulder = math.atan(x[2], x[1]) - math.atan(l2 * math.sin(elbow), l1 + l2 * math.cos(elbow))
  local s1, k1, s12, k12 = math.sin(shoulder), math.cos(shoulder), math.sin(shoulder + elbow), math.cos(shoulder + elbow)
  local J = matrix { { -l1 * s1 - l2 * s12, -l2 * s12 }, { l1 * k1 + l2 * k12, l2 * k12 } }
  local q1 = J:solve(vector(v))
  local r1, r12 = q1[1], q1[1] + q1[2]
  local bias = { -l1 * k1 * r1 ^ 2 - l2 * k12 * r12 ^ 2, -l1 * s1 * r1 ^ 2 - l2 * s12 * r12 ^ 2 }
  return { shoulder, elbow }, q1, J:solve(vector { a[1] - bias[1], a[2] - bias[2] }), J
end
local function mass(elbow)
  local k = m2 * l1 * c2 * math.cos(elbow)
  local b = I2 + m2 * c2 ^ 2
  return matrix { { I1 + m1 * c1 ^ 2 + m2 * l1 ^ 2 + b + 2 * k, b + k }, { b + k, b } }
end
local function torques(q, q1, q2)
  local h = m2 * l1 * c2 * math.sin(q[2])
  local t = mass(q[2]) * q2
  local g2 = m2 * c2 * g * math.cos(q[1] + q[2])
  return { t[1] - h * (2 * q1[1] * q1[2] + q1[2] ^ 2) + (m1 * c1 + m2 * l1) * g * math.cos(q[1]) + g2, t[2] + h * q1[1] ^ 2 + g2 }
end
local function reference(t)                  -- a quintic along the line: place, velocity, acceleration
  local s = math.max(0, math.min(t / p.time, 1))
  local way, along, push = s ^ 3 * (10 - 15 * s + 6 * s * s), 30 / p.time * s * s * (1 - s) ^ 2, 60 / p.time ^ 2 * s * (1 - s) * (1 - 2 * s)
  local x, v, a = {}, {}, {}
  for i = 1, 2 do
    local d = p.to[i] - p.from[i]
    x[i], v[i], a[i] = p.from[i] + way * d, along * d, push * d
  end
  return x, v, a
end

local sat = vehicle "vehicle.yaml"
local upper, lower, tool = sat:hinge "upper", sat:hinge "lower", sat:node "lower.tool"
local start = joints(p.from, { 0, 0 }, { 0, 0 })
initial { upper = { angle = start[1] }, lower = { angle = start[2] } }

mission {
  title = "the tool of an arm on a straight line",
  duration = p.time + 0.5,
  integrator = { method = "dopri5", relative = 1e-9 },
  output = { rate = "50 Hz", nodes = { "lower.tool" } },
}

local log = signals {
  ["arm/torque"] = { unit = "N m", components = { "upper", "lower" }, meaning = "of the joints" },
  ["truth/torque"] = { unit = "N m", components = { "upper", "lower" }, meaning = "by the textbook, on the line" },
}
local m = persist { tau = { 0, 0 }, place = 0, angle = 0, torque = 0, inertia = 0 }
local function see(name, e) if not (e <= m[name]) then m[name] = e end end   -- a NaN stays

controller {
  name = "tool", rate = p.rate,
  step = function(t)
    -- The torques are held for a tick: they are made for its middle.
    local x, v, a = reference(t + 0.5 / p.rate)
    local here, _, there = tool:position()
    local vx, _, vz = tool:velocity()
    local ax, _, az = tool:acceleration()                        -- at the torques that are held: all that moves the tool is in it
    local now, rate = { reference(t) }, p.bandwidth
    local wanted = {}
    for i, e in ipairs { here - now[1][1], there - now[1][2] } do
      wanted[i] = a[i] - rate ^ 2 * e - 2 * rate * (({ vx, vz })[i] - now[2][i])
    end
    local more = quat.rotate(quat.conjugate { tool:attitude() }, { wanted[1] - ax, 0, wanted[2] - az })       -- in tool axes
    local space = sat:operators():task { nodes = { "lower.tool" }, rows = { 4, 6 } }
    local step = space:torque(space:force_for { more[1], more[3] })
    m.tau = { m.tau[1] + step[1], m.tau[2] + step[2] }
    upper:torque(m.tau[1])
    lower:torque(m.tau[2])

    local q, q1, q2, J = joints(reference(t))
    local known = torques(joints(x, v, a))
    see("place", math.abs(here - now[1][1]) + math.abs(there - now[1][2]))
    see("angle", math.abs(upper:angle() - q[1]) + math.abs(lower:angle() - q[2]))
    if t > 0 then see("torque", math.abs(m.tau[1] - known[1]) + math.abs(m.tau[2] - known[2])) end
    -- Lambda^-1 = J M^-1 J*; the determinant needs no axes
    local C, K = space:compliance(), J * matrix { mass(q[2]):solve(J[1]):table(), mass(q[2]):solve(J[2]):table() }:t()
    see("inertia", math.abs((C(1, 1) * C(2, 2) - C(1, 2) ^ 2) / (K(1, 1) * K(2, 2) - K(1, 2) * K(2, 1)) - 1)
                     + math.abs((C(1, 1) + C(2, 2)) / (K(1, 1) + K(2, 2)) - 1))
    log["arm/torque"](m.tau[1], m.tau[2])
    log["truth/torque"](known[1], known[2])
  end,
}

-- Torques are held for a tick while what they act on moves on: some 5 m/s^3 x 1 ms of acceleration, over the square of the bandwidth.
check { name = "tool on its line", unit = "m", value = function() return m.place end, below = 5e-5 }
check { name = "joints by geometry", unit = "rad", value = function() return m.angle end, below = 1e-4 }
check { name = "torques by the textbook", unit = "N m", value = function() return m.torque end, below = 5e-3 }
check { name = "inertia at the tool by the textbook, relative", value = function() return m.inertia end, below = 1e-5 }
