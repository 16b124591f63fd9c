-- A load that is let down while it swings; a trolley that picks up speed within one swing of its load, which then hangs still.
local sat = vehicle "vehicle.yaml"
local g = 9.81

-- l x'' + 2 v x' + g x = 0 with l = l_0 + v t: x = J_1(u) / u, u = 2 sqrt(g l) / v [Bossut 1778].
local v, first = 0.5, 1
local function bessel(n, u)
  local sum = 0
  for i = 1, 100 do local x = math.pi * (i - 0.5) / 100; sum = sum + math.cos(n * x - u * math.sin(x)) end
  return sum / 100
end
local function swing(t)
  local l = first + v * t
  local u = 2 * math.sqrt(g * l) / v
  return 1e-4 * bessel(1, u) / u, -1e-4 * bessel(2, u) / u * math.sqrt(g / l)
end
local angle, rate = swing(0)
-- In the frame of the trolley weight leans by b = atan(a / g): it swings by as much on both sides and is at rest below the trolley after a period.
local a, J, mc = 3, 2 + 7 * 4, 14
local b = math.atan(a, g)
local period = 4 * elliptic.K(math.sin(b / 2) ^ 2) / math.sqrt(mc * math.sqrt(g ^ 2 + a ^ 2) / J)
sat:hinge("trolley"):profile { rate_table = { { 0, 0 }, { period, a * period } } }
initial { drum = { angle = angle, rate = rate }, hook = { displacement = first, rate = v } }
mission { duration = period + 1, integrator = { method = "dopri5", relative = 1e-12, absolute = 1e-16 }, output = { rate = "10 Hz" } }
local load = sat:hinge "load"
check { name = "load hangs still", unit = "rad", below = 1e-10, value = function() return math.abs(load:angle()) + math.abs(load:rate()) end }
check { name = "swing", unit = "rad", equal = { (swing(period + 1)), tolerance = 1e-12 }, value = function() return sat:hinge("drum"):angle() end }
