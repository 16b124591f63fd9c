-- Vehicle: vehicles/chain.yaml
--
-- # 5 The mass matrix and composite inertias
--
-- Source: Walker, Orin 1982 (composite bodies); Jain 2011, the chapter on the mass matrix; docs/mathematics/tree_algorithms.md
-- section 3.
--
-- H phi M phi* H* has phi twice: multiplied out, that is N^2 blocks of N terms. The composite inertia R(k), the inertia of k and
-- all outboard of it with their hinges frozen, saves the sum:
--
--     R(k) = M(k) + Phi(k,c) R(c) Phi*(k,c), c outboard of k          R = M + E_phi R E_phi*
--
-- a Lyapunov equation. E_phi is nilpotent, so that repeating the right side N times solves it exactly.

local s = sim:operators()
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end

local E, M, H, phi = s.E_phi:dense(), s.M:dense(), s.H:dense(), s.phi:dense()
local R = M
for _ = 1, 3 do R = M + E * R * E:t() end
assert(same(R, M + E * R * E:t())) -- solved: once more changes nothing
print(string.format("mass beyond the shoulder %.6g kg, beyond the elbow %.6g kg", R("shoulder:fx", 4), R("fore:fx", 16)))

-- With phi~ = phi - I it takes the product apart:
--
--     phi M phi* = R + phi~ R + R phi~*
--
-- a block-diagonal part, one above, one below. Between H and H*: entry (j,k) of the mass matrix, j inboard of k, is
-- H(j) Phi(j,k) R(k) H*(k), and (k,k) is H(k) R(k) H*(k). O(N^2) for all of them, which is as little as N^2 numbers can cost.

local phi_ = (s.phi - s.I):dense()
assert(same(phi * M * phi:t(), R + phi_ * R + R * phi_:t()))
local mass = s.mass:dense()
assert(same(mass, H * (R + phi_ * R + R * phi_:t()) * H:t()))
print(mass)

for k = 1, 3 do -- the diagonal: what one motor would turn if the others were locked
  local column = R * H:t():column(k)
  assert(math.abs(mass(k, k) - H:t():column(k):dot(column)) < 1e-13)
end

-- ## What it is like
--
-- Symmetric and positive: v* (mass matrix) v is twice the kinetic energy. Its eigenvalues spread, since a forearm about its own axis
-- is lighter than an arm that is swung.

assert(same(mass, mass:t()))
local eigenvalues = s.mass:eig(3)
assert(eigenvalues[3] > 0)
print(string.format("eigenvalues %.6g, %.6g, %.6g kg m^2", eigenvalues[1], eigenvalues[2], eigenvalues[3]))

-- It does not depend on the first coordinate: the whole arm turned about the first hinge is the same arm. Nor on time, velocity or
-- gravity.
local state = sim:state()
local q = sim:q()
q[1] = q[1] + 1
sim:state { q = q }
assert((sim:operators().mass:dense() - mass):max_abs() < 1e-14)
q[2] = q[2] + 1 -- the second one is another matter
sim:state { q = q }
print(string.format("with the upper arm lifted by 1 rad: %.6g kg m^2 about the shoulder", sim:operators().mass:dense()(1, 1)))
sim:state(state)

-- To apply it one forms nothing: s.mass * v' is inverse dynamics without velocities and gravity, a scatter and a gather.
assert(same(s.mass * sim:v(), mass * sim:v()))
