-- A row of balls that touch is struck: by the law of Hertz they do not hand on all of it, the first ones come back [Herrmann & Schmaelzle 1981; Hinch & Saint-Jean 1999].
-- What each leaves with is the same however hard they are: s'' = k / m d^1.5 has lengths of v^0.8 and times of v^-0.2 (m / k)^0.4.
local sat = vehicle "vehicle.yaml"
mission { duration = "20 ms", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "1 kHz" } }

-- With m = k = v = 1, by leaps of fourth order [Yoshida 1990].
local x, v, h = { 0, 0, 0, 0, 0 }, { 1, 0, 0, 0, 0 }, 2e-3
local outer = 1 / (2 - 2 ^ (1 / 3))
for _ = 1, 8000 do
  for _, share in ipairs { outer, 1 - 2 * outer, outer } do
    for i = 1, 5 do x[i] = x[i] + share * h / 2 * v[i] end
    for i = 1, 4 do
      local push = share * h * math.max(x[i] - x[i + 1], 0) ^ 1.5
      v[i], v[i + 1] = v[i] - push, v[i + 1] + push
    end
    for i = 1, 5 do x[i] = x[i] + share * h / 2 * v[i] end
  end
end
check { name = "the first one comes back", unit = "m/s", value = function() return v[1] end, equal = { -0.071, tolerance = 5e-4 } }
for _, row in ipairs { "a", "b" } do
  for i = 1, 5 do
    check { name = row .. i, unit = "m/s", value = function() return (sat:body(row .. i):velocity()) end, equal = { v[i], tolerance = 1e-8 } }
  end
end
