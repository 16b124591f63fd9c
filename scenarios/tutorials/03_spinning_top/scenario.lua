-- A heavy symmetric top is let go with its axis at rest: it falls, the spin turns the fall into precession, and it rises to where it was.
-- Height and turn of the axis are elliptic functions and integrals (Lagrange's top). README.md has the formulas.

local mass, arm, g, axial = 0.5, 0.06, 9.81, 4e-4       -- as in vehicle.yaml, SI
local across = 2.5e-4 + mass * arm ^ 2                    -- [kg m^2] about the point
local spin, start = 1500 * math.pi / 30, math.cos(math.rad(40))

-- u = cos(tilt): u'^2 = (start - u) (b (1 - u^2) - a^2 (start - u)), with the roots low < start < 1 < beyond.
local a, b = axial * spin / across, 2 * mass * g * arm / across
local root = math.sqrt(a ^ 4 - 4 * b * (a ^ 2 * start - b))
local low, beyond = (a ^ 2 - root) / (2 * b), (a ^ 2 + root) / (2 * b)
local m = (start - low) / (beyond - low)
local rate = 0.5 * math.sqrt(b * (beyond - low))
local period = 2 * elliptic.K(m) / rate                   -- of the nutation

local function height(t)
  local _, cn, dn = elliptic.jacobi(rate * t, m)
  return low + (start - low) * (cn / dn) ^ 2
end
-- The turn about the vertical in one nutation: trapezoidal rule on a periodic function.
local function turn_of_a_nutation()
  local sum, n = 0, 128
  for k = 0, n - 1 do
    local u = height(k * period / n)
    sum = sum + a * (start - u) / (1 - u * u)
  end
  return sum * period / n
end

local nutations = 5
local sat = vehicle "vehicle.yaml"
local top = sat:body "top"

mission {
  title = "a heavy top: nutation and precession",
  duration = nutations * period,
  integrator = { method = "dopri5", relative = 1e-12 },
  output = { rate = "100 Hz", nodes = { "top.tip" } },
}

local log = signals {
  ["truth/height"] = { unit = "1", meaning = "cosine of the tilt by elliptic functions" },
  ["top/height"] = { unit = "1", meaning = "cosine of the tilt" },
}
local worst = persist { height = 0, spin = 0 }
local function see(name, e) if not (e <= worst[name]) then worst[name] = e end end   -- a NaN stays

controller {
  name = "comparison", rate = "100 Hz",
  step = function(t)
    local axis = quat.rotate({ top:attitude() }, { 0, 0, 1 })
    local _, _, wz = top:rate()
    log["truth/height"](height(t))
    log["top/height"](axis[3])
    see("height", math.abs(axis[3] - height(t)))
    see("spin", math.abs(wz - spin))
  end,
}

figure { name = "period of the nutation", unit = "s", value = function() return period end }
figure { name = "lowest tilt", unit = "deg", value = function() return math.deg(math.acos(low)) end }

-- 160 rad/s for 1.3 s at 1e-12 in each step.
check { name = "height by elliptic functions", value = function() return worst.height end, below = 1e-8 }
check { name = "spin about the axis of symmetry stays", unit = "rad/s", value = function() return worst.spin end, below = 1e-8 }
check {
  name = "precession after five nutations", unit = "rad", below = 1e-7,
  value = function()
    -- A tilt about +x puts the axis at -y; a positive spin precesses about +z.
    local axis = quat.rotate({ top:attitude() }, { 0, 0, 1 })
    local angle = nutations * turn_of_a_nutation() - math.pi / 2
    local s = math.sqrt(1 - start ^ 2)
    return vec.norm(vec.sub(axis, { s * math.cos(angle), s * math.sin(angle), start }))
  end,
}
