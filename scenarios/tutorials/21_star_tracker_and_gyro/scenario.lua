-- A satellite turns with its orbit by what its sensors tell: gyros carry the attitude on, the star tracker puts it right and finds the bias
-- of the gyros. At noon the Sun stands in the star tracker, and the gyros are alone; in the shadow of the Earth the sensor of the Sun is blind.

local p = parameters { attitude_gain = 0.06, bias_gain = 1e-3, stiffness = 5e-3, damping = 0.12 }     -- of a sample; N m/rad, N m s/rad
local T = 1.0                                                 -- period of sensors and controller [s]

local sat = vehicle "vehicle.yaml"
local bus, gyro, stars, sunward = sat:body "bus", sat:device "gyro", sat:device "stars", sat:device "sunward"
local wheels = { sat:device "wheel_x", sat:device "wheel_y", sat:device "wheel_z" }

local radius, start = 6878.137e3, math.rad(-75)               -- a circular orbit in the plane z = 0; 0 is noon
local rate = math.sqrt(398600.4418e9 / radius ^ 3)            -- [rad/s]
local sun = { math.cos(math.rad(15)), 0, math.sin(math.rad(15)) }

--- The attitude that is wanted: x ahead, y against the normal of the orbit, z to the Earth.
local function wanted(t) return quat.multiply(quat.from_axis_angle({ 0, 0, 1 }, start + rate * t), { 0.5, -0.5, -0.5, 0.5 }) end
local function turned(q, e)
  local angle = vec.norm(e)
  return angle > 0 and quat.multiply(q, quat.from_axis_angle(e, angle)) or q
end

initial { bus = {
  position = { radius * math.cos(start), radius * math.sin(start), 0 },
  velocity = { -radius * rate * math.sin(start), radius * rate * math.cos(start), 0 },
  attitude = turned(wanted(0), { 0.03, -0.02, 0.04 }), rate = { 0, -rate, 0 } } }

mission {
  title = "attitude by a star tracker and gyros, through noon and into the shadow",
  duration = "3240 s",
  integrator = { method = "dop853", relative = 1e-12 },
  output = { rate = "0.1 Hz" },
}

local filter = persist { q = { 1.0, 0.0, 0.0, 0.0 }, bias = { 0.0, 0.0, 0.0 }, begun = false }
local seen = persist { knowledge = 0.0, alone = 0.0, blinded = 0.0, first_sun = -1.0, last_sun = -1.0, sun_angle = 0.0 }
local function see(name, x) if not (x <= seen[name]) then seen[name] = x end end     -- a NaN stays
local log = signals {
  ["filter/error"] = { unit = "rad", components = { "x", "y", "z" }, meaning = "from the attitude of the bus to that of the filter, axes of the bus" },
  ["filter/bias"] = { unit = "rad/s", components = { "x", "y", "z" }, meaning = "of the gyros, as found" },
  ["control/error"] = { unit = "rad", components = { "x", "y", "z" }, meaning = "from the attitude that is wanted to that of the bus" },
}

controller {
  name = "attitude", period = T,
  step = function(t)
    local turn = vec.sub(gyro:get "angle", vec.scale(T, filter.bias))            -- since the last tick [rad]
    if filter.begun then filter.q = turned(filter.q, turn) else turn = { 0, -rate * T, 0 } end
    local valid = stars:valid "attitude"
    if valid then
      local e = quat.error(filter.q, stars:get "attitude")
      if filter.begun then
        filter.q = turned(filter.q, vec.scale(p.attitude_gain, e))
        filter.bias = vec.sub(filter.bias, vec.scale(p.bias_gain / T, e))        -- a filter that is ahead has too small a bias
      else
        filter.q, filter.begun = stars:get "attitude", true
      end
    end

    local e, w = quat.error(wanted(t), filter.q), vec.scale(1 / T, turn)
    local torque = vec.add(vec.scale(p.stiffness, e), vec.scale(p.damping, vec.sub(w, { 0, -rate, 0 })))
    for i, wheel in ipairs(wheels) do wheel:set("torque", torque[i]) end         -- what a wheel takes the bus loses

    local truth = { bus:attitude() }
    local error = quat.error(truth, filter.q)
    if not valid then
      seen.blinded = seen.blinded + T
      see("alone", vec.norm(error))
    elseif t > 400 and t < 620 then
      see("knowledge", vec.norm(error))
    end
    if sunward:valid "direction" then                                            -- the filter tells where it should stand
      local expected = quat.rotate(quat.conjugate(filter.q), sun)
      see("sun_angle", math.asin(vec.norm(vec.cross(expected, sunward:get "direction"))))
      if seen.first_sun < 0 then seen.first_sun = t end
      seen.last_sun = t
    end
    log["filter/error"](error[1], error[2], error[3])
    log["filter/bias"](filter.bias[1], filter.bias[2], filter.bias[3])
    local off = quat.error(wanted(t), truth)
    log["control/error"](off[1], off[2], off[3])
  end,
}

figure { name = "time that the Sun blinds the star tracker", unit = "s", value = function() return seen.blinded end }
figure { name = "first sight of the Sun", unit = "s", value = function() return seen.first_sun end }
figure { name = "last sight of the Sun", unit = "s", value = function() return seen.last_sun end }

-- The light is gone where the disc of the Earth covers that of the Sun.
local sunset = (math.acos(-math.cos(math.asin(6378.137e3 / radius) - 4.6524e-3) / sun[1]) - start) / rate
check { name = "the Sun is lost at the edge of the shadow, after", unit = "s", value = function() return sunset - seen.last_sun end, within = { 0, T } }
-- Five standard deviations by truth.py, of all three axes together.
check { name = "knowledge with the star tracker", unit = "rad", value = function() return seen.knowledge end, below = 4e-4 }
check { name = "knowledge by gyros alone", unit = "rad", value = function() return seen.alone end, below = 7e-3 }
check { name = "the Sun stands where the filter says", unit = "rad", value = function() return seen.sun_angle end, below = 5e-3 }
check { name = "attitude at the end", unit = "rad",
        value = function() return vec.norm(quat.error(wanted(3240), { bus:attitude() })) end, below = 1e-3 }
