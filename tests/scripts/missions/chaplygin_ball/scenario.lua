-- A ball of other inertia about each axis that rolls [Chaplygin 1903]: its angular momentum about the place of contact stays in space. With
-- it attitude alone is left, (J + m r^2 (1 - u u*)) w = R* L, u the upward direction in the axes of the ball.
local sat = vehicle "vehicle.yaml"
local J, m, g, k, t = { 0.002, 0.003, 0.0042 }, 1, 9.81, 1e7, 5
local r = 0.1 - 0.5 * m * g / k                       -- friction acts in the middle of what it sinks by
mission { duration = t, integrator = { method = "cvode_bdf", relative = 1e-9 } }
local w0 = { 3, 4, 2 }
initial { ball = { velocity = { r * w0[2], -r * w0[1], 0 } } }

local L = { (J[1] + m * r * r) * w0[1], (J[2] + m * r * r) * w0[2], J[3] * w0[3] }
local function rate(q)
  local back = quat.conjugate(q)
  local u, A = quat.rotate(back, { 0, 0, 1 }), {}
  for i = 1, 3 do
    A[i] = {}
    for j = 1, 3 do A[i][j] = (i == j and J[i] + m * r * r or 0) - m * r * r * u[i] * u[j] end
  end
  local w = matrix(A):solve(vector(quat.rotate(back, L)))
  return { w[1], w[2], w[3] }
end
-- Of attitude and place, by the classical method of Runge and Kutta.
local function slope(x)
  local q = { x[1], x[2], x[3], x[4] }
  local w = rate(q)
  local turn, W = quat.multiply(q, { 0, w[1], w[2], w[3] }), quat.rotate(q, w)
  return vector { turn[1] / 2, turn[2] / 2, turn[3] / 2, turn[4] / 2, r * W[2], -r * W[1] }
end
local x, N = vector { 1, 0, 0, 0, 0, 0 }, 500
for _ = 1, N do
  local h = t / N
  local a = slope(x)
  local b = slope(x + h / 2 * a)
  local c = slope(x + h / 2 * b)
  x = x + h / 6 * (a + 2 * b + 2 * c + slope(x + h * c))
end

-- Friction creeps at 1e-5 m/s times its share of what holds, a tenth, for 5 s.
local ball = sat:body "ball"
for i, axis in ipairs { "x", "y" } do
  check { name = "way along " .. axis, unit = "m", equal = { x[4 + i], tolerance = 1e-5 }, value = function() return (select(i, ball:position())) end }
end
check { name = "attitude", unit = "rad", below = 1e-4, value = function() return vec.norm(quat.error({ x[1], x[2], x[3], x[4] }, { ball:attitude() })) end }
local w = rate { x[1], x[2], x[3], x[4] }
check { name = "rate", unit = "rad/s", below = 5e-4, value = function() return vec.norm(vec.sub(w, { ball:rate() })) end }
