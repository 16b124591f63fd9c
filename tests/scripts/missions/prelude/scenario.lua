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
near("sums of three", vec.add({ 1, 2, 3 }, { 1, 1, 1 }, { 2, 3, -4 }), { 4, 6, 0 })
near("products of three", quat.multiply(about_x, about_z, about_x), quat.multiply(quat.multiply(about_x, about_z), about_x))
near("sums", vec.add({ 1, 2, 3 }, vec.sub({ 1, 1, 1 }, { 2, 3, 4 })), { 0, 0, 0 })
local c = 1 / math.sqrt(3)
local axes = { { c, c, c }, { -c, c, c }, { -c, -c, c }, { c, -c, c } }
local torque, sum = { 1, -2, 3 }, { 0, 0, 0 }
local shares = allocation.least_norm(axes)(torque)
for i, u in ipairs(shares) do sum = vec.add(sum, vec.scale(u, axes[i])) end
near("shares add up to the torque", sum, torque)
local small = { { 1e-5 * c, 1e-5 * c, 0 }, { 0, 2e-5, 0 }, { 0, 0, 1e-5 } }
near("small actuators give more", vec.scale(1e-5, allocation.least_norm(small)(torque)), { 1 / c, -1.5, 3 })
for _, wrong in ipairs { { axes, { 1, 2, 3, 4 } }, { { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1, 0 } }, { 1, 2, 3 } } } do
  local good, told = pcall(function() return allocation.least_norm(wrong[1])(wrong[2]) end)
  assert(not good and told:find("allocation.least_norm: expected three numbers, got {", 1, true), told)
end
-- what is forgotten, a quaternion with three numbers, and several values that are no list, are answered by the function that was called
for told, wrong in pairs {
  ["quat.error: expected four numbers w, x, y, z, got nil"] = function() return quat.error { 1, 0, 0, 0 } end,
  ["quat.conjugate: expected four numbers w, x, y, z, got {1, 0, 0}"] = function() return quat.conjugate { 1, 0, 0 } end,
  ["quat.multiply: expected four numbers w, x, y, z, got {1, 2, 3, x}"] = function() return quat.multiply({ 1, 0, 0, 0 }, { 1, 2, 3, "x" }) end,
  ["quat.rotate: expected four numbers w, x, y, z, got {1, 2, 3}"] = function() return quat.rotate({ 1, 2, 3 }, { 1, 0, 0, 0 }) end,
  ["quat.from_axis_angle: expected an angle in rad, got nil"] = function() return quat.from_axis_angle { 1, 0, 0 } end,
  ["vec.unit: expected three numbers, got 2; several values need braces: { bus:rate() }"] = function() return vec.unit(2, 3, 4) end,
  ["vec.dot: expected three numbers, got nil"] = function() return vec.dot { 1, 2, 3 } end,
  ["allocation.least_norm: expected a list of axes, got nil"] = function() return allocation.least_norm() end,
  ["elliptic: expected a number, got x"] = function() return elliptic.jacobi("x", 0.5) end,
  ["elliptic: expected a number, got nothing"] = function() return elliptic.K() end,
  ["cmg.cluster: expected a table with the keys gimbals, spins, h, got nil"] = function() return cmg.cluster() end,
  ["cmg.pyramid: expected a skew in rad, got x"] = function() return cmg.pyramid "x" end,
  ["slew: expected a table with the keys from, "] = function() return slew.plan() end,
} do
  local good, why = pcall(wrong)
  assert(not good and why:find(told, 1, true) and not why:find("cardan.", 1, true), why)
end
near("vectors are lists of numbers as well", { vec.dot(vector { 1, 2, 3 }, { 1, 1, 1 }) }, { 6 })
near("shares do not fight each other", { shares[1] - shares[2] + shares[3] - shares[4] }, { 0 })
-- K and sn, cn, dn by mpmath 1.3 in 30 digits; near m = 1 the complement says what 1 - m is
near("elliptic integral", { elliptic.K(0), elliptic.K(0.5), elliptic.K(1, 1e-10) / 10 }, { math.pi / 2, 1.8540746773013719, 1.28992198263876 })
near("sn, cn, dn", { elliptic.jacobi(1.3, 0.7) }, { 0.89873107626041887, 0.43850023097347298, 0.65924025726183653, 1.1168670969313717 })
near("sn, cn, dn, many turns on", { elliptic.jacobi(-20, 0.2) }, { -0.084396212181001686, 0.99643227535517904, 0.99928747409036398, -18.934052644654575 })
ok, why = pcall(elliptic.K, 1)
assert(not ok and why:find("expected a parameter 0 <= m < 1, got 1", 1, true), why)
ok, why = pcall(elliptic.K, 0.5, 0.9)
assert(not ok and why:find("expected m1 = 1 - m, got 0.9", 1, true), why)
ok, why = pcall(orbit.state, { a = 7e6, p = 9e6 }, 4e14)
assert(not ok and why:find("expected a or p, not both", 1, true), why)
-- Control moment gyros in a pyramid: momenta and their slopes as in the books [Wie 1998, Space Vehicle Dynamics and Control, 7.4].
local sb, cb = math.sqrt(2 / 3), math.sqrt(1 / 3)
local pyramid = cmg.pyramid()
pyramid.h = 3
local gyros, x = cmg.cluster(pyramid, { lambda = 0 }), { 0.3, -0.7, 1.2, 0.4 }
local s, co = {}, {}
for i = 1, 4 do s[i], co[i] = math.sin(x[i]), math.cos(x[i]) end
near("momentum of a pyramid", vec.scale(1 / 3, gyros.momentum(x)),
  { -cb * s[1] - co[2] + cb * s[3] + co[4], co[1] - cb * s[2] - co[3] + cb * s[4], sb * (s[1] + s[2] + s[3] + s[4]) })
near("slope of the first", vec.scale(1 / 3, gyros.jacobian(x)[1]), { -cb * co[1], -s[1], sb * co[1] })
near("slope of the second", vec.scale(1 / 3, gyros.jacobian(x)[2]), { s[2], -cb * co[2], sb * co[2] })
local wanted = { 0.2, -0.1, 0.3 }
local rates = gyros.rates(wanted, x)
near("rates give what is wanted", gyros.momentum_rate(x, rates), wanted)
-- Least norm: the rates are in the span of the rows, across what changes nothing: the fourfold vector product of the columns.
local C, null = gyros.jacobian(x), {}
for i = 1, 4 do
  local o = {}
  for k = 1, 4 do if k ~= i then o[#o + 1] = C[k] end end
  null[i] = (i % 2 == 0 and 1 or -1) * vec.dot(o[1], vec.cross(o[2], o[3]))
end
near("null motion changes nothing", vec.scale(0.01, gyros.momentum_rate(x, null)), { 0, 0, 0 })
near("least norm", { (rates[1] * null[1] + rates[2] * null[2] + rates[3] * null[3] + rates[4] * null[4]) / 100 }, { 0 })
-- At a singular place, where no torque is had along x: damped, the rates solve (A* A + lambda) rates = A* h', which is least of a sum of squares.
local singular = { -math.pi / 2, 0, math.pi / 2, 0 }
near("singular", { gyros.measure(singular), gyros.measure { 0, 0, 0, 0 } }, { 0, 2 / 3 * 2 / 3 * 8 / 3 })
assert(not pcall(gyros.rates, wanted, singular))
local damped = cmg.cluster(pyramid, { lambda = 0.02, epsilon = 0 })
rates = damped.rates(wanted, singular)
local left, J = vec.scale(1 / 3, vec.sub(wanted, damped.momentum_rate(singular, rates))), damped.jacobian(singular)
for i = 1, 4 do near("damped " .. i, { vec.dot(J[i], left) / 3 }, { 0.02 * rates[i] }) end
-- With nothing but a torque along the singular direction the diagonal gives none; off it some rate is left.
local u = vec.unit(vec.cross(J[1], J[2]))
local still = damped.rates(u, singular)
near("stuck", still, { 0, 0, 0, 0 })
local away = cmg.cluster(pyramid).rates(u, singular, 0.3)
assert(math.abs(away[1]) + math.abs(away[2]) > 1e-5, "it stays in its singular place")
local slow = cmg.cluster(pyramid, { lambda = 0, max_rate = 0.01 }).rates(wanted, x)
near("slower, alike", vec.cross({ slow[1], slow[2], slow[3] }, vec.scale(30, { table.unpack(gyros.rates(wanted, x), 1, 3) })), { 0, 0, 0 })
near("no faster", { math.max(math.abs(slow[1]), math.abs(slow[2]), math.abs(slow[3]), math.abs(slow[4])) }, { 0.01 })
ok, why = pcall(cmg.cluster, { gimbals = { { 1, 0, 0 } }, spins = { { 1, 0, 0 } }, h = 1 })
assert(not ok and why:find("unit vectors at right angles for gyro 1", 1, true), why)
