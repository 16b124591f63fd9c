-- A ring of angulated scissors unfolds by itself [Hoberman 1990]: n pairs of bars with arms p, bent by 2 pi / n, whose ends stay on the n lines between them.
-- At the angle u of the arms to the normals of these lines the middles are at r = p cos u / sin(pi / n), so that m r'^2 + I u'^2 of each bar is kept. Of its
-- 49 ways to move the 25 loops leave 3, and nothing pushes the slide.
local n, p, m, I = 24, 0.5, 0.3, 0.01
local sat = vehicle "vehicle.yaml"
mission { duration = "6 s", output = { rate = "10 Hz" } }
local function speed(u) return math.sqrt(m * (p * math.sin(u) / math.sin(math.pi / n)) ^ 2 + I) end
local from, to, rate, steps = 1, 0.2, 0.4, 400
local way = speed(from) + speed(to)                                          -- by Simpson's rule
for i = 1, steps - 1 do way = way + (i % 2 == 0 and 2 or 4) * speed(from + (to - from) * i / steps) end
local time = way * (from - to) / steps / 3 / (speed(from) * rate)
local found = persist {}
event { name = "unfolded", direction = "falling", when = function() return sat:hinge "B1":angle() - 2 * to end,
        action = function() found.t, found.r = mission.time(), sat:hinge "slide":q() stop() end }
check { name = "ways to move", unit = "1", value = function() return sat:closed_system():mobility() end, equal = { 3, tolerance = 0 } }
check { name = "unfolded at", unit = "s", value = function() return found.t end, equal = { time, tolerance = 1e-8 } }
check { name = "radius", unit = "m", value = function() return found.r end, equal = { p * math.cos(to) / math.sin(math.pi / n), tolerance = 1e-8 } }
