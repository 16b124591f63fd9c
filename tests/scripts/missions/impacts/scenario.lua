-- Blows whose length, slip or rhythm is known, and a follower that leaves its cam.

-- A mass on a spring, of the rate 100, that is shaken with F / m = A (100^2 - w^2) at w = 280 and strikes a wall at d with e = 0.8, once in two periods of the
-- shaker [Shaw & Holmes 1983]. It flies as a cos + b sin + A cos(w t + phase) with b = - (1 + e) u / 2 and a = b sin / (1 - cos) over the flight, u what it
-- strikes with, where A w sin(phase) = - (1 - e) u / 2 and A cos(phase) = d - a.
local rate, w, d, e = 100, 280, 0.2, 0.8
local A, flight = 1e4 / (rate ^ 2 - w ^ 2), 4 * math.pi / w
local s, c = math.sin(rate * flight), math.cos(rate * flight)
local k, l = (1 + e) * s / (2 * (1 - c)), (1 - e) * rate / (2 * w)            -- of u / rate
local u = rate * (math.sqrt((k * d) ^ 2 + (k ^ 2 + l ^ 2) * (A ^ 2 - d ^ 2)) - k * d) / (k ^ 2 + l ^ 2)
local a, b = d + k * u / rate, -(1 + e) * u / (2 * rate)
a = b * s / (1 - c)
local phase = math.atan(-l * u / rate / A, (d - a) / A)
local sat = vehicle("vehicle.yaml", { ["devices.shaker.tones[0][1]"] = phase + math.pi / 2 })
mission { duration = "0.15 s", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "1 kHz" } }
initial { shaken = { displacement = d, rate = -e * u } }
local function is(name, unit, expected, tolerance, value) check { name = name, unit = unit, value = value, equal = { expected, tolerance = tolerance } } end

-- A ball touches a plane for 2 integral_0^1 dx / sqrt(1 - x^2.5) = 2.943275 times its greatest depth (5 m v^2 / 4 k)^(2/5) over v [Hertz 1881].
local depth = (1.25 * 2 / 1e8) ^ 0.4
is("place after a blow of Hertz", "m", 0.1 + (0.15 - 0.01 - 2.9432751894 * depth), 1e-8, function() return (select(3, sat:body "round":position())) end)
is("speed after it", "m/s", 1, 1e-9, function() return (select(3, sat:body "round":velocity())) end)

-- One that skids all through its blow loses mu (1 + e) v along the plane and spins by what that has about its middle, at half the depth.
local skid, lost = sat:body "skid", 0.2 * 1.5
is("speed up", "m/s", 0.5, 1e-6, function() return (select(3, skid:velocity())) end)
is("speed along", "m/s", 3 - lost, 1e-6, function() return (skid:velocity()) end)
is("spin", "rad/s", lost * 2 * 0.1 / 8e-3, 0.5 * lost * 2 * 4e-3 / 8e-3, function() return (select(2, skid:rate())) end)

local shaken, last = sat:hinge "shaken", 0.15 - 3 * flight
is("place of what strikes a wall", "m", a * math.cos(rate * last) + b * math.sin(rate * last) + A * math.cos(w * last + phase), 1e-7, function() return shaken:q() end)
is("its speed", "m/s", -a * rate * math.sin(rate * last) + b * rate * math.cos(rate * last) - A * w * math.sin(w * last + phase), 1e-5, function() return shaken:v() end)

-- The follower is pressed on its cam by F until m E W^2 sin(W t) is more than what springs give, F + k E sin(W t), and then flies by itself.
local E, W, F, m, spring = 0.01, 40, 12, 1, 200
local leaves = math.asin(F / (m * E * W ^ 2 - spring * E)) / W
local own, middle = math.sqrt(spring / m), -F / spring
local seen = persist {}
controller { name = "look", rate = "50 Hz", step = function(t) if t == 0.06 then seen.place, seen.on = sat:hinge "follower":q(), sat:device "touch":get "touching" end end }
local flown = own * (0.06 - leaves)
is("follower in flight", "m", middle + (E * math.sin(W * leaves) - middle) * math.cos(flown) + E * W * math.cos(W * leaves) / own * math.sin(flown), 3e-6, function() return seen.place end)
is("off the cam", "1", 0, 0, function() return seen.on end)
