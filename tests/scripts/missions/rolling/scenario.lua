-- A bowl that slides until it rolls, a coin that rolls in a circle, a top that turns over.
local sat = vehicle "vehicle.yaml"
mission { duration = "3 s", integrator = { method = "cvode_bdf", relative = 1e-9 }, output = { rate = "20 Hz" } }
local g = 9.81

-- The bowl rolls once v - mu g t = w l and I w = m mu g l t, l where friction acts: in the middle of what it sinks by.
local m, I, r, mu, v = 7, 0.03, 0.108, 0.1, 4
local sink = m * g / 1e6
local l = r - sink / 2
local rolling = v / (1 + I / (m * l ^ 2))
local slides = (v - rolling) / (mu * g)
local place = v * slides - mu * g * slides ^ 2 / 2 + rolling * (3 - slides)
local bowl = sat:body "bowl"
check { name = "speed of the bowl", unit = "m/s", value = function() return (bowl:velocity()) end, equal = { rolling, tolerance = 1e-8 } }
-- Below the width of its smoothing friction fades, over a tenth of a millisecond: by less than the width times that, and some rows of it.
check { name = "place of the bowl", unit = "m", value = function() return (bowl:position()) end, equal = { place, tolerance = 1e-6 } }

-- The coin leans by a; its place of contact goes round a radius R at W. Friction holds it in with 0.2 of the normal force and so creeps at 0.2 of
-- the width, it sinks by 2e-6 m: 1e-4 m in 3 s.
local rim, R, a = 0.5, 2, 0.4
local W = math.sqrt(4 * g * math.tan(a) / (6 * R - 5 * rim * math.sin(a)))
local rho = R - rim * math.sin(a)
local coin = sat:body "coin"
local function off()
  local t = mission.time()
  local axis = quat.rotate({ coin:attitude() }, { 1, 0, 0 })
  local place = vec.sub({ coin:position() }, { rho * math.cos(W * t), rho * math.sin(W * t), rim * math.cos(a) })
  return vec.norm(place) + vec.norm(vec.sub(axis, { math.cos(a) * math.cos(W * t), math.cos(a) * math.sin(W * t), math.sin(a) }))
end
check { name = "coin off its circle", below = 1e-3, value = off }

-- Whatever friction does, L . s stays, s the way from the mass centre to the place of contact [Jellett 1872]; but for what it sinks by, 2e-5 m of
-- 0.015 m, half of it and bounces.
local top = sat:body "top"
local function jellett()
  local q, w = { top:attitude() }, { top:rate() }
  local up = quat.rotate(q, { 0, 0, 1 })
  return vec.dot(quat.rotate(q, { 2.4e-6 * w[1], 2.4e-6 * w[2], 2.6e-6 * w[3] }), vec.add(vec.scale(0.003, up), { 0, 0, -0.015 })), up[3]
end
initial {
  bowl = { position = { 0, 0, r - sink }, velocity = { v, 0, 0 } },
  coin = { position = { rho, 0, rim * math.cos(a) - 2 * g / 1e7 }, velocity = { 0, W * rho, 0 }, orientation = { axis = { 0, 1, 0 }, angle = -a }, angular_velocity = { W * math.sin(a) - W * R / rim, 0, W * math.cos(a) } },
  top = { position = { 0, 10, 0.015 }, orientation = { axis = { 1, 0, 0 }, angle = 0.1 }, angular_velocity = { 0, 0, 150 } },
}
local first = jellett()
local seen = persist { worst = 0 }
controller { name = "jellett", rate = "100 Hz", step = function() seen.worst = math.max(seen.worst, math.abs(jellett() / first - 1)) end }
check { name = "Jellett's integral", below = 2e-3, value = function() return seen.worst end }
check { name = "the top is upside down", below = -0.95, value = function() return select(2, jellett()) end }
