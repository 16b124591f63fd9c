-- The modes of a satellite: it is let go tumbling, damps that, finds its attitude, turns to its target and holds it; a valve that sticks
-- throws it back to the first mode, in the instant in which it turns too fast.

local p = parameters { stiffness = 1e-2, damping = 0.15, too_fast = "0.8 deg/s", moment = "20 mN m" }   -- N m/rad, N m s/rad
local T = 0.5                                                 -- period of sensors and controller [s]
local J = { 1.2, 1.5, 1.0 }

local sat = vehicle "vehicle.yaml"
local bus, gyro, stars = sat:body "bus", sat:device "gyro", sat:device "stars"
local wheels = { sat:device "wheel_x", sat:device "wheel_y", sat:device "wheel_z" }
local leak = sat:node "bus.valve":load { axes = "node" }

-- z of the body at a star, x as near as it gets to the Sun.
local target = pointing.align({ 0, 0, 1 }, { 0, 0.6, 0.8 }, { 1, 0, 0 }, { 1, 0, 0 })

initial { bus = { attitude = quat.from_axis_angle({ 1, -2, 1 }, 0.5), rate = { "1.5 deg/s", "-2 deg/s", "1 deg/s" } } }

mission {
  title = "modes: damp, turn, hold, and back",
  duration = "600 s",
  integrator = { method = "dop853", relative = 1e-12 },
  output = { rate = "0.5 Hz" },
}

local filter = persist(estimation.attitude_filter {
  q = { 1, 0, 0, 0 }, sigma = 1, bias_sigma = 2e-4, angle_random_walk = 1e-6 })
local memory = persist { begun = -1.0, from = { 1, 0, 0, 0 }, start = 0.0, knowledge = 0.0 }
local log = signals {
  ["filter/error"] = { unit = "rad", components = { "x", "y", "z" }, meaning = "from the attitude of the bus to that of the filter, axes of the bus" },
  ["control/error"] = { unit = "rad", components = { "x", "y", "z" }, meaning = "from the target to the attitude of the bus" },
}

local function plan()
  return slew.plan { from = memory.from, to = target, rate = math.rad(0.4), acceleration = math.rad(0.02), start = memory.start }
end

phase { name = "damp", until_ = function() return stars:valid "attitude" end, exit_ = function(t)
  if memory.begun < 0 then filter.q, memory.begun = stars:get "attitude", t end
end }
phase { name = "turn", enter = function(t) memory.from, memory.start = stars:get "attitude", t end,
        until_ = function(t) return t >= memory.start + plan().duration end }
phase { name = "hold" }

event { name = "too fast", direction = "rising", when = function() return vec.norm { bus:rate() } - p.too_fast end,
        action = function() mission.enter "damp" end }

controller {
  name = "navigation", period = T,
  step = function(t)
    if memory.begun >= 0 then
      if t > memory.begun then filter:propagate(gyro:get "angle", T) end
      if stars:valid "attitude" then filter:attitude(stars:get "attitude", { 5e-5, 5e-5, 4e-4 }) end
      local error = quat.error({ bus:attitude() }, filter.q)
      if t > 250 and t < 350 then memory.knowledge = math.max(memory.knowledge, vec.norm(error)) end
      log["filter/error"](error[1], error[2], error[3])
    else
      log["filter/error"](0, 0, 0)
    end
  end,
}
controller {
  name = "control", period = T,
  step = function(t)
    local w = vec.sub(vec.scale(1 / T, gyro:get "angle"), filter.bias)            -- the mean since the last tick [rad/s]
    if t == 0 then w = { 0, 0, 0 } end                                            -- nothing has been read
    local e, alpha = { 0, 0, 0 }, { 0, 0, 0 }
    if mission.phase() == "turn" then
      local q, rate, acceleration = plan().at(t)
      e, w, alpha = quat.error(q, filter.q), vec.sub(w, rate), acceleration
    elseif mission.phase() == "hold" then
      e = quat.error(target, filter.q)
    end
    for i, wheel in ipairs(wheels) do                                             -- what a wheel takes the bus loses
      wheel:set("torque", p.stiffness * e[i] + p.damping * w[i] - J[i] * alpha[i])
    end
    local off = quat.error(target, { bus:attitude() })
    log["control/error"](off[1], off[2], off[3])
  end,
}
controller { name = "a valve that sticks", rate = "1 Hz", step = function(t)
  local m = t >= 350 and t < 353 and p.moment or 0
  leak:set(0.6 * m, 0.8 * m, 0, 0, 0, 0)
end }

figure { name = "last phase begins", unit = "s", value = function() return mission.time() - mission.phase_time() end }
check { name = "it holds", value = function() return mission.phase() == "hold" and 1 or 0 end, equal = { 1 } }
check { name = "attitude at the end", unit = "rad", value = function() return vec.norm(quat.error(target, { bus:attitude() })) end, below = 1e-3 }
check { name = "knowledge with the star tracker", unit = "rad", value = function() return memory.knowledge end, below = 4e-4 }
