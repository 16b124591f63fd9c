-- Vehicle: vehicles/two_arms.yaml
--
-- # 14 A floating base
--
-- Source: Umetani, Yoshida 1989 (generalised Jacobian); Jain, Rodriguez 1995 (IEEE Trans. Robotics and Automation 11(4):
-- free-flying manipulators); Jain 2011; docs/mathematics/tree_algorithms.md section 9.
--
-- A spacecraft is a tree whose base hangs on the world by a hinge that holds nothing: v = [ v_b ; v_m ], six numbers of the base, then
-- those of the arms. What nobody can change from inside is momentum.

local s, sat = sim:operators(), sim:vehicle()
local mass = s.mass:dense()
local n, nm = #sim:v(), #sim:v() - 6
local function part(A, r0, r, c0, c)
  local rows = {}
  for i = 1, r do
    rows[i] = {}
    for j = 1, c do rows[i][j] = A(r0 + i, c0 + j) end
  end
  return matrix(rows)
end
local function stack(a, b)
  local x = a:table()
  for _, number in ipairs(b:table()) do x[#x + 1] = number end
  return vector(x)
end

-- ## Momentum
--
-- phi M V gathers momenta as phi gathers forces: its rows of the base are the momentum of the system about the base's origin. H turns
-- the linear part into world axes, since `free` has world velocities: these are the first six rows of H phi M V = (mass matrix) v.

local v = vector { 0.02, -0.01, 0.03, 0.1, -0.2, 0.05, 0.4, -0.3, 0.2, 0.5 }
local V = s.phi:star() * (s.H:star() * v)
local momentum = s.H * (s.phi * (s.M * V))
assert((momentum - s.mass * v):max_abs() < 1e-12 * momentum:max_abs())
print(string.format("momentum (%.6g, %.6g, %.6g) N s, mass %.6g kg", momentum[4], momentum[5], momentum[6], mass(4, 4)))

-- By hand: masses times velocities of mass centres.
local p = { 0, 0, 0 }
local centres = { base = { 0.02, 0, 0.05 }, left_upper = { 0, 0.3, 0 }, left_fore = { 0, 0.25, 0 } }
centres.right_upper, centres.right_fore = { 0, -0.3, 0 }, { 0, -0.25, 0 }
for name, c in pairs(centres) do
  local body = sat:body(name)
  local V_k = {}
  for i, x in ipairs { "wx", "wy", "wz", "vx", "vy", "vz" } do V_k[i] = V[name .. ":" .. x] end
  local v_c = vec.add({ V_k[4], V_k[5], V_k[6] }, vec.cross({ V_k[1], V_k[2], V_k[3] }, c))
  p = vec.add(p, vec.scale(body:mass(), quat.rotate({ body:attitude() }, v_c)))
end
for i = 1, 3 do assert(math.abs(p[i] - momentum[3 + i]) < 1e-12) end

-- ## What the base does when the arms move
--
-- From rest the momentum stays zero: M_bb v_b + M_bm v_m = 0. M_bb is the composite inertia of all (page 5), in the velocities of the
-- base's hinge.

local M_bb, M_bm, M_mm = part(mass, 0, 6, 0, 6), part(mass, 0, 6, 6, nm), part(mass, 6, nm, 6, nm)
local v_m = vector { 0.4, -0.3, 0.2, 0.5 }
local v_b = -(M_bb:solve(M_bm * v_m))
print(string.format("the base turns by (%.6g, %.6g, %.6g) rad/s", v_b[1], v_b[2], v_b[3]))

-- ## Generalised Jacobian
--
-- A hand then moves by V_hand = J_b v_b + J_m v_m = (J_m - J_b M_bb^-1 M_bm) v_m = J_g v_m. It has inertias in it, where a
-- Jacobian on the ground has lengths alone: the base gives way, and the hand moves less.

local B = s:nodes "left_fore.hand"
local J = (B:star() * s.phi:star() * s.H:star()):dense()
local J_b, J_m = part(J, 0, 6, 0, 6), part(J, 0, 6, 6, nm)
local J_g = J_m - J_b * M_bb:solve(M_bm)
sim:state { v = stack(v_b, v_m) }
local hand = sat:node "left_fore.hand"
local seen = quat.rotate(quat.conjugate { hand:attitude() }, { hand:velocity() })
local moves, on_ground = J_g * v_m, J_m * v_m
for i = 1, 3 do assert(math.abs(moves[3 + i] - seen[i]) < 1e-13) end
local function speed_of(x) return vec.norm { x[4], x[5], x[6] } end
print(string.format("left hand: %.6g m/s, with the base held %.6g m/s", speed_of(moves), speed_of(on_ground)))

-- ## The reduced system
--
-- M_g = M_mm - M_mb M_bb^-1 M_bm is the mass matrix of the arms when the base floats, and M splits in two. So does the compliance of
-- the hand:
--
--     det M = det M_bb det M_g          J M^-1 J* = J_b M_bb^-1 J_b* + J_g M_g^-1 J_g*

local M_g = M_mm - M_bm:t() * M_bb:solve(M_bm)
local inverse = s.mass:inv():dense()
assert((M_g * part(inverse, 6, nm, 6, nm) - matrix { { 1, 0, 0, 0 }, { 0, 1, 0, 0 }, { 0, 0, 1, 0 }, { 0, 0, 0, 1 } }):max_abs() < 1e-12)
local compliance = (B:star() * s.omega * B):dense()
local sum = J_b * M_bb:solve(J_b:t()) + J_g * M_g:solve(J_g:t())
assert((compliance - sum):max_abs() < 1e-12 * compliance:max_abs())
local log_det = 0
for _, A in ipairs { M_bb, M_g } do
  for _, eigenvalue in ipairs(A:eigenvalues():table()) do log_det = log_det + math.log(eigenvalue) end
end
assert(math.abs(log_det - s:log_det()) < 1e-12 * math.abs(log_det))
print(string.format("left shoulder: %.6g kg m^2 with the base held, %.6g with the base afloat", M_mm(1, 1), M_g(1, 1)))

-- The kinetic energy at zero momentum needs the arms alone:
local T = 0.5 * sim:v():dot(s.mass * sim:v())
assert(math.abs(T - 0.5 * v_m:dot(M_g * v_m)) < 1e-12 * T)

-- ## And in time
--
-- The arms swing on without motors. The momentum stays zero, and the base turns all the while: without angular momentum one may
-- turn, as cats know.

local before = { sat:body("base"):attitude() }
sim:run_to(2)
local later = sim:operators().mass * sim:v()
for i = 1, 6 do assert(math.abs(later[i]) < 1e-8) end
local turned = quat.error(before, { sat:body("base"):attitude() })
print(string.format("after 2 s the base has turned by %.4g deg", math.deg(vec.norm(turned))))
