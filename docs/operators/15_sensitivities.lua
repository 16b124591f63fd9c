-- Vehicle: vehicles/tree.yaml
--
-- # 15 Sensitivities
--
-- Source: Jain, Rodriguez 1993 (IEEE Trans. Systems, Man, Cybernetics 23(1)); Jain 1997 (J. Computational Physics 136, log det);
-- Jain 2011, the chapter on sensitivities of operators.
--
-- Operators depend on q. Let q move by N(q) u: then only the leaves change in themselves, E_phi, H and M, and the rest follows by the
-- product rule. From phi = (I - E_phi)^-1:
--
--     d phi = phi dE_phi phi

local s, sat = sim:operators(), sim:vehicle()
local start = sim:state()
local function moved(u, h) -- the operators where q has moved by h N(q) u
  local q, d = start.q * 1, u * h -- copies, names and all
  q["mast.angle"] = q["mast.angle"] + d["mast.rate"]
  q["left_hand.angle"] = q["left_hand.angle"] + d["left_hand.rate"]
  q["right.angle"] = q["right.angle"] + d["right.rate"]
  local turn = { d["left.wx"], d["left.wy"], d["left.wz"] }
  local angle = vec.norm(turn)
  if angle > 0 then -- the ball hinge: q o exp(d / 2)
    local w, x, y, z = table.unpack(quat.multiply({ q[2], q[3], q[4], q[5] }, quat.from_axis_angle(turn, angle)))
    q[2], q[3], q[4], q[5] = w, x, y, z
  end
  sim:state { q = q }
  local there = sim:operators()
  sim:state(start)
  return there
end
local function difference(of, u) -- of fourth order in h
  local h = 1e-3
  return (of(moved(u, h)) - of(moved(u, -h))) * (2 / (3 * h)) - (of(moved(u, 2 * h)) - of(moved(u, -2 * h))) * (1 / (12 * h))
end
local function close(a, b) return (a - b):max_abs() < 1e-9 * math.max(1, b:max_abs()) end

local names = { names = sim:v():labels().names }
local u = vector({ 0.3, -0.5, 0.8, 0.2, 1, -0.6 }, names) -- any direction
s:along(u)
assert(close((s.phi * s.dE_phi * s.phi):dense(), difference(function(t) return t.phi:dense() end, u)))
print(s.phi * s.dE_phi * s.phi)

-- ## The mass matrix
--
--     d(H phi M phi* H*) = H phi ( dE_phi phi M + dM + M phi* dE_phi* ) phi* H*  +  dH phi M phi* H* + H phi M phi* dH*
--
-- dM is for modes, dH for hinges whose axes turn with q (universal, gimbal, free): neither is here.

local H, phi, M = s.H, s.phi, s.M
local A = H * phi
local middle = s.dE_phi * phi * M + s.dM + M * phi:star() * s.dE_phi:star()
local dmass = A * middle * A:star() + s.dH * phi * M * A:star() + A * M * phi:star() * s.dH:star()
assert(s.dM:norm() == 0 and s.dH:norm() == 0)
assert(close(s.mass_derivative:dense(), difference(function(t) return t.mass:dense() end, u)))
assert((dmass - s.mass_derivative):norm() < 1e-13)
-- Applied to a vector it is O(N) as all the rest:
assert(((dmass * sim:v()) - s.mass_derivative:dense() * sim:v()):max_abs() < 1e-13)

-- ## One hinge
--
-- Along one revolute hinge k with the column h* = H*(k), dPhi* = - (h x) Phi*: with Delta = (h x*) at k and nothing elsewhere,
--
--     dE_phi = E_phi Delta,          (h x*) = [ w~ v~ ; 0 w~ ]
--
-- so that dM/dq_k = H phi ( Delta phi M + M phi* Delta* ) phi* H*. That holds for rigid bodies and single axes; the
-- line of the section before, which the program takes, for all.

s:along "right.rate"
local Delta = {}
for i = 1, 24 do
  Delta[i] = {}
  for j = 1, 24 do Delta[i][j] = 0 end
end
for _, at in ipairs { 18, 21 } do -- the axis is x: w~ = [ 0 0 0 ; 0 0 -1 ; 0 1 0 ]
  Delta[at + 2][at + 3], Delta[at + 3][at + 2] = -1, 1
end
Delta = matrix(Delta)
assert((s.E_phi:dense() * Delta - s.dE_phi:dense()):max_abs() < 1e-14)

-- ## log det
--
-- d log det M = tr(M^-1 dM) needs all of the inverse, O(N^2). With Y (page 10) one hinge needs its own blocks alone,
--
--     d log det M / dq_k = 2 tr( P(k) Y(k) Delta_k )
--
-- and all hinges are done in O(N): the force of the Fixman potential of statistical mechanics.

s:operational_space()
local PYD, trace = s.P:dense() * (s.Y:dense() * Delta), 0
for i = 19, 24 do trace = trace + 2 * PYD(i, i) end
local product, by_inverse = s.mass:inv():dense() * s.mass_derivative:dense(), 0
for i = 1, 6 do by_inverse = by_inverse + product(i, i) end
assert(math.abs(trace - by_inverse) < 1e-12)
local numeric = difference(function(t) return vector { t:log_det() } end, vector({ 0, 0, 0, 0, 0, 1 }, names))
assert(math.abs(trace - numeric[1]) < 1e-9)
print(string.format("d log det / d right.angle: %.6g", trace))

-- ## Along the motion itself
--
-- With u = v the derivatives are rates. Node accelerations are then d/dt (J v) = J v' + J' v with
--
--     J' v = B* ( phi* dE_phi* phi* H* + phi* dH* ) v          (B* of a rigid body is constant)
--
-- in the moving axes of the node; the classical acceleration has w x v beside it (page 2).

local v, vdot = sim:v(), sim:vdot()
s:along(v)
local B = s:nodes "left_hand.tip"
local J = B:star() * phi:star() * H:star()
local V = J * v
local alpha = J * vdot + B:star() * (phi:star() * (s.dE_phi:star() * (phi:star() * (H:star() * v)) + s.dH:star() * v))
local classical = vec.add({ alpha[4], alpha[5], alpha[6] }, vec.cross({ V[1], V[2], V[3] }, { V[4], V[5], V[6] }))
local tip = sat:node "left_hand.tip"
local told = quat.rotate(quat.conjugate { tip:attitude() }, { tip:acceleration() })
assert(vec.norm(vec.sub(classical, told)) < 1e-12 * vec.norm(told))
print(string.format("acceleration of the left tip %.6g m/s^2", vec.norm(told)))
