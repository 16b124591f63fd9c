-- Closed chains of five and six revolutes that are held by more rows than they have hinges, and move all the same: of Goldberg [1943], two of
-- Bennett's that share a link; of Schatz [1942], in Turbula mixers; of Bricard [1927], trihedral and line-symmetric; of Altmann [1954].
-- Links as Denavit and Hartenberg [1955] tell them: length, twist, offset. The last one is the ground.
local right = math.pi / 2
local links = {
  goldberg = { { 1.4, 1.43493047416001, 0 }, { 1, 1.2, 0 }, { 0.6, 0.5934487938140782, 0 }, { 0.8, 0.8414816803459321, 0 }, { 1, 1.2, 0 } },
  schatz = { { 0, right, 0.5 }, { 1, right, 0 }, { 1, right, 0 }, { 1, right, 0 }, { 0, right, 0 }, { math.sqrt(3), 0, -0.5 } },
  trihedral = { { 0.6, right, 0 }, { 0.8, -right, 0 }, { 0.7, right, 0 }, { math.sqrt(0.77), -right, 0 }, { 0.9, right, 0 }, { 0.5, -right, 0 } },
  symmetric = { { 0.7, 0.9, 0.2 }, { 0.5, 1.3, -0.1 }, { 0.9, 0.6, 0.3 }, { 0.7, 0.9, 0.2 }, { 0.5, 1.3, -0.1 }, { 0.9, 0.6, 0.3 } },
  altmann = { { 1, right, 0 }, { 0.8, right, 0 }, { 0, right, 0 }, { 1, right, 0 }, { 0.8, right, 0 }, { 0, right, 0 } },
}
local sat = vehicle "vehicle.yaml"
mission { duration = 2, integrator = { method = "dop853", relative = 1e-11 } }

-- Each link turns about the z axes of all hinges before it, and so moves; the ground comes back to where it is, for some angle of its own hinge.
local function seen(name, link)
  local q, p, axes, energy = { 1, 0, 0, 0 }, { 0, 0, 0 }, {}, 0
  for i = 1, #link - 1 do
    local hinge, length, twist, offset = sat:hinge(name .. "_" .. i), table.unpack(link[i])
    axes[i] = { along = quat.rotate(q, { 0, 0, 1 }), at = p, rate = hinge:v() }
    q = quat.multiply(q, quat.from_axis_angle({ 0, 0, 1 }, hinge:q()))
    local out = quat.rotate(q, { length, 0, offset })
    local com, w, v = vec.add(p, vec.scale(0.5, out)), { 0, 0, 0 }, { 0, 0, 0 }
    for _, a in ipairs(axes) do
      w = vec.add(w, vec.scale(a.rate, a.along))
      v = vec.add(v, vec.scale(a.rate, vec.cross(a.along, vec.sub(com, a.at))))
    end
    local b = quat.rotate(quat.conjugate(q), w)
    energy = energy + 0.5 * (vec.dot(v, v) + 0.02 * b[1] ^ 2 + 0.03 * b[2] ^ 2 + 0.04 * b[3] ^ 2)
    p, q = vec.add(p, out), quat.multiply(q, quat.from_axis_angle({ 1, 0, 0 }, twist))
  end
  local length, twist, offset = table.unpack(link[#link])
  local back = quat.conjugate(quat.from_axis_angle({ 1, 0, 0 }, twist))
  local hinge = quat.rotate(back, { -length, 0, -offset })      -- the last one, from the ground
  local axis = quat.rotate(back, { 0, 0, 1 })
  return energy, vec.norm(vec.sub(p, hinge)) + vec.norm(vec.sub(quat.rotate(q, { 0, 0, 1 }), axis))
end
for name, link in pairs(links) do
  local first = seen(name, link)
  local start = sat:hinge(name .. "_1"):q()
  check { name = name .. " keeps its energy", unit = "J", equal = { first, tolerance = 1e-8 * first }, value = function() return (seen(name, link)) end }
  check { name = name .. " is closed", below = 1e-9, value = function() return (select(2, seen(name, link))) end }
  check { name = name .. " moves", unit = "rad", above = 0.5, value = function() return math.abs(sat:hinge(name .. "_1"):q() - start) end }
end
check { name = "motions", equal = { 5, tolerance = 0 }, value = function() return #sat:linearize {}.state_names / 2 end }
