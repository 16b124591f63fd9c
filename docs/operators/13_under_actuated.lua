-- Vehicle: vehicles/tree.yaml
--
-- # 13 Under-actuated systems, prescribed motion
--
-- Source: Jain, Rodriguez 1993 (IEEE Trans. Robotics and Automation 9(4)); Jain 2011, the chapter on under-actuated systems;
-- docs/mathematics/tree_algorithms.md section 7.
--
-- Of each velocity component either the force is known (free: a motor that is told its torque, or none) or the motion (given). Split
-- H* = [ H*_f  H*_g ]: where a hinge is given, the body is carried along, P+ = P, and it takes no part in D, G, K. What it does is
-- an acceleration known in advance, added to a:
--
--     v'_f  = (I - H_f psi K)* D^-1 (I - H_f psi K) ( tau_f - C_f - H_f phi M phi* H*_g v'_g )
--     tau_g = H_g phi M phi* H* v' + C_g
--
-- Any mix does, also within one hinge or among modes. Here the mast, two of three components of the ball hinge and the right arm are
-- driven; the left arm rolls about its y, and the left hand swings, as they like.

local s, free, sat = sim:operators(), sim:operators(), sim:vehicle()
free:articulate { free = { "left.wy", "left_hand.rate" } }
local names = s:names "hinge"
local is_free = { ["left.wy"] = true, ["left_hand.rate"] = true }

-- ## The letters of the free part
--
-- H has rows of zeros for what is given, and so D and the rest. The mass matrix of the free part is a block of the whole one, and its
-- inverse is the inverse of this block: the other components stay where they are told. `articulate` changes the letters of the
-- operators() it is called on, and what was made of them: so these have their own.

local block, inverse = free.mass:dense(), free.mass:inv():dense()
local whole = s.mass:dense()
local i, j = "left.wy", "left_hand.rate"
for _, r in ipairs(names) do
  for _, c in ipairs(names) do
    assert(math.abs(block(r, c) - ((is_free[r] and is_free[c]) and whole(r, c) or 0)) < 1e-14)
  end
end
local det = whole(i, i) * whole(j, j) - whole(i, j) ^ 2
assert(math.abs(inverse(i, i) - whole(j, j) / det) < 1e-11 * inverse(i, i))
assert(math.abs(inverse(i, j) + whole(i, j) / det) < 1e-11 * inverse(i, i))
assert(math.abs(free:log_det() - math.log(det)) < 1e-12)
local loose = s.mass:inv():dense()(j, j)
print(string.format("left_hand.rate' per torque: %.6g with the others held, %.6g with all loose, in 1/(kg m^2)", inverse(j, j), loose))

-- ## Given: accelerations and torques

local given = vector { 0.5, 1, 0, -0.7, 0, 2 } -- v'_g, zero where free
local tau_f = vector { 0, 0, 0, 0, 0.3, 0 } -- a small motor in the left hand, none in left.wy
local C = -(s.mass * sim:vdot()) -- velocity terms and gravity: no motor works yet (page 8)

-- ## Found: the rest

local rest = free.mass:inv() * (tau_f - C - s.mass * given)
local vdot = vector(given:table())
for _, name in ipairs { i, j } do
  for k, other in ipairs(names) do
    if other == name then vdot[k] = rest[k] end
  end
end
local tau = s.mass * vdot + C
for k, name in ipairs(names) do
  if is_free[name] then assert(math.abs(tau[k] - tau_f[k]) < 1e-12 * tau:max_abs()) end
end
print(string.format("left.wy' = %.6g, left_hand.rate' = %.6g rad/s^2", vdot[3], vdot[5]))
print(string.format("motors: mast %.6g, left (%.6g, 0, %.6g), right %.6g N m", tau[1], tau[2], tau[4], tau[6]))

-- The simulation, with these torques:
sat:hinge("mast"):torque(tau[1])
for k, c in ipairs { "wx", "wy", "wz" } do sat:hinge("left"):torque(tau[1 + k], c) end
sat:hinge("left_hand"):torque(tau[5])
sat:hinge("right"):torque(tau[6])
assert((sim:vdot() - vdot):max_abs() < 1e-11 * vdot:max_abs())

-- In a mission the same is said in the vehicle file, `prescribed: [wx, wz]`, and a profile gives the motion in time (docs/scenario_lua.md).
