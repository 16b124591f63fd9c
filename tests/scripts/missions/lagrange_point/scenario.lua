-- The restricted problem of three bodies in a frame that turns with two of them: poles about L4 in closed form, and Jacobi's integral of an orbit
-- about L1. Masses pull from nodes of a body that a mission turns.
local mu = 0.012150585609624
device {
  type = "lua/primaries", mounts = { at = "node", earth = { reads = "node" }, moon = { reads = "node" } }, params = { mass = { 2, "kg" }, mu = mu }, in_step = true,
  evaluate = function(a)
    local function pull(m, place)
      local way = vec.sub(place, a.at.position)
      return vec.scale(a.mass * m / vec.norm(way) ^ 3, way)
    end
    local f, R = vec.add(pull(1 - a.mu, a.earth.position), pull(a.mu, a.moon.position)), a.at.R
    return { at = { force = { R[1] * f[1] + R[4] * f[2] + R[7] * f[3], R[2] * f[1] + R[5] * f[2] + R[8] * f[3], R[3] * f[1] + R[6] * f[2] + R[9] * f[3] } } }
  end,
}
local sat = vehicle "vehicle.yaml"
mission { duration = 2.75, integrator = { method = "dop853", relative = 1e-12 } }
initial { trojan = { position = { 0.5 - mu, math.sqrt(3) / 2, 0 } }, halo = { position = { 0.8233901862, 0, -0.002987637 }, velocity = { 0, 0.1264751431, 0 } } }

-- s^4 + s^2 + 27 mu (1 - mu) / 4 = 0 in the plane [Routh 1875], and once for each turn across it; the model has twelve digits of a pull that differs.
local poles = sat:linearize {}.poles
local D = math.sqrt(1 - 27 * mu * (1 - mu))
for _, w in ipairs { math.sqrt((1 - D) / 2), math.sqrt((1 + D) / 2), 1 } do
  local least = math.huge
  for _, p in ipairs(poles) do least = math.min(least, math.sqrt(p.re ^ 2 + (p.im - w) ^ 2)) end
  check { name = string.format("about L4 by %.4f", w), below = 1e-9, value = function() return least end }
end
check { name = "stays at L4", unit = "m", below = 1e-11, value = function() return vec.norm { sat:hinge "trojan":q(1) - 0.5 + mu, sat:hinge "trojan":q(2) - math.sqrt(3) / 2, sat:hinge "trojan":q(3) } end }

local halo = sat:hinge "halo"
local function jacobi()
  local x, y, z, u, v, w = halo:q(1), halo:q(2), halo:q(3), halo:v(1), halo:v(2), halo:v(3)
  return x * x + y * y + 2 * (1 - mu) / vec.norm { x + mu, y, z } + 2 * mu / vec.norm { x - 1 + mu, y, z } - u * u - v * v - w * w
end
local first = jacobi()
check { name = "Jacobi's integral", below = 1e-11, value = function() return math.abs(jacobi() - first) end }
