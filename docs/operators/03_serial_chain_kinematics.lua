-- Vehicle: vehicles/chain.yaml
--
-- # 3 Kinematics of a serial chain: scatter and gather
--
-- Source: Rodriguez, Jain, Kreutz-Delgado 1991; Jain 2011, the chapters on serial-chain kinematics and on spatial
-- operators; docs/notation.md for the numbering.
--
-- Each hinge adds H*(k) v(k) to what its body has from its inboard body p:
--
--     V(k) = Phi*(p,k) V(p) + H*(k) v(k)
--
-- With all V(k) stacked in one vector, all Phi(p,k) in E_phi (block (p,k)) and all H(k) on the diagonal of H this reads
--
--     V = E_phi* V + H* v          so          V = (I - E_phi*)^-1 H* v = phi* H* v

local s, sat = sim:operators(), sim:vehicle()
local function same(a, b) return (a - b):max_abs() <= 1e-12 * math.max(a:max_abs(), b:max_abs()) end
local function cat(a, b) return vector { a[1], a[2], a[3], b[1], b[2], b[3] } end
local function in_axes(q, x) return quat.rotate(quat.conjugate(q), x) end

local v = sim:v()
local V = s.phi:star() * (s.H:star() * v)
print(V)

-- What the program tells of the bodies by another way: rate in body axes, velocity of the origin in world axes.
for k, name in ipairs { "shoulder", "upper", "fore" } do
  local body, at = sat:body(name), 6 * (k - 1)
  local told = cat({ body:rate() }, in_axes({ body:attitude() }, { body:velocity() }))
  for i = 1, 6 do assert(math.abs(V[at + i] - told[i]) < 1e-13) end
end

-- ## phi
--
-- E_phi leads from a body to its inboard one, E_phi^2 two steps, and after three steps one has left this chain:
--
--     phi = (I - E_phi)^-1 = I + E_phi + E_phi^2          block (i,j) = Phi(i,j) if i is j or inboard of j, else 0

local E = s.E_phi
assert((s.phi - s.I - E - E * E):norm() < 1e-14)
assert((E * E * E):norm() < 1e-14)
print(s.phi:inv()) -- by rule
assert((s.phi:inv() * s.phi - s.I):norm() < 1e-14)

-- With inboard bodies first, phi is upper block triangular (books that number from the tip have it lower). Nobody forms it:
-- phi* is a sweep from base to tip that *scatters* velocities, phi one from tip to base that *gathers* forces. The first, as a loop:

local Phi, H = s.E_phi:dense(), s.H:dense()
local function block(A, i, j) -- 6 x 6
  local rows = {}
  for r = 1, 6 do
    rows[r] = {}
    for c = 1, 6 do rows[r][c] = A(6 * i - 6 + r, 6 * j - 6 + c) end
  end
  return matrix(rows)
end
local V_k = vector { 0, 0, 0, 0, 0, 0 }
for k = 1, 3 do
  local h = {}
  for i = 1, 6 do h[i] = H(k, 6 * k - 6 + i) * v[k] end -- H*(k) v(k), one hinge velocity each
  V_k = (k > 1 and block(Phi, k - 1, k):t() * V_k or V_k) + vector(h)
  for i = 1, 6 do assert(math.abs(V_k[i] - V[6 * k - 6 + i]) < 1e-14) end
end

-- ## Jacobian
--
-- B* picks the velocity of a node, in its axes, from those of the bodies: V_tip = B* phi* H* v = J v.

local B = s:nodes("fore.tip")
local J = B:star() * s.phi:star() * s.H:star()
print(J)
local tip = sat:node "fore.tip"
assert(same(J * v, cat({ tip:rate() }, in_axes({ tip:attitude() }, { tip:velocity() }))))
print(J:dense())

-- ## Duality
--
-- The adjoint of scattering is gathering: a wrench f on the tip acts on the hinges as tau = J* f = H phi B f, and the power is the
-- same at both ends. (Motors that hold against it give -tau.)

local f = vector { 0, 0, 0, 10, -5, 20 } -- 0 N m; N
local tau = J:star() * f
assert(math.abs(tau:dot(v) - f:dot(J * v)) < 1e-12 * math.abs(tau:dot(v)))
print(string.format("felt in the hinges: %.6g, %.6g, %.6g N m", tau[1], tau[2], tau[3]))
