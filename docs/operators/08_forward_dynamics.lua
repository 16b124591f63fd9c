-- Vehicle: vehicles/chain.yaml
--
-- # 8 Forward dynamics
--
-- Source: Rodriguez 1987; Rodriguez, Jain, Kreutz-Delgado 1991; Jain 2011, the chapter on forward dynamics;
-- docs/mathematics/tree_algorithms.md section 5, which is what a step of the simulation does.
--
-- Given tau, find v' of M v' + C = tau:
--
--     v' = (I - H psi K)* D^-1 (I - H psi K) (tau - C)

local s, sat = sim:operators(), sim:vehicle()
local function same(a, b) return (a - b):max_abs() <= 1e-11 * math.max(a:max_abs(), b:max_abs()) end

-- C, velocity terms and gravity, is the torque that makes v' vanish (page 4 has it from a and b). Here it is taken from a simulation
-- without motors, where M v' = -C; then the motors are switched on.

local C = -(s.mass * sim:vdot())
local tau = vector { 3, -5, 0.1 }
for k, name in ipairs { "shoulder", "upper", "fore" } do sat:hinge(name):torque(tau[k]) end
local vdot = sim:vdot()
assert(same(vdot, s.mass:inv() * (tau - C)))
print(string.format("v' = %.6g, %.6g, %.6g rad/s^2", vdot[1], vdot[2], vdot[3]))

-- ## As a filter and a smoother
--
-- From right to left the formula is a recursion. Tip to base, with what is left of tau - C as input:
--
--     z   = psi K (tau - C)            force left over by the outboard hinges       z(k)  = Phi(k,c) z+(c)
--     eps = tau - C - H z              innovation: torque that is not yet explained
--     nu  = D^-1 eps                   v' if the inboard bodies stood still         z+(k) = z(k) + G(k) eps(k)

local z = s.psi * (s.K * (tau - C))
local eps = tau - C - s.H * z
local nu = s.D:inv() * eps
assert(same(eps, (s.I - s.H * s.psi * s.K) * (tau - C)))
assert(same(z, s.E_phi * (z + s.G * eps))) -- the same, as the loop has it

-- Base to tip:
--
--     delta = psi* H* nu               acceleration that v' causes                  delta+(k) = Phi*(p,k) delta(p)
--     v'    = nu - K* delta                                                         v'(k) = nu(k) - G*(k) delta+(k)

local delta = s.psi:star() * (s.H:star() * nu)
assert(same(vdot, nu - s.K:star() * delta))
assert(same(delta, s.phi:star() * (s.H:star() * vdot))) -- which is what phi* H* v' gives as well
print(string.format("nu = %.6g, %.6g, %.6g rad/s^2", nu[1], nu[2], nu[3]))

-- ## Forces between bodies, without a sweep of forces
--
-- In f = phi M delta, the forces that go with delta, phi need not be applied again (Jain 2011):
--
--     f(k) = P(k) delta(k) + z(k)          f = P delta + z
--
-- with z as the sweep left it. There is nothing to add on one's way inward: P knows what is outboard.

assert(same(s.P * delta + z, s.phi * (s.M * delta)))
assert(same(s.H * (s.P * delta + z), tau - C))

-- ## All at once
--
-- A solution found by elimination in a matrix, O(N^3), is the same one:
assert(same(vdot, s.mass:dense():solve(tau - C)))
