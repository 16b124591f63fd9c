-- Vehicle: vehicles/body.yaml
--
-- # 2 One rigid body about any frame
--
-- Source: Jain 2011, the chapter on the dynamics of a single rigid body; docs/mathematics/spatial.md sections 2 and 3.
--
-- Mass m, mass centre c seen from the origin of frame B, inertia J_c about the mass centre. About the origin J = J_c - m c~ c~
-- (parallel axes), and with h = m c the spatial inertia is
--
--     M = [ J    h~ ]          momentum M V,   kinetic energy 1/2 V* M V
--         [ -h~  m  ]

local s, sat = sim:operators(), sim:vehicle()
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end
local function cat(a, b) return vector { a[1], a[2], a[3], b[1], b[2], b[3] } end
local function low(x) return { x[1], x[2], x[3] } end
local function high(x) return { x[4], x[5], x[6] } end
local function skew(a) return matrix { { 0, -a[3], a[2] }, { a[3], 0, -a[1] }, { -a[2], a[1], 0 } } end

local m, c = 12, { 0.1, -0.2, 0.3 }
local J_c = matrix { { 0.9, 0.05, 0 }, { 0.05, 1.1, -0.1 }, { 0, -0.1, 0.7 } }
local h, J = vec.scale(m, c), J_c - m * (skew(c) * skew(c))

local M = s.M:dense()
print(string.format("mass %.6g kg, moments about the origin (%.6g, %.6g, %.6g) kg m^2", M(4, 4), M(1, 1), M(2, 2), M(3, 3)))
for i = 1, 3 do
  for j = 1, 3 do
    assert(math.abs(M(i, j) - J(i, j)) < 1e-14 and math.abs(M(i, 3 + j) - skew(h)(i, j)) < 1e-14)
    assert(M(3 + i, 3 + j) == (i == j and m or 0) and math.abs(M(3 + i, j) + skew(h)(i, j)) < 1e-14)
  end
end

-- ## Velocity
--
-- The hinge `free` has the velocities v = [ w in body axes ; velocity of the origin in world axes ]. H* turns the second into
-- body axes: V = H* v. For one body phi = 1, and H* v is the whole kinematics.

local v = sim:v()
local V = s.H:star() * v
local attitude = { sat:body("body"):attitude() }
assert(same(V, cat(low(v), quat.rotate(quat.conjugate(attitude), high(v)))))

-- ## Two frames, one body
--
-- `corner` is a node of the body: other point, other axes. B* takes the velocity there, V_N = B* V, and the inertia of the body
-- seen from there is N with M = B N B*, or N = B^-1 M B^-*. Energy does not care:

local B = s:nodes("body.corner"):dense()
local V_N = s:nodes("body.corner"):star() * V
local N = B:solve(B:solve(M):t()) -- B^-1 (B^-1 M)*, M being symmetric
local T, T_N = 0.5 * V:dot(s.M * V), 0.5 * V_N:dot(N * V_N)
assert(math.abs(T - T_N) < 1e-12 * T)
assert(math.abs(N(4, 4) - m) < 1e-12) -- the mass stays where it is
print(string.format("kinetic energy %.6g J; moments about the corner (%.6g, %.6g, %.6g) kg m^2", T, N(1, 1), N(2, 2), N(3, 3)))

-- The momentum M V goes from frame to frame as a force does:
assert(same(s.M * V, s:nodes("body.corner") * (N * V_N)))

-- ## Equations of motion
--
-- With gamma = [ w' ; acceleration of the origin ], in body axes,
--
--     f = M gamma + b,      b = [ w x J w ; w x (w x h) ]          for any point of the body
--
-- No velocity of the origin in it: that is why gamma, not the derivative of V in body axes, is taken (spatial.md section 3).
-- Nothing acts on this body, so gamma = -M^-1 b.

local w = low(V)
local function b_of(J, h)
  local Jw = J * vector(w)
  return cat(vec.cross(w, { Jw[1], Jw[2], Jw[3] }), vec.cross(w, vec.cross(w, h)))
end
local gamma = -(s.M:inv() * b_of(J, h))
local vdot = sim:vdot()
assert(same(gamma, cat(low(vdot), quat.rotate(quat.conjugate(attitude), high(vdot)))))
print(string.format("angular acceleration (%.6g, %.6g, %.6g) rad/s^2", gamma[1], gamma[2], gamma[3]))

-- About the mass centre, h = 0: the two halves separate into the laws of Euler and Newton, J_c w' + w x J_c w = 0 and m a = 0.
local euler = J_c * vector(low(gamma)) + vector(low(b_of(J_c, { 0, 0, 0 })))
assert(euler:max_abs() < 1e-12)
local a_c = vec.add(high(gamma), vec.add(vec.cross(low(gamma), c), vec.cross(w, vec.cross(w, c)))) -- of the mass centre
assert(vec.norm(a_c) < 1e-13)

-- The factors of the mass matrix are there already, if only one of each: H M H*.
assert(same((s.H * s.M * s.H:star()):dense(), s.mass:dense()))
