-- Vehicle: vehicles/four_bar.yaml
--
-- # 12 Closed chains
--
-- Source: Rodriguez, Jain, Kreutz-Delgado 1991; Jain 2011, the chapters on closed chains and constraint embedding; Featherstone 2008,
-- chapter 8 (rank).
--
-- A hinge that closes a loop fits into no tree. Cut it: what is left is a tree, and the cut says that some rows of node velocities vanish,
-- G v = 0. There are two ways on, and this page goes both.

local s, sat = sim:operators(), sim:vehicle()
local closed = sim:closed_system()
local open = closed:open_tree() -- the letters of the cut tree
open:articulate()

-- ## By multipliers
--
-- Forces lambda on these rows hold the loop:
--
--     M v' + C = tau + G* lambda          G v' = gamma_c,  gamma_c = - G' v
--
-- The rows are those of the tip: of its six the two of its x and z, in node axes. The row along y is zero in a plane, and with it
-- G M^-1 G* would be singular. Loops are redundant more often than not; then lambda is not unique, v' is, and the factorisation must find the
-- rank.
local J = (open:nodes("rocker.tip"):star() * open.phi:star() * open.H:star()):dense()
local G = matrix { J["rocker.tip:vx"]:table(), J["rocker.tip:vz"]:table() }
assert(J["rocker.tip:vy"]:max_abs() < 1e-15)

-- So (G M^-1 G*) lambda = gamma_c - G v'_f, v'_f = M^-1 (tau - C), and forces change the accelerations by
--
--     M^-1 - M^-1 G* (G M^-1 G*)^-1 G M^-1
local inverse = open.mass:inv():dense()
local held = inverse - inverse * (G:t() * (G * (inverse * G:t())):solve(G * inverse))

-- ## By compound bodies
--
-- Or: what moves in the loop is one body of a tree again. Its hinge has the independent rates of the loop, v = X v_I:
for _, c in ipairs(s:compounds()) do
  print(string.format("%s on %s: %s", table.concat(c.bodies, " + "), c.home, table.concat(c.independent, ", ")))
end
local X = s.X:dense()
assert((G * X):max_abs() < 1e-15)

-- All bodies of it have their motion by these rates, and by what the body does that they hang on, here the ground. So its H* is
-- phi_S* H_S* X, its E_phi goes from there to each of them at once, and M is what it was. With these letters everything is as in a tree:
--
--     M_c = X* M X = H phi M phi* H*
--     M_c^-1 = (I - H psi K)* D^-1 (I - H psi K)
assert(((s.H * s.phi * s.M * s.phi:star() * s.H:star()):dense() - X:t() * open.mass:dense() * X):max_abs() < 1e-14)
assert((s.mass * s.mass:inv() - s.I):norm() < 1e-13)
assert((s.phi * (s.I - s.E_phi) - s.I):norm() < 1e-13)
assert(math.abs(s:log_det() - closed:log_det()) < 1e-12)
print(s.mass:inv())

-- It is the same system:
local response = s.X * s.mass:inv() * s.X:star()
assert((response:dense() - held):max_abs() < 1e-12 * held:max_abs())

-- ## Forward dynamics
--
-- X turns with q: v' = X v_I' + X' v_I. Put into M v' + C = tau + G* lambda, and X* from the left, which no multiplier passes:
--
--     v_I' = M_c^-1 X* (tau - C - M X' v_I)
local one = s.X * vector { 1 }
local v_I = vector { 2 / one["crank.rate"] } -- the crank turns with 2 rad/s
local v = s.X * v_I
assert(math.abs(v[1] + v[2]) < 1e-14 and math.abs(v[3] + v[2]) < 1e-14) -- a parallelogram: the coupler does not turn
print(string.format("rates %.6g, %.6g, %.6g rad/s", v[1], v[2], v[3]))
sim:state { v = v }

s:along(v) -- dX is the change of X along v
local turning = s.dX * v_I
local missing = -1 * (open:bias(v) + open.mass * turning) -- C with gravity; there is no tau
local vdot = response * missing + turning
assert((sim:vdot() - vdot):max_abs() < 1e-12 * vdot:max_abs())
print(string.format("v' = %.6g, %.6g, %.6g rad/s^2", vdot[1], vdot[2], vdot[3]))

-- What the pin pushes with is what is left: G* lambda = M v' + C.
local left = open.mass * vdot + open:bias(v)
local lambda = (G * G:t()):solve(G * left)
assert((G:t() * lambda - left):max_abs() < 1e-12 * left:max_abs())
print(string.format("the pin holds it with (%.6g, %.6g) N, in its axes", lambda[1], lambda[2]))

-- And a law that has not been put in: in a parallelogram the coupler translates, so that all of it is one pendulum, I a'' = - dU/da, I holding
-- the links' inertias about their pins and the coupler as a point. The links stand upright now, so that only the rocker's mass centre,
-- 0.02 m to the right of it, has a moment, and since I does not depend on a there is no term of velocity.
local m, d, r = { 1, 2, 1.5 }, 0.3, 0.15
local I = 0.01 + m[1] * r ^ 2 + m[2] * d ^ 2 + 0.015 + m[3] * ((d - 0.15) ^ 2 + 0.02 ^ 2)
local moment = 9.81 * m[3] * 0.02
print(string.format("pendulum: %.6g kg m^2, %.6g rad/s^2", I, moment / I))
assert(math.abs(s.mass:dense()(1, 1) / one[1] ^ 2 - I) < 1e-13)
assert(math.abs(vdot[1] - moment / I) < 1e-12 * moment / I)
