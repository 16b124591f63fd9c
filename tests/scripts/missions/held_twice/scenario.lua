-- Ellipse trammels, bars of 1 m between sliders that friction holds, each by itself enough, are struck: one by a blow, one by a clutch that grips a wheel [Coulomb 1785].
-- At the angle u of a bar its sliders are at cos u and sin u, so that m u'^2 is their energy, and what they have is spent where X (x_0 - x) + Y (y - y_0) is
-- as much. A rack of the radius r adds J (cos u / r)^2 to their inertia.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 s", integrator = { method = "dopri5", relative = 1e-10 }, output = { rate = "10 Hz" } }
local I, X, Y, J, r, start = 1 + 0.25 + 0.08, 2, 3, 0.3, 0.4, math.rad(40)
local lever = math.cos(start)
controller { name = "kick", rate = "10 Hz", step = function(t) sat:device("kick"):set("fire", t == 0.2 and 1 or 0) end }
sequence { name = "grip", run = function() at "0.2 s" sat:close "clutch" end }
local function stops(name, energy)
  local low, high = start, math.rad(89)
  for _ = 1, 60 do
    local u = 0.5 * (low + high)
    if X * (lever - math.cos(u)) + Y * (math.sin(u) - math.sin(start)) < energy then low = u else high = u end
  end
  local hinge = sat:hinge(name)
  check { name = name .. " stops", unit = "m", equal = { math.sin(low), tolerance = 1e-9 }, value = function() return hinge:q() end }
  check { name = name .. " stands still", unit = "m/s", equal = { 0, tolerance = 1e-12 }, value = function() return hinge:v() end }
end
stops("across", (1.5 * lever) ^ 2 / (2 * I))
local both = I + J * (lever / r) ^ 2
stops("geared", (J * 2 * lever / r) ^ 2 / (2 * both))

-- At each dead centre of the crank both of its sliders stop at once, and none stays. They have gone by 0.1 m for each half turn and a part of it.
local crank = sat:hinge "crank"
local function gone()
  local half = math.floor(crank:angle() / math.pi)
  return 0.1 * (2 * half - 1 + 1 - math.cos(crank:angle() - math.pi * half))
end
local function energy() return 0.5 * (0.2 + (2 + 0.5 * 4) * (0.1 * math.sin(crank:angle())) ^ 2) * crank:rate() ^ 2 end
check { name = "crank and sliders", unit = "J", equal = { 0.5 * 0.24 * 100, tolerance = 1e-8 }, value = function() return energy() + (1 + 2 * 2) * gone() end }
