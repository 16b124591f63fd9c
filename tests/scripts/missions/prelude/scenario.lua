-- The helpers that every script has.
vehicle "../phases/vehicle.yaml"
mission { duration = "10 ms" }
local function near(name, a, b)
  check { name = name, below = 1e-14, value = function()
    local worst = 0
    for i = 1, #b do worst = math.max(worst, math.abs(a[i] - b[i])) end
    return worst
  end }
end
local r = math.sqrt(0.5)
local about_z, about_x = quat.from_axis_angle({ 0, 0, 2 }, math.pi / 2), { r, r, 0, 0 }
near("quarter turn", about_z, { r, 0, 0, r })
near("rotate", quat.rotate(about_z, { 1, 2, 3 }), { -2, 1, 3 })
near("product turns twice", quat.rotate(quat.multiply(about_x, about_z), { 1, 0, 0 }), quat.rotate(about_x, { 0, 1, 0 }))
near("conjugate turns back", quat.rotate(quat.conjugate(about_z), { -2, 1, 3 }), { 1, 2, 3 })
near("error is in body axes", quat.error(about_x, quat.multiply(about_x, quat.from_axis_angle({ 0, 0, 1 }, 0.3))), { 0, 0, 0.3 })
near("error takes the shorter way", quat.error({ 1, 0, 0, 0 }, { -math.cos(0.1), 0, math.sin(0.1), 0 }), { 0, -0.2, 0 })
near("small errors keep their digits", vec.scale(1e9, quat.error({ 1, 0, 0, 0 }, quat.from_axis_angle({ 1, 0, 0 }, 1e-9))), { 1, 0, 0 })
near("scale takes either order", vec.scale({ 1, 2, 3 }, 2), { 2, 4, 6 })
local ok, why = pcall(vec.scale, { 1, 2, 3 }, { 1, 2, 3 })
assert(not ok and why:find("expected a number and an array of three numbers, got table and table", 1, true))
near("cross", vec.cross({ 1, 0, 0 }, { 0, 2, 0 }), { 0, 0, 2 })
near("unit", vec.unit { 0, 3, 4 }, { 0, 0.6, 0.8 })
near("sums", vec.add({ 1, 2, 3 }, vec.sub({ 1, 1, 1 }, { 2, 3, 4 })), { 0, 0, 0 })
local c = 1 / math.sqrt(3)
local axes = { { c, c, c }, { -c, c, c }, { -c, -c, c }, { c, -c, c } }
local torque, sum = { 1, -2, 3 }, { 0, 0, 0 }
local shares = allocation.least_norm(axes)(torque)
for i, u in ipairs(shares) do sum = vec.add(sum, vec.scale(u, axes[i])) end
near("shares add up to the torque", sum, torque)
near("shares do not fight each other", { shares[1] - shares[2] + shares[3] - shares[4] }, { 0 })
-- K and sn, cn, dn by mpmath 1.3 in 30 digits; near m = 1 the complement says what 1 - m is
near("elliptic integral", { elliptic.K(0), elliptic.K(0.5), elliptic.K(1, 1e-10) / 10 }, { math.pi / 2, 1.8540746773013719, 1.28992198263876 })
near("sn, cn, dn", { elliptic.jacobi(1.3, 0.7) }, { 0.89873107626041887, 0.43850023097347298, 0.65924025726183653, 1.1168670969313717 })
near("sn, cn, dn, many turns on", { elliptic.jacobi(-20, 0.2) }, { -0.084396212181001686, 0.99643227535517904, 0.99928747409036398, -18.934052644654575 })
ok, why = pcall(elliptic.K, 1)
assert(not ok and why:find("expected a parameter 0 <= m < 1, got 1", 1, true), why)
