-- Faults of ports: each kind, of what devices tell and of what they are told, read by the script and by other devices.
device { type = "lua/monitor", inputs = { one = "rad/s" }, outputs = { seen = "rad/s" },
         tick = function(a) return { seen = a.one } end }
device { type = "lua/twice", inputs = { one = "rad/s" }, outputs = { both = "rad/s" }, in_step = true,
         evaluate = function(a) return { both = 2 * a.one } end }
device { type = "lua/pair", inputs = { a = "1", b = "1" }, outputs = { told = "1" }, in_step = true,
         evaluate = function(a) return { told = a.a + 10 * a.b } end }
local sat = vehicle "vehicle.yaml"
mission { duration = "10 s", output = { rate = "10 Hz" } }
local wheel, gyro, noisy, monitor, twice = sat:device "wheel", sat:device "gyro", sat:device "noisy", sat:device "monitor", sat:device "twice"

-- The wheel takes 0.2 N m from a bus of 40 kg m^2, half of it from 4 s to 6 s, nothing from 8 s on.
wheel:set("torque", 0.2)
wheel:fault { port = "torque", scale = 0.5, from = "4 s", until_ = "6 s" }
local function rate(t)
  return 0.1 - 0.005 * (math.min(t, 4) + 0.5 * math.max(0, math.min(t, 6) - 4) + math.max(0, math.min(t, 8) - 6))
end

wheel:fault { port = "rate", scale = -1, from = "1 s", until_ = "2 s" }
gyro:fault { port = "rate_z", bias = "0.02 rad/s", from = "1 s", until_ = "2 s" }
noisy:fault { port = "rate", noise = { "0 rad/s", "0.1 deg/s", "0.2 deg/s" } }

-- Begin and end are those of ticks, whatever rounding makes of 0.1 s times a number.
gyro:fault { port = "rate_x", stuck = 1, from = 0.1 * 3, until_ = 0.1 * 6 }

local log = persist { beside = 0, n = 0, y = 0, yy = 0, z = 0, zz = 0, yz = 0, worst = 0, h = 0, late = 0 }
local function expect(t, x, what)
  local told = gyro:get "rate_z"
  log.worst = math.max(log.worst, math.abs(told - x))
  if math.abs(told - x) > 1e-9 then error(("%s at %g s: %.12g in place of %.12g"):format(what, t, told, x)) end
end

controller { name = "looks", rate = "10 Hz", step = function(t)
  if t > 2.95 and t < 3.05 then gyro:fault { port = "rate_z", drift = "0.01 rad/s^2" } end
  if t > 3.95 and t < 4.05 then gyro:mend "rate_z" end
  if t > 4.95 and t < 5.05 then gyro:fault { port = "rate_z", stuck = true } end
  if t > 5.45 and t < 5.55 then gyro:fault { port = "rate_z", stuck = "3 deg/s" } end
  if t > 5.95 and t < 6.05 then gyro:fault { port = "rate", scale = { 1, 1, -1 } } end
  if t > 7.95 and t < 8.05 then wheel:fault { port = "torque", stuck = 0 } gyro:mend "rate" end
  local k = math.floor(t * 10 + 0.5) / 10
  if k < 5 then log.beside = math.max(log.beside, math.abs(gyro:get "rate_x" - (k >= 0.3 and k < 0.6 and 1 or 0))) end
  if k < 1 then expect(t, rate(t), "sound")
  elseif k < 2 then expect(t, rate(t) + 0.02, "bias")
  elseif k < 3 then expect(t, rate(t), "sound again")
  elseif k < 4 then expect(t, rate(t) + 0.01 * (t - 3), "drift")
  elseif k < 5 then expect(t, rate(t), "mended")
  elseif k < 5.5 then expect(t, rate(5), "stuck where it was")
  elseif k < 6 then expect(t, math.rad(3), "stuck at a number")
  elseif k < 8 then expect(t, -rate(t), "the sign turned")
  else expect(t, rate(t), "sound in the end") end
  -- The rotor in its bearings, which the monitor saw a tick ago.
  local function rotor(at) return (at >= 0.95 and at < 1.95 and -1 or 1) * (log.h / 0.05 - rate(at)) end
  if k > 0 and k < 4 then assert(math.abs(monitor:get "seen" - rotor(k - 0.1)) < 1e-9) end
  log.h = wheel:get "momentum"
  if k < 4 then assert(math.abs(twice:get "both" - 2 * rotor(t + 1e-9)) < 1e-7) end
end }
-- In units of 0.1 deg/s: of x nothing, of y noise of 1, of z of 2, each for itself.
local unit, bus = math.rad(0.1), sat:body "bus"
controller { name = "statistics", rate = "100 Hz", step = function()
  local told, _, _, truth = noisy:get "rate", bus:rate()
  local y, z = told[2] / unit, (told[3] - truth) / unit
  log.n, log.y, log.yy, log.z, log.zz, log.yz = log.n + 1, log.y + y, log.yy + y * y, log.z + z, log.zz + z * z, log.yz + y * z
end }
-- Another gyro is late by 0.3 s from 1 s on and wired the wrong way round from 7 s to 8 s; the bus turns about z alone.
local late = sat:device "late"
late:fault { port = "rate", delay = "0.3 s", from = "1 s", until_ = "7 s" }
sequence { name = "wires", run = function() at "7 s" late:fault { port = "rate_x", swap = "rate_z", until_ = "8 s" } end }
controller { name = "looks late", rate = "10 Hz", step = function(t)
  local x, z, k = late:get "rate_x", late:get "rate_z", math.floor(t * 10 + 0.5) / 10
  local expected = k < 1 and rate(k) or k < 1.25 and rate(0.9) or k < 7 and rate(k - 0.3) or rate(k)
  if k >= 7 and k < 8 then x, z = z, x end
  log.late = math.max(log.late, math.abs(z - expected) + math.abs(x))
end }
-- Inputs that are wired the wrong way round.
local pair = sat:device "pair"
pair:fault { port = "a", swap = "b" }
check { name = "swapped inputs", value = function() return pair:get "told" end, equal = { 5 + 10 * 3, tolerance = 0 } }
-- Faults go on in a vehicle that is compiled again: while a drift is drawn on, and while the gyro is stuck.
for i, at in ipairs { 3.53, 5.23 } do
  event { name = "heavier " .. i, direction = "rising", when = function(t) return t - at end,
          action = function() sat:change { ["bodies.bus.mass"] = ("%d kg"):format(100 + 10 * i) } end }
end
local function of(x) return function() return x() / log.n end end
check { name = "worst reading", unit = "rad/s", value = function() return log.worst end, below = 1e-9 }
check { name = "beside a tick", unit = "rad/s", value = function() return log.beside end, below = 1e-9 }
check { name = "worst late reading", unit = "rad/s", value = function() return log.late end, below = 1e-9 }
check { name = "rate of the bus", unit = "rad/s", value = function() return select(3, bus:rate()) end, equal = { 0.065, tolerance = 1e-11 } }
-- Four standard deviations of the mean of 1000.
check { name = "mean, y", value = of(function() return log.y end), within = { -0.127, 0.127 } }
check { name = "variance, y", value = of(function() return log.yy end), within = { 1 - 0.179, 1 + 0.179 } }
check { name = "variance, z", value = of(function() return log.zz end), within = { 4 - 0.716, 4 + 0.716 } }
check { name = "covariance", value = of(function() return log.yz end), within = { -0.253, 0.253 } }
