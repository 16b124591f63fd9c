-- A satellite tumbles after it was let go. Its coils take moments against the change of the field that they see: the change is that of
-- the attitude, nearly, so the torque brakes the rotation across the field, and the field turns along the orbit.

local p = parameters { gain = 5e4, period = "1 s" }         -- gain [A m^2 s/T]

local sat = vehicle "vehicle.yaml"
local bus, coils = sat:body "bus", sat:device "coils"
initial { bus = { position = { "4000 km", "-3000 km", "4700 km" }, velocity = { "5600 m/s", "1500 m/s", "-3800 m/s" }, rate = { "4 deg/s", "-3 deg/s", "2 deg/s" } } }

mission {
  title = "a satellite is brought to rest by its magnetic coils",
  duration = "1500 s",
  integrator = { method = "dop853", relative = 1e-12 },
  output = { rate = "0.2 Hz" },
}

local before = persist { x = 0, y = 0, z = 0, ticks = 0 }   -- what the coils saw one tick ago [T]
local log = signals { ["bdot/moment"] = { unit = "A m^2", components = { "x", "y", "z" }, meaning = "of the coils" } }
local start = vec.norm { bus:rate() }

controller {
  name = "bdot", period = p.period,
  step = function(t)
    local moment = {}
    for i, axis in ipairs { "x", "y", "z" } do
      local B = coils:get("field_" .. axis)
      moment[i] = before.ticks > 0 and -p.gain * (B - before[axis]) / p.period or 0
      before[axis] = B
      coils:set("moment_" .. axis, moment[i])                -- beyond max_moment the coil cuts it
    end
    before.ticks = before.ticks + 1
    log["bdot/moment"](table.unpack(moment))
  end,
}

figure { name = "rate at the end", unit = "deg/s", value = function() return math.deg(vec.norm { bus:rate() }) end }
check { name = "what is left of the rate", unit = "1", value = function() return vec.norm { bus:rate() } / start end, below = 0.5 }
