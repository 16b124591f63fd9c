-- Vehicle: vehicles/chain.yaml
--
-- # 16 Diagonalised dynamics
--
-- Source: Jain, Rodriguez 1995 (IEEE Trans. Robotics and Automation 11(4)); Jain 2011, the chapter on diagonalised dynamics.
--
-- The innovations factorisation splits the mass matrix in two equal parts. With D = S S*, S lower triangular in each block,
--
--     M = L L*,  L = (I + H phi K) S          nu_d = L* v = S* (I + H phi K)* v
--
-- are velocities in which the mass matrix is 1:
--
--     T = 1/2 nu_d* nu_d          nu_d' + C(q, nu_d) = eps_d = L^-1 tau = S^-1 (I - H psi K) tau          nu_d* C = 0

local s, sat = sim:operators(), sim:vehicle()
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end

-- The hinges of this chain have one velocity each: S is the root of D.
local function roots(t)
  local D, S = t.D:dense(), {}
  for i = 1, 3 do
    S[i] = { 0, 0, 0 }
    S[i][i] = math.sqrt(D(i, i))
  end
  return matrix(S)
end
local S = roots(s)
local function to_nu(t, v) return roots(t) * ((t.I + t.H * t.phi * t.K):star() * v) end
local v = sim:v()
local nu = to_nu(s, v)
print(string.format("nu_d = %.6g, %.6g, %.6g kg^1/2 m/s", nu[1], nu[2], nu[3]))
local T = 0.5 * v:dot(s.mass * v)
assert(math.abs(0.5 * nu:dot(nu) - T) < 1e-13 * T)

-- The map is one scatter, since (I + H phi K)* = G* phi* H* for G* H* = I: nu_d(k) = S*(k) G*(k) V(k). And back by (I - H psi K)*:
local V = s.phi:star() * (s.H:star() * v)
assert(same(nu, S * (s.G:star() * V)))
local back = (s.I - s.H * s.psi * s.K):star() * S:solve(nu)
assert(same(back, v))

-- Each component is what its hinge sees of V: nu_d of the tip depends on the whole motion, that of the base on the first rate alone,
-- sqrt(D_1) v_1, with D_1 what its motor feels of all that is outboard and loose (page 6).
assert(math.abs(nu[1] - v[1] * S(1, 1)) < 1e-14)

-- ## What is left of the velocity terms
--
--     C(q, nu_d) = L^-1 C(q,v) - L*' v
--
-- For hinges with q' = v, C(q,v) = M' v - 1/2 grad (v* M v) (Lagrange), and M' = L' L* + L L*' gives L' = L up( L^-1 M' L^-* ), up() being
-- what stands above the diagonal and half of the diagonal, L being upper triangular with inboard bodies first.

s:along(v)
local rate = s.mass_derivative:dense()
local coriolis = (rate * v):table()
for i, name in ipairs(s:names "hinge") do
  s:along(name)
  coriolis[i] = coriolis[i] - 0.5 * v:dot(s.mass_derivative * v)
end
coriolis = vector(coriolis)

local L = (s.I + s.H * s.phi * s.K):dense() * S
assert(same(L * L:t(), s.mass:dense()))
local X = L:solve(L:solve(rate):t())
local up = {}
for i = 1, 3 do
  up[i] = {}
  for j = 1, 3 do up[i][j] = j > i and X(i, j) or j == i and 0.5 * X(i, i) or 0 end
end
local Ldot = L * matrix(up)
assert(same(Ldot * L:t() + L * Ldot:t(), rate))
local C = L:solve(coriolis) - Ldot:t() * v
print(string.format("C = %.6g, %.6g, %.6g; nu_d . C is zero: they do no work", C[1], C[2], C[3]))
assert(math.abs(nu:dot(C)) < 1e-13 * nu:norm() * C:norm())

-- C(q,v) itself does work, or rather the mass matrix does, as it changes: v* C(q,v) = 1/2 v* M' v.
assert(math.abs(v:dot(coriolis) - 0.5 * v:dot(rate * v)) < 1e-12)

-- ## Along a simulation
--
-- Gravity is the one force here: eps_d = L^-1 (-gravity), where gravity is -M v' at rest. Then nu_d' = eps_d - C must be the slope that a
-- run shows.

local state = sim:state()
sim:state { v = { 0, 0, 0 } }
local gravity = -(s.mass * sim:vdot())
sim:state(state)
assert((s.mass * sim:vdot() + coriolis + gravity):max_abs() < 1e-12 * gravity:max_abs()) -- Lagrange agrees with the sweeps
local slope = -(L:solve(gravity)) - C
local h, seen = 1e-3, {}
for k = 0, 4 do
  sim:run_to(k * h)
  seen[k] = to_nu(sim:operators(), sim:v())
end
local one_sided = (seen[0] * -25 + seen[1] * 48 - seen[2] * 36 + seen[3] * 16 - seen[4] * 3) / (12 * h)
assert((one_sided - slope):max_abs() < 1e-6 * slope:max_abs())
print(string.format("nu_d' = %.6g, %.6g, %.6g kg^1/2 m/s^2", slope[1], slope[2], slope[3]))

-- No coordinates stand behind nu_d; one integrates q and nu_d together. That is no faster a way to simulate, but one in which energy is
-- a length, and each velocity has its own equation.
