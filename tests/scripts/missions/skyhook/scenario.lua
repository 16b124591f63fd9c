-- A tether stands upright in orbit, turning once in each turn, and its upper end is let go [Moravec 1977]: it flies on at n r, faster than a
-- circle's speed there, the lower end slower, n^2 being the pull on both over the sum of m r. Ends locked to each other would be one body, 732 m off.
local sat = vehicle "vehicle.yaml"
local mu, low, high = 398600.4418e9, 7000e3, 7200e3
local n = math.sqrt(mu * (3 / low ^ 2 + 1 / high ^ 2) / (3 * low + high))
local turn = 2 * math.pi / n
mission { duration = 1.5 * turn, integrator = { method = "dop853", relative = 1e-12 }, output = { period = "100 s" } }
initial { low = { position = { low, 0, 0 }, velocity = { 0, n * low, 0 }, angular_velocity = { 0, 0, n } } }
sat:hinge "high":profile { hold = 0 }
local off = persist {}
sequence { name = "let go", run = function()
  at(turn)
  off.place = vec.norm(vec.sub({ sat:body "low":position() }, { low, 0, 0 }))
  sat:detach "high"
end }
check { name = "place after a turn", unit = "m", value = function() return off.place end, below = 1e-4 }
for name, r in pairs { low = low, high = high } do
  local axis = 1 / (2 / r - (n * r) ^ 2 / mu)
  check { name = "axis of " .. name, unit = "m", equal = { axis, tolerance = 1e-4 },
          value = function() return orbit.elements({ sat:node(name):position() }, { sat:node(name):velocity() }, mu).a end }
end
