-- Check-cases of NASA's Engineering and Safety Center: bodies dropped and thrown over an oblate Earth that turns, in the standard atmosphere of 1976.
-- This air does not come with Cardan: a device of the script is all it takes. Numbers of other programs are compared.

local foot = 0.3048
local p = parameters { case = "drop" }
local cases = {                                                    -- what six programs found is told by "altitude", within "spread"
  drop = { number = 6, altitude = 16284.444 * foot, spread = 0.01, height = 9144 },
  wind = { number = 7, altitude = 16285.161 * foot, spread = 0.01, height = 9144 },
  shear = { number = 8, altitude = 16290.998 * foot, spread = 0.01, height = 9144 },
  east = { number = 9, altitude = 10160.9 * foot, spread = 0.1, height = 0, thrown = { 0, 1000 * foot, 1000 * foot } },
  north = { number = 10, altitude = 10114.8 * foot, spread = 0.1, height = 0, thrown = { 1000 * foot, 0, 1000 * foot } },
  brick = { number = 3, altitude = 15598.904 * foot, spread = 0.01, height = 9144, turns = true },
}
local case = assert(cases[p.case], "no such case")

-- WGS-84: equatorial radius, flattening, turn. The attraction is in vehicle.yaml.
local radius, flattening, turn = 6378137.0, 1 / 298.257223563, 7.292115e-5

local function in_world(R, x) return { R[1] * x[1] + R[2] * x[2] + R[3] * x[3], R[4] * x[1] + R[5] * x[2] + R[6] * x[3], R[7] * x[1] + R[8] * x[2] + R[9] * x[3] } end
local function in_node(R, x) return { R[1] * x[1] + R[4] * x[2] + R[7] * x[3], R[2] * x[1] + R[5] * x[2] + R[8] * x[3], R[3] * x[1] + R[6] * x[2] + R[9] * x[3] } end

-- Height over the ellipsoid [m] and geodetic latitude [rad].
local function geodetic(x, y, z)
  local e2, q = flattening * (2 - flattening), math.sqrt(x * x + y * y)
  local latitude, s = math.atan(z, q * (1 - e2)), 0
  for _ = 1, 6 do
    s = math.sin(latitude)
    latitude = math.atan(z + e2 * radius / math.sqrt(1 - e2 * s * s) * s, q)
  end
  s = math.sin(latitude)
  return q * math.cos(latitude) + z * s - radius * math.sqrt(1 - e2 * s * s), latitude
end
-- US Standard Atmosphere 1976 below 20 km: the troposphere cools by 6.5 K/km, above it is as cold everywhere.
local function density(height)
  local H, g, R = 6356766.0 * height / (6356766.0 + height), 9.80665, 8314.32 / 28.9644
  local T = math.max(288.15 - 0.0065 * H, 216.65)
  local pressure = 101325 * (T / 288.15) ^ (g / (R * 0.0065)) * math.exp(-g * math.max(H - 11000, 0) / (R * T))
  return pressure / (R * T)
end
-- Of the body against the air, which turns with the Earth and blows to the east; world axes.
local function airspeed(x, v, height, wind, shear)
  local q = math.sqrt(x[1] ^ 2 + x[2] ^ 2)
  local east = turn * q + wind + shear * height
  return { v[1] + east * x[2] / q, v[2] - east * x[1] / q, v[3] }
end

device {
  type = "lua/air", mounts = { at = "node" }, in_step = true,
  params = { wind = { 0, "m/s" }, shear = { 0, "1/s" }, area = { 0.1963495 * foot ^ 2, "m^2" }, drag = { 0.1, "1" },       -- of the sphere
             damping = { 0, "1" }, span = { foot / 3, "m" }, chord = { 2 * foot / 3, "m" } },                                -- of the brick
  evaluate = function(a)
    local x, R = a.at.position, a.at.R
    local height = geodetic(x[1], x[2], x[3])
    local u = airspeed(x, in_world(R, a.at.velocity), height, a.wind, a.shear)
    local half = 0.5 * density(height) * vec.norm(u) * a.area
    local w, turned = a.at.rate, -0.5 * half * a.damping
    return { at = { force = in_node(R, { -half * a.drag * u[1], -half * a.drag * u[2], -half * a.drag * u[3] }),
                    moment = { turned * a.span ^ 2 * w[1], turned * a.chord ^ 2 * w[2], turned * a.span ^ 2 * w[3] } } }
  end,
}

local sat = vehicle "vehicle.yaml"
local body = sat:body "body"
local height = case.height                                          -- [m]
local thrown = case.thrown or { 0, 0, 0 }                            -- north, east, up
initial {
  body = {
    position = { radius + height, 0, 0 }, velocity = { thrown[3], turn * (radius + height) + thrown[2], thrown[1] },
    orientation = { matrix = { { 0, 0, -1 }, { 0, 1, 0 }, { 1, 0, 0 } } },          -- north, east, down
    angular_velocity = case.turns and { "10 deg/s", "20 deg/s", "30 deg/s" } or { 0, 0, 0 },
  },
}
mission { title = string.format("check-case %d", case.number), duration = "30 s", integrator = { method = "dop853", relative = 1e-12 }, output = { rate = "10 Hz" } }

local log = signals {
  ["flight/altitude"] = { unit = "m", meaning = "over the ellipsoid" },
  ["flight/airspeed"] = { unit = "m/s", meaning = "against the air that turns with the Earth, without wind" },
}
local function where()
  local x, y, z = body:position()
  local h, latitude = geodetic(x, y, z)
  return h, latitude, math.atan(y, x) - turn * sim:t()
end
controller {
  name = "instruments", rate = "10 Hz",
  step = function()
    local h = where()
    log["flight/altitude"](h)
    log["flight/airspeed"](vec.norm(airspeed({ body:position() }, { body:velocity() }, h, 0, 0)))
  end,
}

figure { name = "altitude", unit = "m", value = function() return (where()) end }
figure { name = "latitude", unit = "deg", value = function() return math.deg((select(2, where()))) end }
figure { name = "longitude", unit = "deg", value = function() return math.deg((select(3, where()))) end }
check { name = "altitude that other programs found", unit = "m", value = function() return (where()) end, equal = { case.altitude, tolerance = case.spread } }
