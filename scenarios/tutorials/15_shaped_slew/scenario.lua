-- The same slew three times: by a torque forward and back; by the same torque shaped for the mode of the appendage with two pulses (ZV);
-- and with three (ZVD). What is left of the swing after it is known for any plant, also one that is not the one the shaper was made for.

local p = parameters {
  torque = "2 N m", pulse = "4.6 s",       -- forward, then as long back
  designed_for = 1.0,                        -- frequency that the shapers are made for, over the true one; 0.8, 1 or 1.25 (whole ticks)
}
local J, j, k = 40, 10, 19.739208802178716  -- as in vehicle.yaml, SI
local w = math.sqrt(k * (1 / J + 1 / j))     -- [rad/s]

local sat = vehicle "vehicle.yaml"
local shapers = {                            -- amplitudes of the pulses, half a designed period apart [Singer, Seering 1990]; no damping
  bang = { 1 }, zv = { 1 / 2, 1 / 2 }, zvd = { 1 / 4, 1 / 2, 1 / 4 },
}
local half = math.pi / (w * p.designed_for)

mission {
  title = "a slew that does not shake its appendage",
  duration = "24 s",
  integrator = { method = "dopri5", relative = 1e-10 },
  output = { rate = "20 Hz" },
}

local ticks = 100                            -- [Hz] of the controller; switchings fall on ticks
local function bang(t) return (t >= 0 and t < p.pulse) and 1 or (t >= p.pulse and t < 2 * p.pulse) and -1 or 0 end
local function shaped(amplitudes, n)
  local sum = 0
  for i, a in ipairs(amplitudes) do sum = sum + a * bang((n - math.floor((i - 1) * half * ticks + 0.5)) / ticks) end
  return sum
end

local m = persist { n = 0 }
local log = signals {
  ["slew/torque"] = { unit = "N m", components = { "bang", "zv", "zvd" }, meaning = "on each hub" },
  ["slew/angle"] = { unit = "deg", components = { "bang", "zv", "zvd" }, meaning = "of each hub" },
}
local order = { "bang", "zv", "zvd" }
controller {
  name = "torque", rate = ticks,
  step = function()
    local torques, angles = {}, {}
    for i, name in ipairs(order) do
      torques[i] = p.torque * shaped(shapers[name], m.n)
      sat:hinge("hub_" .. name):torque(torques[i])
      angles[i] = math.deg(sat:hinge("hub_" .. name):angle())
    end
    m.n = m.n + 1
    log["slew/torque"](table.unpack(torques))
    log["slew/angle"](table.unpack(angles))
  end,
}

-- The spring angle s obeys s'' + w^2 s = -T / J: each step of T at t_i leaves a swing of T / (J w^2) turned by w t_i.
local function residual(amplitudes)
  local x, y = 0, 0
  for i, a in ipairs(amplitudes) do
    for edge, weight in pairs { [0] = 1, [1] = -2, [2] = 1 } do
      local t = math.floor((i - 1) * half * ticks + 0.5) / ticks + edge * p.pulse
      x, y = x + a * weight * math.cos(w * t), y + a * weight * math.sin(w * t)
    end
  end
  return p.torque / (J * w * w) * math.sqrt(x * x + y * y)
end
local function measured(name)                -- [rad] amplitude of what is left
  local boom = sat:hinge("boom_" .. name)
  return math.sqrt(boom:angle() ^ 2 + (boom:rate() / w) ^ 2)
end
for _, name in ipairs(order) do
  figure { name = "swing left, " .. name, unit = "deg", value = function() return math.deg(measured(name)) end }
  -- Steps of 1e-10 of a swing of 0.02 rad, added up over 24 s.
  check { name = "swing left by the closed form, " .. name, unit = "rad", value = function() return measured(name) end,
          equal = { residual(shapers[name]), tolerance = 1e-9 } }
  check { name = "momentum is back, " .. name, unit = "N m s", equal = { 0, tolerance = 1e-9 },
          value = function()
            local hub, boom = sat:hinge("hub_" .. name), sat:hinge("boom_" .. name)
            return J * hub:rate() + j * (hub:rate() + boom:rate())
          end }
end
-- Singer and Seering: with a frequency that is wrong by r, ZV leaves |cos(pi r / 2)| of the swing without a shaper, ZVD its square.
local r = 1 / p.designed_for
check { name = "ZV over none", value = function() return measured "zv" / measured "bang" end, equal = { math.abs(math.cos(math.pi * r / 2)), tolerance = 1e-7 } }
check { name = "ZVD over none", value = function() return measured "zvd" / measured "bang" end, equal = { math.cos(math.pi * r / 2) ^ 2, tolerance = 1e-7 } }
