-- A geostationary satellite is left to itself for a month: the Moon and the Sun tilt its orbit, the Earth's equator, which is no circle,
-- pulls it along, light makes the orbit eccentric.

local epoch, dut1 = "2023-01-09T00:00:00 TT", -0.015

local sat = vehicle "vehicle.yaml"
local bus = sat:body "bus"

mission {
  title = "a month of a geostationary satellite",
  duration = "648 h",
  integrator = { method = "dop853", relative = 1e-12 },
  output = { period = "6 h" },
}

local log = signals {
  longitude = { unit = "rad", meaning = "of the satellite, to the east" },
  latitude = { unit = "rad", meaning = "geodetic" },
  inclination = { unit = "rad", meaning = "of the orbit to the equator of J2000" },
}

--- Longitude and latitude now.
local function below()
  local axes = astro.earth_axes(epoch, mission.time(), dut1)
  return astro.geodetic(axes:t() * vector { bus:position() })
end
local function inclination()
  local h = vec.unit(vec.cross({ bus:position() }, { bus:velocity() }))
  return math.acos(h[3])
end

controller {
  name = "tracking", period = "1 h",
  step = function()
    local longitude, latitude = below()
    log.longitude(longitude)
    log.latitude(latitude)
    log.inclination(inclination())
  end,
}

figure { name = "inclination after a month", unit = "deg", value = function() return math.deg(inclination()) end }
figure { name = "longitude at the end", unit = "deg", value = function() return math.deg((below())) end }
-- The mean over years is 0.75 to 0.95 deg a year [Soop 1994]; a month of 27 days has one thirteenth of it, and the Moon's month upon it.
check { name = "the Moon and the Sun tilt the orbit", unit = "deg", value = function() return math.deg(inclination()) end, above = 0.04 }
