-- Vehicle: vehicles/chain.yaml
--
-- # 4 Dynamics of a serial chain
--
-- Source: Luh, Walker, Paul 1980 (the recursion); Rodriguez, Jain, Kreutz-Delgado 1991 (as operators); Jain 2011, the
-- chapter on the equations of motion of a serial chain; docs/mathematics/tree_algorithms.md sections 1 and 2.
--
-- Accelerations scatter as velocities do, forces gather:
--
--     gamma(k) = Phi*(p,k) gamma(p) + H*(k) v'(k) + a(k)                     gamma = phi* (H* v' + a)
--     f(k)     = M(k) gamma(k) + b(k) + Phi(k,c) f(c), c outboard of k       f     = phi (M gamma + b)
--     tau(k)   = H(k) f(k)                                                   tau   = H f
--
-- f(k) is what the hinge transmits to body k. Put together:
--
--     tau = M(q) v' + C          mass matrix H phi M phi* H*,     C = H phi (M phi* a + b)
--
-- a and b hold the terms of velocity, in gamma form (page 2). Gravity is an acceleration of the ground, gamma(0) = [ 0 ; -g ].

local s, sat = sim:operators(), sim:vehicle()
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end

local v, vdot = sim:v(), sim:vdot() -- v': what the simulation finds for tau = 0
local V = s.phi:star() * (s.H:star() * v)
local Phi, M, h_all = s.E_phi:dense(), s.M:dense(), s.H:star() * v
local function part(x, at) return { x[at + 1], x[at + 2], x[at + 3] } end

-- ## a: what accelerates a body although no hinge does
--
-- For a revolute hinge whose O stands at p of the inboard body A, with R = R_AB (docs/mathematics/hinges.md section 1):
--
--     a = [ R* w_A x h_w ; R* ( w_A x (w_A x p) ) ],      h_w = the angular part of H* v

local names = { "shoulder", "upper", "fore" }
local g = { 0, 0, -9.81 }
local places = { false, { 0.1, 0, 0.4 }, { 0.6, 0, 0 } } -- of the hinges on their inboard bodies
local a = {}
for k = 1, 3 do
  local at, in_A = 6 * (k - 1), 6 * (k - 2)
  local angular, linear
  if k == 1 then -- on the ground, which moves by gamma(0)
    local q = { sat:body(names[1]):attitude() }
    angular, linear = { 0, 0, 0 }, quat.rotate(quat.conjugate(q), vec.scale(-1, g))
  else
    local R = {}
    for i = 1, 3 do
      R[i] = { Phi(in_A + i, at + 1), Phi(in_A + i, at + 2), Phi(in_A + i, at + 3) }
    end
    local Rt = matrix(R):t()
    local w_A = part(V, in_A)
    local turned = Rt * vector(w_A)
    angular = vec.cross({ turned[1], turned[2], turned[3] }, part(h_all, at))
    linear = (Rt * vector(vec.cross(w_A, vec.cross(w_A, places[k])))):table()
  end
  for i = 1, 3 do a[at + i], a[at + 3 + i] = angular[i], linear[i] end
end
a = vector(a)

-- ## b: the force on a body that turns evenly
--
-- b = [ w x J w ; w x (w x h) ], page 2. J and h are in M.

local b = {}
for k = 1, 3 do
  local at = 6 * (k - 1)
  local w, Jw = part(V, at), {}
  for i = 1, 3 do Jw[i] = M(at + i, at + 1) * w[1] + M(at + i, at + 2) * w[2] + M(at + i, at + 3) * w[3] end
  local h = { -M(at + 2, at + 6), M(at + 1, at + 6), -M(at + 1, at + 5) } -- from h~, the upper right block of M
  local gyroscopic, centripetal = vec.cross(w, Jw), vec.cross(w, vec.cross(w, h))
  for i = 1, 3 do b[at + i], b[at + 3 + i] = gyroscopic[i], centripetal[i] end
end
b = vector(b)

-- ## Inverse dynamics
--
-- One scatter, one gather: O(N). No motor works in this vehicle; so for the v' of the simulation the torques must vanish.

local gamma = s.phi:star() * (s.H:star() * vdot + a)
local f = s.phi * (s.M * gamma + b)
local tau = s.H * f
local C = s.H * (s.phi * (s.M * (s.phi:star() * a) + b)) -- velocity terms and gravity
assert(tau:max_abs() < 1e-12 * C:max_abs())
assert(same(s.mass * vdot, -C))
print(string.format("torques for v' = 0: %.6g, %.6g, %.6g N m", C[1], C[2], C[3]))
print(string.format("v' under gravity alone: %.6g, %.6g, %.6g rad/s^2", vdot[1], vdot[2], vdot[3]))

-- f has the reactions of the hinges too: moment and force on each body, at the origin of its frame, which is where its hinge is.
for k, name in ipairs(names) do
  local reaction = vector { sat:hinge(name):reaction() }
  local here = {}
  for i = 1, 6 do here[i] = f[6 * (k - 1) + i] end
  assert((vector(here) - reaction):max_abs() < 1e-12 * f:max_abs())
end
print(string.format("force in the elbow: (%.6g, %.6g, %.6g) N, in the axes of the forearm", f["fore:fx"], f["fore:fy"], f["fore:fz"]))

-- ## The factors
--
-- H phi M phi* H*: the Newton-Euler factorisation. Its middle factor is constant, block-diagonal, and knows nothing of hinges.
print(s.H * s.phi * s.M * s.phi:star() * s.H:star())
assert(same((s.H * s.phi * s.M * s.phi:star() * s.H:star()) * vdot, s.H * (s.phi * (s.M * (s.phi:star() * (s.H:star() * vdot))))))

-- The kinetic energy, in the hinge space and in that of the bodies:
local T, T_bodies = 0.5 * v:dot(s.mass * v), 0.5 * V:dot(s.M * V)
assert(math.abs(T - T_bodies) < 1e-12 * T)
print(string.format("kinetic energy %.6g J", T))
