-- Vehicle: vehicles/chain.yaml
--
-- # 6 Articulated body inertia
--
-- Source: Featherstone 1983 (the inertia); Rodriguez 1987 (the Riccati equation, and the filter it comes from); Rodriguez, Jain,
-- Kreutz-Delgado 1991; Jain 2011, the chapter on the articulated body model; tree_algorithms.md section 4.
--
-- The composite inertia freezes the outboard hinges. Let them go instead, free of torque: what one feels then is the articulated
-- body inertia P. A hinge transmits only what does not move it,
--
--     D  = H P H*              what the hinge itself feels
--     G  = P H* D^-1           its share of the force: the Kalman gain
--     P+ = P - G D G*          P as felt from the other side of the hinge
--     P(k) = M(k) + Phi(k,c) P+(c) Phi*(k,c)
--
-- and with tau_bar = I - G H, E_psi = E_phi tau_bar:
--
--     P = M + E_psi P E_psi*          the Riccati equation of the tree

local s = sim:operators()
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end
local function zero(A, scale) return A:norm() <= 1e-13 * scale end

-- ## Solved by repetition
--
-- As in page 5 E_phi is nilpotent, and N repetitions end exactly. (The program takes one sweep from tip to base, O(N).)

local E, M, H = s.E_phi:dense(), s.M:dense(), s.H:dense()
local P = M
for _ = 1, 3 do
  local D = H * P * H:t()
  P = M + E * (P - (P * H:t()) * D:solve(H * P)) * E:t()
end
assert(same(P, s.P:dense()))
assert(zero(s.P - s.M - s.E_psi * s.P * s.E_psi:star(), s.P:norm()))

-- ## What the letters say of each other

assert(zero(s.H * s.P * s.H:star() - s.D, s.D:norm())) -- block by block, since P has blocks of one body each, and H as well
assert(zero(s.P * s.H:star() * s.D:inv() - s.G, s.G:norm()))
assert(zero(s.tau_bar * s.P - s.P_plus, s.P:norm()))
assert(zero(s.H * s.G - s.I, 1)) -- a torque of the hinge passes the gain whole
assert(zero(s.H * s.P_plus, s.P:norm())) -- along the hinge nothing is felt: P+ is singular
assert(zero(s.tau_bar * s.tau_bar - s.tau_bar, s.tau_bar:norm())) -- tau_bar is a projection
assert(zero(s.K - s.E_phi * s.G, s.K:norm()))
assert(zero(s.psi:inv() - s.phi:inv() - s.K * s.H, 1))

-- ## Less than composite
--
-- A hinge that gives makes the rest easier to move: P <= R. The last body has no hinge beyond it and P = M there. For a motor:
-- H R H* (page 5) is what it turns while the others are locked, D what it turns while they are loose.

local R = M
for _ = 1, 3 do R = M + E * R * E:t() end
assert((R - P):eigenvalues()[1] > -1e-14)
local D, locked = s.D:dense(), s.mass:dense()
for k, name in ipairs(s:names("hinge")) do
  print(string.format("%-13s locked %.6g, loose %.6g kg m^2", name, locked(k, k), D(k, k)))
  assert(D(k, k) <= locked(k, k) + 1e-14)
end
assert(math.abs(D(3, 3) - locked(3, 3)) < 1e-15)

-- The first of them is easy to check: D(1) is what the base motor feels of everything, 1 / (M^-1)(1,1).
local inverse = s.mass:inv():dense()
assert(math.abs(D(1, 1) * inverse(1, 1) - 1) < 1e-12)

-- In estimation P is a covariance, G a gain, eps = tau - H z an innovation (page 8): the chain is a filter that runs from tip to base.
