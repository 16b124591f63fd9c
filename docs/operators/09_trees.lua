-- Vehicle: vehicles/tree.yaml
--
-- # 9 Trees
--
-- Source: Rodriguez, Jain, Kreutz-Delgado 1992; Jain 2011, the chapters on trees as graphs and on spatial kernel operators.
--
-- Let a body carry several. Then E_phi has several blocks in one row, one in each column still, and that is all that changes:
-- whatever was derived from phi = (I - E_phi)^-1 alone holds as it stands. The recursions get a sum over children c:
--
--     gather   y(k) = x(k) + sum of Phi(k,c) y(c)          scatter   y(k) = Phi*(p,k) y(p) + x(k)
--     P(k) = M(k) + sum of Phi(k,c) P+(c) Phi*(k,c)

local s = sim:operators()
local function zero(A, scale) return A:norm() <= 1e-13 * scale end
print(s)

local L = s.I + s.H * s.phi * s.K
assert((s.E_phi * s.E_phi * s.E_phi):norm() < 1e-14) -- as many steps as the tree is deep: mast, left, left_hand
assert(zero(s.P - s.M - s.E_psi * s.P * s.E_psi:star(), s.P:norm()))
assert(zero(L * s.D * L:star() - s.mass, s.mass:norm()))
assert(zero((s.I + s.H * s.phi * s.K) * (s.I - s.H * s.psi * s.K) - s.I, L:norm() ^ 2))

-- ## Who feels whom
--
-- Phi(i,j) is not zero where i is j or inboard of it. So forces on one arm do not appear in the hinges of the other, and neither do
-- accelerations: the mass matrix has zeros between unrelated bodies.

local phi = s.phi:dense()
local bodies = { "mast", "left", "left_hand", "right" }
for i, row in ipairs(bodies) do
  local line = string.format("%-10s", row)
  for j = 1, #bodies do
    local largest = 0
    for a = 1, 6 do
      for b = 1, 6 do largest = math.max(largest, math.abs(phi(6 * i - 6 + a, 6 * j - 6 + b))) end
    end
    line = line .. (largest > 0 and " x" or " .")
  end
  print(line)
end

local mass, inverse = s.mass:dense(), s.mass:inv():dense()
assert(mass("left_hand.rate", "right.rate") == 0)
-- Its inverse has none. A torque in the right arm does move the left hand, since the mast is not held:
print(string.format("right.rate' per torque in left_hand: %.6g 1/(kg m^2)", inverse("right.rate", "left_hand.rate")))

-- ## Hinges with several velocities
--
-- The left arm hangs on a ball hinge: H*(k) has three columns, D(k) is a 3 x 3 block, the quaternion has four coordinates and
-- v = w three components, q' = N(q) v. Nothing else in the formulas knows.

print(string.format("%d coordinates, %d velocities", #sim:q(), #sim:v()))
local D = s.D:dense()
assert(D("left.wx", "left.wy") ~= 0 and D("left.wx", "left_hand.rate") == 0)
print(string.format("D(left) = [%.6g %.6g %.6g; ., %.6g %.6g; ., ., %.6g] kg m^2", D(2, 2), D(2, 3), D(2, 4), D(3, 3), D(3, 4), D(4, 4)))

-- ## Parts of a tree
--
-- Operators carry over to any set of bodies: E_phi loses the blocks that lead out of it, and what a body hangs on, if it is not in
-- the set, counts as ground. A subtree has all that is outboard: its M and P are those of the whole.

local arm = s:subtree "left"
print(arm)
local function part_of(A, names) -- rows and columns of these names
  local rows = {}
  for i, r in ipairs(names) do
    rows[i] = {}
    for j, c in ipairs(names) do rows[i][j] = A(r, c) end
  end
  return matrix(rows)
end
local names = arm:names "hinge"
assert((arm.mass:dense() - part_of(mass, names)):max_abs() < 1e-14)
assert((arm.D:dense() - part_of(D, names)):max_abs() < 1e-14)

-- Its inverse is not a part of the whole inverse: there the mast is free to yield, here it is ground.
local alone, together = arm.mass:inv():dense(), part_of(inverse, names)
assert((together - alone):eigenvalues()[1] > -1e-10) -- what hangs on less moves more easily
print(string.format("left_hand.rate' per torque: %.6g on ground, %.6g on the mast, in 1/(kg m^2)", alone(4, 4), together(4, 4)))

-- A path ends where one says, and P there is another, since less is outboard:
local path = s:path("mast", "right")
assert(path.P:dense()(3, 3) < s.P:dense()(3, 3))
assert(zero(path.mass:inv() * path.mass - path.I, 10))
