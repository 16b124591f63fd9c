-- Vehicle: vehicles/four_bar.yaml
--
-- # 12 Closed chains
--
-- Source: Rodriguez, Jain, Kreutz-Delgado 1991; Jain 2011, the chapter on closed chains; Featherstone 2008, chapter 8 (rank).
--
-- Cardan simulates trees. Loops are not in the vehicle file yet: neither as constraints that a run keeps, nor as compound bodies of
-- a tree (constraint embedding, Jain 2011). What the operators give already is the augmented form at one instant, and this page is that.
--
-- Cut the loop. What is left is a tree with J; the loop says that some rows of node velocities vanish, Q J v = G v = 0, by forces
-- lambda on these rows:
--
--     M v' + C = tau + G* lambda          G v' = gamma_c,  gamma_c = - G' v
--
-- So  (G M^-1 G*) lambda = gamma_c - G v'_f,  v'_f = M^-1 (tau - C): the accelerations as if the loop were open. Then
-- v' = v'_f + M^-1 G* lambda. G M^-1 G* = Q B* Omega B Q*: operational space (page 10), the size of the loop, not of the tree.

local s, sat = sim:operators(), sim:vehicle()

-- Three links, and the tip of the last stands where it is to be pinned, 0.4 m from the first hinge:
local tip = sat:node "rocker.tip"
local x, y, z = tip:position()
assert(math.abs(x - 0.4) < 1e-15 and math.abs(y) < 1e-15 and math.abs(z) < 1e-15)

-- Pinned in the plane: of the six rows of the tip the two of its x and z, in node axes.
local B = s:nodes "rocker.tip"
local J = (B:star() * s.phi:star() * s.H:star()):dense()
local G = matrix { J["rocker.tip:vx"]:table(), J["rocker.tip:vz"]:table() }

-- Why not all three: the row along y is zero in a plane, and G M^-1 G* would be singular. Loops are redundant more often than not; then
-- lambda is not unique, v' is, and the factorisation must find the rank.
assert(J["rocker.tip:vy"]:max_abs() < 1e-15)

local function bring(v) -- the nearest velocity that the loop allows, in the metric of kinetic energy: v - M^-1 G* (G M^-1 G*)^-1 G v
  return v - s.mass:inv() * (G:t() * (G * (s.mass:inv() * G:t())):solve(G * v))
end
local v = bring(vector { 2, 0, 0 })
assert((G * v):max_abs() < 1e-14)
assert(math.abs(v[1] + v[2]) < 1e-14 and math.abs(v[3] + v[2]) < 1e-14) -- a parallelogram: the coupler does not turn
print(string.format("rates %.6g, %.6g, %.6g rad/s", v[1], v[2], v[3]))
sim:state { v = v }

-- G' v needs no derivative: with the loop open, the tip has the acceleration G v'_f + G' v, in world axes from the simulation.
local free = { tip:acceleration() }
local in_node = quat.rotate(quat.conjugate { tip:attitude() }, free)
local inverse = G * (s.mass:inv() * G:t()) -- 2 x 2
local lambda = inverse:solve(vector { -in_node[1], -in_node[3] })
local vdot = sim:vdot() + s.mass:inv() * (G:t() * lambda)
print(string.format("the open tip would accelerate by (%.6g, %.6g) m/s^2", in_node[1], in_node[3]))
print(string.format("the pin holds it with (%.6g, %.6g) N, in its axes", lambda[1], lambda[2]))
print(string.format("v' = %.6g, %.6g, %.6g rad/s^2", vdot[1], vdot[2], vdot[3]))

-- ## Checked by the simulation
--
-- The same force as a load on the tip: then it does not accelerate, and the simulation has our v'.

tip:load { axes = "node" }:set(0, 0, 0, lambda[1], 0, lambda[2])
assert((sim:vdot() - vdot):max_abs() < 1e-11 * vdot:max_abs())
assert(vec.norm { tip:acceleration() } < 1e-11 * vec.norm(free))

-- And a law that has not been put in: in a parallelogram the coupler translates, so that all of it is one pendulum, I a'' = - dU/da, I holding
-- the links' inertias about their pins and the coupler as a point. The links stand upright now, so that only the rocker's mass centre,
-- 0.02 m to the right of it, has a moment, and since I does not depend on a there is no term of velocity.
local m, d, r = { 1, 2, 1.5 }, 0.3, 0.15
local I = 0.01 + m[1] * r ^ 2 + m[2] * d ^ 2 + 0.015 + m[3] * ((d - 0.15) ^ 2 + 0.02 ^ 2)
local moment = 9.81 * m[3] * 0.02
print(string.format("pendulum: %.6g rad/s^2", moment / I))
assert(math.abs(vdot[1] - moment / I) < 1e-12 * moment / I)
