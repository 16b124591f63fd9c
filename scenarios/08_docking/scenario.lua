-- A chaser docks with a target: the tip of its probe meets the wall of the drogue, slides along it to the throat and is caught where it comes within
-- the window of the latch, slowly enough. Both hold each other for a while; then the latch opens, and a plunger that the docking compressed pushes
-- them apart. Nothing acts from outside.

local p = parameters {
  approach = "50 mm/s",
  beside = "50 mm",                          -- the tip off the axis of the drogue, as it sets out
  turn = { 0.0015, -0.001, 0.0012 },         -- [rad/s] of the chaser
  window = "8 mm",                           -- of the latch: tip from seat
  max_speed = "60 mm/s",                     -- of what it still catches
  held = "40 s",
}

local sat = vehicle "vehicle.yaml"
local at = { chaser = sat:hinge "chaser", target = sat:hinge "target" }
local tip, seat, probe = sat:node "chaser.tip", sat:node "target.seat", sat:device "probe"
initial {
  chaser = { position = { -1.75, 0.8 * p.beside, -0.6 * p.beside }, velocity = { p.approach, 0, 0 }, rate = p.turn },
  target = { rate = { 0, 0.0008, -0.0005 } },
}

mission {
  title = "a probe finds its drogue, is caught, held and let go",
  duration = "100 s",
  integrator = { method = "dop853", relative = 1e-11 },
  checkpoint = { period = "10 s" },
  output = { rate = "10 Hz", nodes = { "chaser.tip", "chaser_left.tip", "boom.tip" } },
}

-- Of a point of a body, from the coordinates that it hangs on the world by: what a function of an event may read.
local function place(body, point)
  local x = quat.rotate({ sat:body(body):attitude() }, point)
  return { at[body]:q "x" + x[1], at[body]:q "y" + x[2], at[body]:q "z" + x[3] }
end
local function apart() return vec.norm(vec.sub(place("chaser", { 1.2, 0, 0 }), place("target", { -0.0492, 0, 0 }))) end
local function speed()
  local u, v, w = tip:velocity()
  return vec.norm(vec.sub({ u, v, w }, { seat:velocity() }))
end

local m = persist { caught = -1.0, speed = 0.0, parted = -1.0, hardest = 0.0 }
event { name = "within the window", direction = "falling", once = true, when = function() return apart() - p.window end, action = function(t)
  m.speed = speed()
  if m.speed > p.max_speed then return print(string.format("too fast for the latch: %.1f mm/s", 1e3 * m.speed)) end
  m.caught = t
  sat:attach("chaser", { to = "target.seat", at = "tip", as_found = true })
end }
controller { name = "watch", rate = "100 Hz", step = function(t)
  m.hardest = math.max(m.hardest, probe:get "force")
  if m.caught >= 0 and m.parted < 0 and t >= m.caught + p.held then
    m.parted = t
    sat:detach "chaser"
  end
end }
phase { name = "approach", until_ = function() return probe:get "touching" == 1 end }
phase { name = "the probe finds its way", until_ = function() return m.caught >= 0 end }
phase { name = "docked", until_ = function() return m.parted >= 0 end }
phase { name = "apart" }

figure { name = "caught at", unit = "s", value = function() return m.caught end }
figure { name = "speed at the catch", unit = "mm/s", value = function() return 1e3 * m.speed end }
figure { name = "hardest push of the probe", unit = "N", value = function() return m.hardest end }
check { name = "caught and let go", unit = "s", value = function() return m.parted end, above = 0 }
check { name = "parting speed", unit = "mm/s", value = function() return 1e3 * speed() end, above = 5 }
check { name = "nothing touches in the end", unit = "N", value = function() return probe:get "force" + sat:device("plunger"):get "force" end, below = 1e-300 }
