-- Vehicle: vehicles/chain.yaml
--
-- # 7 Factorisation and inversion of the mass matrix
--
-- Source: Rodriguez 1987; Rodriguez, Kreutz-Delgado 1992; Rodriguez, Jain, Kreutz-Delgado 1991 (innovations factorisation);
-- Jain 2011, the chapter on mass matrix inversion.
--
-- H phi M phi* H* has factors that are not square. Articulated inertias give others, and these are:
--
--     mass matrix    = (I + H phi K) D (I + H phi K)*
--     (I + H phi K)^-1 = I - H psi K
--     mass matrix^-1 = (I - H psi K)* D^-1 (I - H psi K)
--
-- Triangle, diagonal, triangle, each applied by one sweep: the system M v' = tau is solved in O(N).

local s = sim:operators()
local function zero(A, scale) return A:norm() <= 1e-13 * scale end
local function condition(A) return A:norm() * A:inv():norm() end

local L, D = s.I + s.H * s.phi * s.K, s.D
assert(zero(L * D * L:star() - s.mass, s.mass:norm()))

-- ## Where it comes from
--
-- P takes phi M phi* apart as R does (page 5), and one term more is left, of rank no larger than there are hinge velocities:
--
--     phi M phi* = P + phi~ P + P phi~* + phi K D K* phi*

local tilde, all = s.phi - s.I, s.phi * s.M * s.phi:star()
assert(zero(all - s.P - tilde * s.P - s.P * tilde:star() - s.phi * s.K * D * s.K:star() * s.phi:star(), all:norm()))

-- Between H and H*, with H P H* = D and H phi~ P H* = H phi E_phi P H* = H phi K D, these are the four terms of (I + H phi K) D (I + H phi K)*.

-- ## The inverse, by rule
--
-- psi^-1 = phi^-1 + K H (page 6) is all one needs:
--
--     (I - H psi K) H phi = H psi          phi K (I - H psi K) = psi K
--     (I + H phi K)(I - H psi K) = I + H phi K - H (psi + phi K H psi) K = I + H phi K - H phi K = I

local W = s.I - s.H * s.psi * s.K
assert(zero(W * s.H * s.phi - s.H * s.psi, (s.H * s.phi):norm()))
assert(zero(s.phi * s.K * W - s.psi * s.K, (s.phi * s.K):norm()))
assert(zero(L * W - s.I, 1))
print(L:inv())
print(s.mass:inv())
assert(s.mass:inv():text() == (W:star() * D:inv() * W):text())
assert(zero(s.mass:inv() * s.mass - s.I, condition(s.mass)))
print(s.mass:inv():dense())

-- The triangle, for this chain (upper, since inboard comes first):
print(L:dense())

-- ## Determinant
--
-- The triangles have determinant 1: det M = product of all D(k).

local d, m, sum = D:dense(), s.mass:dense(), 0
for k = 1, 3 do sum = sum + math.log(d(k, k)) end
assert(math.abs(sum - s:log_det()) < 1e-14)
local det_mass = m(1, 1) * (m(2, 2) * m(3, 3) - m(2, 3) * m(3, 2)) - m(1, 2) * (m(2, 1) * m(3, 3) - m(2, 3) * m(3, 1)) +
  m(1, 3) * (m(2, 1) * m(3, 2) - m(2, 2) * m(3, 1))
assert(math.abs(math.log(det_mass) - s:log_det()) < 1e-12)
print(string.format("log det of the mass matrix: %.6g", s:log_det()))
