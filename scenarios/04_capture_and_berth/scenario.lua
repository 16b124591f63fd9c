-- A servicer whose arm waits where a tumbling target comes by. The hand catches it in a window of 15 mm, the joints brake the motion between the
-- two, the arm carries the target to the berth, which closes the loop servicer - arm - target - servicer; then the hand lets go. Nothing acts from
-- outside: momentum says how all of it moves on, whatever the arm did.

local p = parameters {
  window = "15 mm",                     -- between hand and grapple
  approach = 0.04,                      -- [m/s] of the target
  tumble = { 0.02, -0.01, 0.03 },       -- [rad/s] of it
  stiffness = { 60, 60, 60, 60, 20, 20, 20 },       -- [N m/rad] of the joints' loops; their drives damp by themselves
  damping = { 60, 60, 60, 60, 20, 20, 20 },         -- [N m s/rad] as in vehicle.yaml
  carry_time = "60 s",
}

local sat = vehicle "vehicle.yaml"
local joints = { "link_1", "link_2", "link_3", "link_4", "link_5", "link_6", "hand" }
local berthed = { 75, -62, 5, 120, -8, -35, 20 }         -- [deg] with the target beside the berth
local hinges, start = {}, {}
for i, name in ipairs(joints) do hinges[i] = sat:hinge(name) end
local hand, grapple, target, servicer = sat:node "hand.tool", sat:node "target.grapple", sat:hinge "target", sat:body "servicer"

-- The target starts some way in front of the hand, with the attitude of the hand; its grapple, 0.5 m off its origin, comes nearer along the x axis.
local x, y, z = hand:position()
local w, a, b, c = hand:attitude()
local ahead = quat.rotate({ w, a, b, c }, { 1, 0, 0 })
local gap = 0.2
local turning = quat.rotate({ w, a, b, c }, vec.cross(p.tumble, { -0.5, 0, 0 }))   -- of the grapple about the origin
initial { target = {
  attitude = { w, a, b, c },
  position = { x + (0.5 + gap) * ahead[1], y + (0.5 + gap) * ahead[2], z + (0.5 + gap) * ahead[3] },
  rate = p.tumble, velocity = vec.sub(vec.scale(-p.approach, ahead), turning),
} }

mission {
  title = "a tumbling target is caught, carried and berthed",
  duration = "150 s",
  integrator = { method = "dop853", relative = 1e-10 },
  checkpoint = { period = "10 s" },
  output = { rate = "5 Hz", nodes = { "hand.tool", "target" }, reactions = { "hand" } },
}

local m = persist { caught = -1.0, released = false, from = { 0, 0, 0, 0, 0, 0, 0 } }
local function apart()
  local u, v, s = hand:position()
  local d, e, f = grapple:position()
  return vec.norm { u - d, v - e, s - f }
end

controller { name = "joints", rate = "50 Hz", step = function(t)
  if m.caught < 0 and apart() < p.window then
    m.caught = t
    sat:attach("target", { to = "hand.tool", at = "grapple", as_found = true })
  end
  -- from where the joints are to the berth, rest to rest, 20 s after the catch
  local s = m.caught < 0 and 0 or math.max(0, math.min((t - m.caught - 20) / p.carry_time, 1))
  if s == 0 then for i, hinge in ipairs(hinges) do m.from[i] = hinge:angle() end end
  local way, along = s ^ 3 * (10 - 15 * s + 6 * s * s), 30 / p.carry_time * s * s * (1 - s) ^ 2
  for i, hinge in ipairs(hinges) do
    local move = math.rad(berthed[i]) - m.from[i]
    hinge:torque(-p.stiffness[i] * (hinge:angle() - m.from[i] - way * move) + p.damping[i] * along * move)
  end
end }
phase { name = "wait", until_ = function() return m.caught >= 0 end }
phase { name = "brake", duration = "20 s" }
phase { name = "carry", duration = p.carry_time + 10, exit_ = function() sat:close "berth" end }
phase { name = "both hold", duration = "20 s", exit_ = function()
  sat:open "berth"
  sat:attach("target", { to = "servicer", at = "port", as_found = true })
end }
phase { name = "berthed" }

figure { name = "caught at", unit = "s", value = function() return m.caught end }
check { name = "target turns with the servicer", unit = "rad/s", value = function()
  local u, v = { servicer:rate() }, quat.rotate(quat.multiply(quat.conjugate { servicer:attitude() }, { sat:body("target"):attitude() }),
                                                { sat:body("target"):rate() })
  return vec.norm(vec.sub(u, v))
end, below = 1e-12 }
