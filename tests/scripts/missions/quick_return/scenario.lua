-- The quick return of a shaper: the pin of a crank slides in the slot of a rocker, which moves a ram by a link. The crank's angle a tells the
-- rocker's r, tan r = (h + c sin a) / (c cos a), the link's u, L sin r - h + l sin u = H, and the ram's place x = L cos r + l cos u, and so
-- all inertia and weight as of one motion. Rocker and link are given nearly; the block has to turn by 0.9 rad into its slot.
local p = parameters { method = "dop853" }
local sat = vehicle "vehicle.yaml"
mission { duration = "2 s", integrator = { method = p.method, relative = 1e-11 } }
local c, h, L, l, H, g = 0.1, 0.2, 0.5, 0.2, 0.3, 9.81

local function posture(a)
  local x, y = c * math.cos(a), h + c * math.sin(a)
  local r, dr = math.atan(y, x), (c * c + c * h * math.sin(a)) / (x * x + y * y)
  local s = (H + h - L * math.sin(r)) / l
  local u, du = math.pi - math.asin(s), L * math.cos(r) * dr / (l * math.sqrt(1 - s * s))
  local ram, dram = L * math.cos(r) + l * math.cos(u), -L * math.sin(r) * dr - l * math.sin(u) * du
  local ex, ey = -L * math.sin(r) * dr, L * math.cos(r) * dr              -- of the rocker's end, as a moves
  local lx, ly = ex - l / 2 * math.sin(u) * du, ey + l / 2 * math.cos(u) * du
  local J = 0.008 + 2 * 0.05 ^ 2 + 0.5 * c * c + (1e-3 + 0.06 + 3 * 0.25 ^ 2) * dr ^ 2
    + 3e-3 * du ^ 2 + 0.7 * (lx * lx + ly * ly) + 5 * dram ^ 2
  local V = g * (2 * 0.05 * math.sin(a) + 0.5 * c * math.sin(a) + 3 * 0.25 * math.sin(r) + 0.7 * (L * math.sin(r) + l / 2 * math.sin(u)))
  return { r = r, dr = dr, u = u, du = du, x = ram, dx = dram, J = J, V = V }
end
local function hinge(name) local of = sat:hinge(name) return of:q(), of:v() end
local first, given = posture(0.3), { hinge "crank" }
local function seen()
  local a, rate = hinge "crank"
  local r, dr = hinge "rocker"
  local u, du = hinge "link"
  local x, dx = hinge "ram"
  local now = posture(a)
  return math.max(math.abs(r - now.r), math.abs(r + u - now.u), math.abs(x - now.x)),
    math.max(math.abs(dr - now.dr * rate), math.abs(dr + du - now.du * rate), math.abs(dx - now.dx * rate)),
    math.abs(0.5 * now.J * rate ^ 2 + now.V - 0.5 * first.J * 25 - first.V) / (0.5 * first.J * 25)
end
local starts = { seen() }
check { name = "the start is closed", below = 1e-12, value = function() return math.max(starts[1], starts[2]) end }
check { name = "what holds stays", unit = "rad", equal = { 0.3, tolerance = 0 }, value = function() return given[1] end }
check { name = "its rate, too", unit = "rad/s", equal = { 5, tolerance = 0 }, value = function() return given[2] end }
check { name = "rocker, link and ram", below = 1e-9, value = function() return (seen()) end }
check { name = "their rates", below = 1e-8, value = function() return (select(2, seen())) end }
check { name = "energy", below = 1e-8, value = function() return (select(3, seen())) end }
