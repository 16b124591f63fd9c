-- A bead that a spinning hoop lifts, and one that slides out along a wire that turns.
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = "dopri5", relative = 1e-11 }, output = { rate = "10 Hz" } }
local g = 9.81

-- It stands where cos a = g / (w^2 r), and swings about that at w sin a [Landau & Lifshitz, Mechanics, section 14].
local w, r = 8, 0.4
local a = math.acos(g / (w ^ 2 * r))
local found = sat:equilibrium { move = { "bead" } }
initial(found.initial)
check { name = "angle of the bead", unit = "rad", equal = { a, tolerance = 1e-10 }, value = function() return sat:hinge("bead"):angle() end }
check { name = "swing of the bead", unit = "rad/s", equal = { w * math.sin(a), tolerance = 1e-9 }, value = function()
  for _, pole in ipairs(sat:linearize({ inputs = {}, outputs = {} }).poles) do
    if pole.im > 0 then return pole.im end
  end
end }

-- m (x'' - W^2 x) = -c x', and the wire is driven by 2 m W x x'.
local W, m, c, first, rate = 2, 0.3, 0.4, 0.1, 0.05
local middle, half = -c / (2 * m), math.sqrt((c / (2 * m)) ^ 2 + W ^ 2)
local p, q = middle + half, middle - half
local A = (rate - q * first) / (p - q)
local out, back = A * math.exp(2 * p), (first - A) * math.exp(2 * q)
check { name = "slider", unit = "m", equal = { out + back, tolerance = 1e-9 }, value = function() return sat:hinge("slider"):q() end }
check { name = "moment of the wire", unit = "N m", equal = { 2 * m * W * (out + back) * (p * out + q * back), tolerance = 1e-8 },
  value = function() return sat:hinge("shaft"):applied() end }
