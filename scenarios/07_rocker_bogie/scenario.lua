-- A rover of six driven wheels climbs a slope of 10 degrees whose ground has waves, others on the left than on the right. The ground is made of
-- springs: it pushes on a wheel that is in it along its normal, and rubs where the wheel slips. Rockers and bogies follow, the differential
-- carries the body by their mean.

local radius = 0.15
device {
  type = "lua/ground", in_step = true, mounts = { at = "node" },
  params = { slope = { 0.17632698070846498, "1" }, height = { 0.03, "m" }, length = { 0.9, "m" }, phase = "rad", stiffness = { 2e4, "N/m" },
             damping = { 0.5, "s/m" }, friction = { 0.8, "1" }, creep = { 0.03, "m/s" } },
  outputs = { normal = "N" },
  evaluate = function(a)
    local R, p, w, v = a.at.R, a.at.position, a.at.rate, a.at.velocity
    local k = 2 * math.pi / a.length
    local s, c = math.sin(k * p[1] + a.phase), math.cos(k * p[1] + a.phase)
    local rise = a.slope + a.height * k * c
    local n = (1 + rise ^ 2) ^ 0.5
    local nx, nz = -rise / n, 1 / n                                            -- of the ground, out of it
    local deep = radius - (p[3] - a.slope * p[1] - a.height * s) * nz          -- of the wheel in the ground
    local out = { normal = 0, at = { force = { 0, 0, 0 }, moment = { 0, 0, 0 } } }
    if deep <= 0 then return out end
    local function world(x) return R[1] * x[1] + R[2] * x[2] + R[3] * x[3], R[4] * x[1] + R[5] * x[2] + R[6] * x[3], R[7] * x[1] + R[8] * x[2] + R[9] * x[3] end
    local vx, vy, vz = world(v)
    local wx, wy, wz = world(w)
    local push = a.stiffness * deep * (1 - a.damping * (vx * nx + vz * nz))          -- Hunt and Crossley 1975: no pull, no jump
    if push < 0 then push = 0 end
    -- Of the point of the wheel that touches, -radius n from the hub, along the ground.
    local rx, rz = -radius * nx, -radius * nz
    local along = (vx + wy * rz) * nz - (vz - wy * rx) * nx
    local across = vy + wz * rx - wx * rz
    local slip = (along ^ 2 + across ^ 2 + a.creep ^ 2) ^ 0.5
    local rub = -a.friction * push / slip
    local fx, fy, fz = push * nx + rub * along * nz, rub * across, push * nz - rub * along * nx
    local mx, my, mz = -rz * fy, rz * fx - rx * fz, rx * fy
    local function node(x, y, z) return { R[1] * x + R[4] * y + R[7] * z, R[2] * x + R[5] * y + R[8] * z, R[3] * x + R[6] * y + R[9] * z } end
    return { normal = push, at = { force = node(fx, fy, fz), moment = node(mx, my, mz) } }
  end,
}

local p = parameters { speed = "0.3 m/s", finish = "12 s" }

local rover = vehicle "vehicle.yaml"
local body, left, right = rover:body "body", rover:hinge "left_rocker", rover:hinge "right_rocker"
local wheels, grounds = {}, {}
for _, side in ipairs { "left", "right" } do
  for _, place in ipairs { "front", "middle", "rear" } do
    wheels[#wheels + 1] = rover:hinge(side .. "_" .. place)
    grounds[#grounds + 1] = rover:device("under_" .. side .. "_" .. place)
  end
end

mission {
  title = "a rover on a rocker-bogie climbs a slope of springs",
  duration = p.finish,
  integrator = { method = "dopri5", relative = 1e-8 },
  output = { rate = "20 Hz", reactions = { "left_rocker", "right_rocker" } },
}

-- A drive of each wheel keeps its speed, from rest on.
local m = persist { apart = 0.0, most = 0.0 }
controller {
  name = "drives", rate = "100 Hz",
  step = function(t)
    local speed = p.speed / radius * math.min(t / 2, 1)
    for _, wheel in ipairs(wheels) do wheel:torque(6 * (speed - wheel:rate())) end
    local apart = math.abs(left:angle() + right:angle())
    if not (apart <= m.apart) then m.apart = apart end      -- a NaN stays
    m.most = math.max(m.most, math.abs(left:angle()))
  end,
}

figure { name = "came", unit = "m", value = function() return (body:position()) end }
figure { name = "rockers turned by up to", unit = "deg", value = function() return math.deg(m.most) end }
figure { name = "multiplier of the differential", unit = "1", value = function() return rover:loop("differential"):multiplier() end }
check { name = "rockers turn against each other", unit = "rad", value = function() return m.apart end, below = 1e-12 }
check { name = "wheels on the ground", unit = "1", above = 5.5,
        value = function()
          local n = 0
          for _, ground in ipairs(grounds) do if ground:get "normal" > 0 then n = n + 1 end end
          return n
        end }
