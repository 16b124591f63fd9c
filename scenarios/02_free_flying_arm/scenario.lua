-- A free-flying servicer moves the tool of its seven-joint arm along a straight line in space, rest to rest, with its attitude kept,
-- while nothing holds the servicer: task-space control (Khatib 1987; for a free-floating base Umetani & Yoshida 1989). The inertia
-- that the tool feels through the arm, the floating base and the bending wings comes from the spatial operators:
--
--   x'' = J v' + J' v,   v' = M^-1 (S* tau + ...),   A = J M^-1 S*   (6 x 7; S picks the seven joints)
--   tau <- tau + A^+ (wanted x'' - present x''),     A^+ = A* (A A*)^-1,     beside it (1 - A^+ A) tau_0
--
-- The present acceleration of the tool, at the torques that are held, contains J' v and all else that moves it: one forward dynamics.

local p = parameters {
  move = { 0.25, 0.45, -0.30 },      -- [m] of the tool, world axes
  move_time = "30 s",
  settle_time = "10 s",
  bandwidth = 1.0,                   -- [rad/s] of the tracking loop
  posture_damping = 2.0,             -- [1/s] of the one motion of the arm that does not move the tool
}

local sat = vehicle "vehicle.yaml"

mission {
  title = "a tool on a straight line, by the arm of a free-flying servicer",
  duration = p.move_time + p.settle_time,
  integrator = { method = "dopri5", relative = 1e-9 },
  output = { rate = "10 Hz", nodes = { "hand.tool", "wing_left.tip" } },
}

local joints = { "link_1", "link_2", "link_3", "link_4", "link_5", "link_6", "hand" }
local hinges = {}
for i, name in ipairs(joints) do hinges[i] = sat:hinge(name) end
local tool, base = sat:node "hand.tool", sat:body "servicer"

local function position() return { tool:position() } end
local function attitude() return { tool:attitude() } end          -- tool axes to world axes
-- What the controller remembers from tick to tick: start and aim of the tool, errors [m], [deg], the torques [N m] that move the tool.
local m = persist { error = 0, angle = 0, worst = 0, task = vector { 0, 0, 0, 0, 0, 0, 0 } }

-- Rest-to-rest profile: position, velocity, acceleration at t.
local function reference(t)
  local T = p.move_time
  local s = math.min(t / T, 1.0)
  return vec.add(m.start, vec.scale(s ^ 3 * (10 - 15 * s + 6 * s * s), p.move)),
         vec.scale(30 / T * s * s * (1 - s) ^ 2, p.move), vec.scale(60 / T ^ 2 * s * (1 - s) * (1 - 2 * s), p.move)
end

local log = signals {
  ["tool/position_error"] = { unit = "m", components = { "x", "y", "z" }, meaning = "tool minus reference, world axes" },
  ["tool/attitude_error"] = { unit = "deg", meaning = "angle between wanted and true attitude of the tool" },
  ["arm/torque"] = { unit = "N m", components = { "1", "2", "3", "4", "5", "6", "7" }, meaning = "joint torques" },
  ["arm/manipulability"] = { unit = "1", meaning = "smallest over largest singular value of A, in units of the tool" },
}


controller {
  name = "tool",
  rate = "50 Hz",
  step = function(t)
    if not m.start then m.start, m.aim = position(), attitude() end
    -- what the tool should do, as [angular; linear] in tool axes
    local x, v, a = reference(t)
    local to_tool = quat.conjugate(attitude())
    local function in_tool(world) return quat.rotate(to_tool, world) end
    local k, d = p.bandwidth ^ 2, 2 * p.bandwidth
    local e, rate = vec.sub(position(), x), vec.sub({ tool:velocity() }, v)
    local turn, spin = quat.error(m.aim, attitude()), { tool:rate() }
    local wanted = vec.sub(a, vec.add(vec.scale(k, e), vec.scale(d, rate)))
    local linear = in_tool(vec.sub(wanted, { tool:acceleration() }))
    local present = { tool:angular_acceleration() }
    local miss = vector { -k * turn[1] - d * spin[1] - present[1], -k * turn[2] - d * spin[2] - present[2],
                          -k * turn[3] - d * spin[3] - present[3], linear[1], linear[2], linear[3] }

    -- A = J M^-1 S*, row by row of its transpose: M^-1 J* at the joints
    local s = sat:operators()
    local J = s:nodes("hand.tool"):star() * s.phi:star() * s.H:star()
    local response = (s.mass:inv() * J:star()):dense()
    local rows = {}
    for i, name in ipairs(joints) do rows[i] = response[name .. ".rate"]:table() end
    local At = matrix(rows)                                         -- 7 x 6
    local A = At:t()
    local gram = A * At
    local step = At * gram:solve(miss)
    -- the joint motion that leaves the tool alone is damped: (1 - A^+ A) tau_0
    local tau_0 = {}
    for i, hinge in ipairs(hinges) do tau_0[i] = -p.posture_damping * hinge:rate() end
    tau_0 = vector(tau_0)
    local null = tau_0 - At * gram:solve(A * tau_0)
    m.task = m.task + step
    local torque = m.task + null
    for i, hinge in ipairs(hinges) do hinge:torque(torque[i]) end

    m.error, m.angle = vec.norm(e), math.deg(vec.norm(turn))
    m.worst = math.max(m.worst, m.error)
    local values = gram:eigenvalues()
    log["tool/position_error"](e[1], e[2], e[3])
    log["tool/attitude_error"](m.angle)
    log["arm/torque"](table.unpack(torque:table()))
    log["arm/manipulability"](math.sqrt(values[1] / values[6]))
  end,
}

figure { name = "turn of the servicer", unit = "deg",
         value = function() return math.deg(vec.norm(quat.to_rotation_vector { base:attitude() })) end }
figure { name = "largest position error on the way", unit = "mm", value = function() return 1000 * m.worst end }

check { name = "largest position error on the way", unit = "mm", value = function() return 1000 * m.worst end, below = 0.1 }
check { name = "position error, final", unit = "mm", value = function() return 1000 * m.error end, below = 0.001 }
check { name = "attitude error of the tool, final", unit = "deg", value = function() return m.angle end, below = 0.001 }
