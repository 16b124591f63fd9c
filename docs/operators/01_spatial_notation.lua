-- Vehicle: vehicles/chain.yaml
--
-- # 1 Spatial notation
--
-- Source: Rodriguez, Jain, Kreutz-Delgado 1991; Jain 2011, the chapter on spatial vectors; docs/mathematics/spatial.md.
--
-- A rigid body moves as one thing, but one has to say where one looks at it. At a point x it has the spatial velocity
--
--     V(x) = [ w ; v ]              w: angular velocity, v: velocity of the point
--
-- and what acts on it is, seen from x, the spatial force f(x) = [ n ; f ], moment and force. Angular comes first. The power
-- is f* V, a star being the transpose.

local function skew(a) return matrix { { 0, -a[3], a[2] }, { a[3], 0, -a[1] }, { -a[2], a[1], 0 } } end -- a~ b = a x b

-- ## From point to point
--
-- With l(x,y) the vector from x to y, the rigid body transformation
--
--     phi(x,y) = [ 1  l(x,y)~ ; 0  1 ]
--
-- takes forces from y to x, and its transpose takes velocities from x to y:
--
--     f(x) = phi(x,y) f(y)          V(y) = phi*(x,y) V(x)

local function phi(l) -- with a rotation R, components in axes at y become components in axes at x: [ R  l~R ; 0  R ]
  return function(R)
    R = R or matrix { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }
    local lR, rows = skew(l) * R, {}
    for i = 1, 3 do
      rows[i] = { R(i, 1), R(i, 2), R(i, 3), lR(i, 1), lR(i, 2), lR(i, 3) }
      rows[i + 3] = { 0, 0, 0, R(i, 1), R(i, 2), R(i, 3) }
    end
    return matrix(rows)
  end
end
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end

local x, y, z = { 1, 0, 2 }, { 0.5, -1, 0.3 }, { -2, 0.7, 1 }
local xy, yz, xz = vec.sub(y, x), vec.sub(z, y), vec.sub(z, x)
local Vx = vector { 0.3, -0.2, 0.5, 1, 2, -1 }
local fy = vector { 1, 4, -2, 10, 0, 5 }

local Vy, fx = phi(xy)():t() * Vx, phi(xy)() * fy
assert(same(Vy, vector { 0.3, -0.2, 0.5, 1 + 0.84, 2 + 0.26, -1 - 0.4 })) -- v + w x l, by hand
print(string.format("velocity at x: (%.6g, %.6g, %.6g) m/s, at y: (%.6g, %.6g, %.6g) m/s", Vx[4], Vx[5], Vx[6], Vy[4], Vy[5], Vy[6]))
print(string.format("moment at y: (%.6g, %.6g, %.6g) N m, at x: (%.6g, %.6g, %.6g) N m", fy[1], fy[2], fy[3], fx[1], fx[2], fx[3]))

-- The power cannot depend on where one looks. That is why the same phi stands in both lines, once with a star:
assert(math.abs(fx:dot(Vx) - fy:dot(Vy)) < 1e-12 * math.abs(fx:dot(Vx)))
print(string.format("power: %.6g W, seen from either point", fx:dot(Vx)))

-- One goes from x to z by way of any y, and back:
assert(same(phi(xy)() * phi(yz)(), phi(xz)())) -- phi(x,y) phi(y,z) = phi(x,z)
local back = phi(vec.scale(-1, xy))()
assert((phi(xy)() * back - phi({ 0, 0, 0 })()):max_abs() < 1e-15) -- phi(x,y)^-1 = phi(y,x)

-- ## From frame to frame
--
-- Here each body has its own axes, and phi includes their rotation R_AB (B axes to A axes):
--
--     Phi(A,B) = [ R  l~ R ; 0  R ]          f_A = Phi f_B,   V_B = Phi* V_A
--
-- In a chain Phi(p,k) leads from body k to its inboard body p. The program collects all of them in one operator, E_phi: block
-- (p,k) of it is Phi(p,k), and there is nothing else in it. In this vehicle the upper arm hangs at (0.1, 0, 0.4) m of the
-- shoulder and is turned by its angle about y.

local s = sim:operators()
local E = s.E_phi:dense()
print(s.E_phi)

local a = sim:q()["upper.angle"]
local R = matrix { { math.cos(a), 0, math.sin(a) }, { 0, 1, 0 }, { -math.sin(a), 0, math.cos(a) } }
local Phi = phi { 0.1, 0, 0.4 }(R)
for i = 1, 6 do
  for j = 1, 6 do
    assert(math.abs(E(i, 6 + j) - Phi(i, j)) < 1e-15) -- shoulder's rows, upper arm's columns
    assert(E(6 + i, j) == 0 and E(i, j) == 0 and E(i, 12 + j) == 0) -- only from a body to its inboard one
  end
end

-- A row of it, read aloud: the moment about y at the shoulder that a unit force along the arm, at its hinge, makes.
print(string.format("row shoulder:ny, column upper:fx: %.6g m", E("shoulder:ny", "upper:fx")))
assert(math.abs(E("shoulder:ny", "upper:fx") - (0.4 * math.cos(a) + 0.1 * math.sin(a))) < 1e-15)
