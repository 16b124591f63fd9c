-- Vehicle: vehicles/boom.yaml
--
-- # 11 Flexible bodies
--
-- Source: Jain, Rodriguez 1992 (J. Guidance 15(6)); Jain 2011, the chapter on flexible bodies; docs/mathematics/flexible.md.
--
-- A flexible body has a frame B and m modal coordinates eta beside it. Its velocity is V_fl = [ V ; eta' ], 6 + m numbers, and a node
-- of it moves by V_n = X_n V + Gamma_n eta', Gamma_n holding the mode shapes there. The letters get more columns, and stay:
--
--     H*(k)      = [ X_B H*_h   -X_B Gamma_P ]       modes of k: further velocities of its own hinge
--                  [    0             1      ]
--     Phi*(p,k)  = [ X_BA   X_BO Gamma_O ]           deformation of p at O carries k along
--                  [  0          0       ]           and nothing of p's modes becomes a mode of k
--     M_fl(eta)  = [ M_rr  M_re ; M_re*  M_ee ]      M_ee = 1 for mass-normalised modes

local s, sat = sim:operators(), sim:vehicle()
local function zero(A, scale) return A:norm() <= 1e-12 * scale end
local function modes(name) return name:find "eta_" ~= nil end

local E, H, M = s.E_phi:dense(), s.H:dense(), s.M:dense()
local body, hinge = s:names "body", s:names "hinge"
for i, name in ipairs(body) do
  if modes(name) then
    for j = 1, #body do assert(E(j, i) == 0) end -- modal forces never pass to another body
    for j, other in ipairs(body) do
      if modes(other) then assert(math.abs(M(i, j) - (i == j and 1 or 0)) < 1e-10) end
    end
  end
end
print(string.format("v: %d numbers, of them %d of modes; V: %d", #hinge, sat:modes("boom"):count(), #body))

-- The boom is clamped to its drive (cantilever modes), so Gamma_P = 0, and each mode is a column of its own in H*. The camera hangs at the
-- tip, which bends: its velocity has a part Gamma_O eta', in Phi*. The simulation agrees:

local v = vector { 0.01, -0.02, 0.03, 0.1, 0.2, -0.1, 0.05, 0.4, -0.3, 0.1, 0.2, 0.5 }
sim:state { v = v }
local V = s.phi:star() * (s.H:star() * v)
local camera = sat:body "camera"
local told = quat.rotate(quat.conjugate { camera:attitude() }, { camera:velocity() })
for i, name in ipairs { "camera:vx", "camera:vy", "camera:vz" } do assert(math.abs(V[name] - told[i]) < 1e-13) end
local rate = { camera:rate() }
for i, name in ipairs { "camera:wx", "camera:wy", "camera:wz" } do assert(math.abs(V[name] - rate[i]) < 1e-13) end

-- ## The same lines as for rigid bodies
--
-- No derivation asked how long V(k) is, or whether a column of H* is a hinge or a mode.

local L = s.I + s.H * s.phi * s.K
assert(zero(s.P - s.M - s.E_psi * s.P * s.E_psi:star(), s.P:norm()))
assert(zero(L * s.D * L:star() - s.mass, s.mass:norm()))
assert(zero(s.H * s.P_plus, s.P:norm()))
assert(zero(L * (s.I - s.H * s.psi * s.K) - s.I, L:norm() ^ 2))

-- D has one block for hinge and modes of the boom together, 5 x 5. The program never factors it: modes first, by a constant factor, then
-- the hinge (flexible.md section 6). The result is the same D, by another way. Only rigid rows of P+ go on to the bus:

local D, P_plus = s.D:dense(), s.P_plus:dense()
assert(D("boom.rate", "boom.etadot_2") ~= 0 and D("boom.rate", "camera.rate") == 0)
for i, name in ipairs(body) do
  if modes(name) then assert(math.abs(P_plus(i, i)) < 1e-10) end -- a free mode transmits nothing
end

-- ## Frequencies of the whole
--
-- For small motions M v' = - [ 0 ; K eta ], K = diag(omega_k^2). The block of M^-1 that belongs to the modes is what all other
-- velocities, following freely, leave of it: K^1/2 (M^-1)_ee K^1/2 has the squares of the system's frequencies as eigenvalues. At eta = 0:

local q = sim:q()
for k = 1, 4 do q["boom.eta_" .. k] = 0 end
sim:state { q = q }
local cantilever, etas = sat:modes "boom", { "boom.etadot_1", "boom.etadot_2", "boom.etadot_3", "boom.etadot_4" }
local function frequencies(t)
  local inverse, rows = t.mass:inv():dense(), {}
  for i, a in ipairs(etas) do
    rows[i] = {}
    for j, b in ipairs(etas) do
      rows[i][j] = (2 * math.pi) ^ 2 * cantilever:frequency(i) * cantilever:frequency(j) * inverse(a, b)
    end
  end
  local squares = matrix(rows):eigenvalues()
  return string.format("%.6g, %.6g, %.6g, %.6g Hz", math.sqrt(squares[1]) / (2 * math.pi), math.sqrt(squares[2]) / (2 * math.pi),
    math.sqrt(squares[3]) / (2 * math.pi), math.sqrt(squares[4]) / (2 * math.pi))
end
-- Which velocities take part is a matter of `articulate`: what is not free is held (page 13). Which bodies, of `subgraph`.
local alone, loaded, flying = sim:operators():subgraph "boom", sim:operators():subgraph { "boom", "camera" }, sim:operators()
local function but(t, held) -- all names of the hinge space but one
  local names = {}
  for _, name in ipairs(t:names "hinge") do
    if name ~= held then names[#names + 1] = name end
  end
  return names
end
for _, t in ipairs { alone, loaded, flying } do t:articulate { free = but(t, "boom.rate") } end
print("clamped, alone:          " .. frequencies(alone))
print("clamped, with camera:    " .. frequencies(loaded))
print("on the free satellite:   " .. frequencies(flying))
print("and with a loose drive:  " .. frequencies(sim:operators()))

-- ## Stiff modes, implicitly
--
-- A step of h with the force of the modes taken at its end asks for (M + h^2 K) v' = ..., W = h^2 K a diagonal. It goes into D, and no line
-- of the recursion gets longer: D = H P H* + W, G and P+ as before, H G = I no longer.

local step = sim:operators()
local h, W = 0.1, {}
for i, name in ipairs(hinge) do
  local k = tonumber(name:match "etadot_(%d)")
  W[i] = k and (h * 2 * math.pi * cantilever:frequency(k)) ^ 2 or 0
end
step:articulate { W = W }
local L_W = step.I + step.H * step.phi * step.K
local with_W = step.mass * v
for i = 1, #v do with_W[i] = with_W[i] + W[i] * v[i] end
assert(((L_W * step.D * L_W:star()) * v - with_W):max_abs() < 1e-12 * with_W:max_abs())
assert((step.H * step.G - step.I):norm() > 0.1)
