-- Vehicle: vehicles/tree.yaml
--
-- # 10 Operational space
--
-- Source: Khatib 1987 (the inertia, the dynamically consistent inverse); Kreutz-Delgado, Jain, Rodriguez 1992 (its operators);
-- Jain 2011, the chapter on operational space dynamics.
--
-- How does a force on a node accelerate that node, and others? With the Jacobian J = B* phi* H* of the nodes,
--
--     Lambda^-1 = J M^-1 J* = B* Omega B,          Omega = psi* H* D^-1 H psi
--
-- since (I - H psi K) H phi = H psi (page 7). Omega is the compliance of the tree: which acceleration of one body a force on another
-- causes, hinges free.

local s, sat = sim:operators(), sim:vehicle()
s:operational_space() -- Y and Y+
local function zero(A, scale) return A:norm() <= 1e-12 * scale end

local omega = s.psi:star() * s.H:star() * s.D:inv() * s.H * s.psi
assert(zero(omega - s.omega, omega:norm()))
local B = s:nodes("left_hand.tip", "right.tip")
local J = B:star() * s.phi:star() * s.H:star()
assert(zero(J * s.mass:inv() * J:star() - B:star() * omega * B, (B:star() * omega * B):norm()))
print(B:star() * s.omega * B)

-- ## Its blocks
--
-- Along with P there is a recursion the other way, base to tips. Y(k) is the compliance at body k:
--
--     Y+(k) = Phi*(p,k) Y(p) Phi(p,k)          Y(k) = H*(k) D^-1(k) H(k) + tau_bar*(k) Y+(k) tau_bar(k)
--
-- and in a chain Omega = Y + psi~* Y + Y psi~, psi~ = psi - I. In a tree that lacks the blocks between bodies of different branches,
-- Omega(i,j) = psi*(c,i) Y(c) psi(c,j), c being the nearest body inboard of both. They are not small.

local tilde = s.psi - s.I
local rest = (s.omega - s.Y - tilde:star() * s.Y - s.Y * tilde):dense()
local Y, psi, full = s.Y:dense(), s.psi:dense(), s.omega:dense()
local Y_plus = (s.E_phi:star() * s.Y * s.E_phi):dense() -- the blocks on its diagonal; siblings have others
local Y_again = (s.H:star() * s.D:inv() * s.H + s.tau_bar:star() * s.Y_plus * s.tau_bar):dense()
local function block(A, i, j)
  local rows = {}
  for a = 1, 6 do
    rows[a] = {}
    for b = 1, 6 do rows[a][b] = A(6 * i - 6 + a, 6 * j - 6 + b) end
  end
  return matrix(rows)
end
for i = 1, 4 do
  assert((block(full, i, i) - block(Y, i, i)):max_abs() < 1e-12 * Y:max_abs())
  assert((block(Y_plus, i, i) - block(s.Y_plus:dense(), i, i)):max_abs() < 1e-12 * Y:max_abs())
  assert((block(Y_again, i, i) - block(Y, i, i)):max_abs() < 1e-12 * Y:max_abs())
  for j = 1, 4 do
    local unrelated = i ~= j and math.max(i, j) == 4 and math.min(i, j) > 1 -- right against left and left_hand
    if unrelated then
      assert((block(rest, i, j) - block(psi, 1, i):t() * block(Y, 1, 1) * block(psi, 1, j)):max_abs() < 1e-12 * full:max_abs())
    else
      assert(block(rest, i, j):max_abs() < 1e-12 * full:max_abs())
    end
  end
end

-- ## What a push does
--
-- The two tips, linear rows only: how each yields to a newton on either.

local compliance = (B:star() * s.omega * B):dense()
local function linear(i, j)
  local rows = {}
  for a = 1, 3 do
    rows[a] = {}
    for b = 1, 3 do rows[a][b] = compliance(6 * i - 3 + a, 6 * j - 3 + b) end
  end
  return matrix(rows)
end
for a, axis in ipairs { "x", "y", "z" } do
  print(string.format("left tip, along its %s: effective mass %.6g kg", axis, 1 / linear(1, 1)(a, a)))
end

-- The simulation agrees: a force on the right tip, and the difference it makes to the accelerations of the left one.
local left, right = sat:node "left_hand.tip", sat:node "right.tip"
local before = { left:acceleration() }
right:load { axes = "node" }:set(0, 0, 0, 0, 0, 7)
local axes = { left:attitude() }
local change = vector(quat.rotate(quat.conjugate(axes), vec.sub({ left:acceleration() }, before)))
local predicted = linear(1, 2) * vector { 0, 0, 7 }
assert((change - predicted):max_abs() < 1e-11 * predicted:max_abs())
print(string.format("7 N on the right tip move the left one by (%.6g, %.6g, %.6g) m/s^2", change[1], change[2], change[3]))

-- ## Task-space control
--
-- The hand's three linear rows J_v, the arm's six velocities: J# = M^-1 J_v* Lambda is the right inverse that asks for the least kinetic
-- energy, and a torque (I - J_v* J#*) tau moves the arm without accelerating the hand.

local all, rows = J:dense(), {}
for a = 1, 3 do rows[a] = all[3 + a]:table() end
local J_v = matrix(rows)
local one = matrix { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }
local Lambda = linear(1, 1):solve(one)
local sharp = s.mass:inv() * (J_v:t() * Lambda)
assert((J_v * sharp - one):max_abs() < 1e-12)
local tau = vector { 1, -2, 0.5, 1, 3, -1 }
local null = tau - J_v:t() * (sharp:t() * tau)
assert((J_v * (s.mass:inv() * null)):max_abs() < 1e-12 * (s.mass:inv() * tau):max_abs())
print(string.format("torques that leave the hand alone: %.6g, %.6g, %.6g, %.6g, %.6g, %.6g N m", table.unpack(null:table())))
