-- Gravity pulls a little more at the lower end of a long satellite than at the upper one. Let go at an angle to the vertical it swings about
-- it: a pendulum with the period of the orbit, more or less.

local p = parameters { radius = "6878.137 km", angle = "30 deg" }
local mu, J = 398600.4418e9, { 20, 180, 190 }     -- as in vehicle.yaml, SI

local n = math.sqrt(mu / p.radius ^ 3)             -- [rad/s] mean motion
local w = n * math.sqrt(3 * (J[2] - J[1]) / J[3])  -- [rad/s] of small librations
local m = math.sin(p.angle) ^ 2
local period = 4 * elliptic.K(m) / w

local function truth(t)                            -- angle from the vertical, released at rest
  local _, cn, dn = elliptic.jacobi(w * t, m)
  return math.asin(math.sin(p.angle) * cn / dn)
end

local body = vehicle("vehicle.yaml"):body "body"

initial {
  body = {
    position = { p.radius, 0, 0 }, velocity = { 0, n * p.radius, 0 },        -- the orbit is the x-y plane
    orientation = { axis = { 0, 0, 1 }, angle = p.angle }, rate = { 0, 0, n },
  },
}

mission {
  title = "libration by the gradient of gravity",
  duration = period,
  integrator = { method = "dopri5", relative = 1e-11 },
  output = { period = "20 s" },
}

local log = signals {
  ["libration/angle"] = { unit = "deg", meaning = "of the long axis from the vertical, forwards" },
  ["libration/truth"] = { unit = "deg", meaning = "the same by elliptic functions" },
}
local worst = persist { angle = 0, out_of_plane = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays
local function angle()
  local x, y = body:position()
  local axis = quat.rotate({ body:attitude() }, { 1, 0, 0 })
  see("out_of_plane", math.abs(axis[3]))
  return math.atan(x * axis[2] - y * axis[1], x * axis[1] + y * axis[2])
end
controller {
  name = "comparison", period = "20 s",
  step = function(t)
    local now, known = angle(), truth(t)
    see("angle", math.abs(now - known))
    log["libration/angle"](math.deg(now))
    log["libration/truth"](math.deg(known))
  end,
}

figure { name = "period of the libration over that of the orbit", value = function() return period * n / (2 * math.pi) end }

-- The angle is the difference of two turns of 6 rad each at 1e-11 in a step; the satellite's own pull on its orbit is (size / radius)^2 = 1e-13.
check { name = "libration by elliptic functions", unit = "rad", value = function() return worst.angle end, below = 1e-8 }
check { name = "back after one period", unit = "rad", value = function() return angle() end, equal = { p.angle, tolerance = 1e-8 } }
check { name = "motion stays in the plane", value = function() angle() return worst.out_of_plane end, below = 1e-12 }
check {
  name = "radius of the orbit stays", unit = "m", equal = { p.radius, tolerance = 1e-3 },
  value = function() return vec.norm { body:position() } end,
}
