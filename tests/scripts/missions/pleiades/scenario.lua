-- The Pleiades of Hairer, Norsett & Wanner (1993, II.10): seven stars of masses 1 to 7 that pull each other with a constant of 1 and pass close to one
-- another. Their places at t = 3 are those of the Test Set for IVP Solvers, which has 13 digits or more by quadruple precision.
device {
  type = "lua/stars", in_step = true,
  mounts = { star_1 = "node", star_2 = "node", star_3 = "node", star_4 = "node", star_5 = "node", star_6 = "node", star_7 = "node" },
  evaluate = function(a)
    local pull = {}
    for i = 1, 7 do
      local force = { 0, 0, 0 }
      for j = 1, 7 do
        local way = vec.sub(a["star_" .. j].position, a["star_" .. i].position)
        if j ~= i then force = vec.add(force, vec.scale(i * j / vec.norm(way) ^ 3, way)) end
      end
      pull["star_" .. i] = { force = force }
    end
    return pull
  end,
}
local sat = vehicle "vehicle.yaml"
mission { duration = 3, integrator = { method = "dop853", relative = 1e-13 }, output = { rate = "1 Hz" } }
local places = {
  { 0.3706139143970502, -3.943437585517392 }, { 3.237284092057233, -3.271380973972550 }, { -3.222559032418324, 5.225081843456543 }, { 0.6597091455775310, -2.590612434977470 },
  { 0.3425581707156584, 1.198213693392275 }, { 1.562172101400631, -0.2429682344935824 }, { -0.7003092922212495, 1.091449240428980 },
}
-- Errors of the tolerance grow by some hundred as stars pass each other.
for i, place in ipairs(places) do
  check {
    name = "star " .. i, unit = "m", below = 1e-10,
    value = function() return vec.norm(vec.sub({ sat:body("star_" .. i):position() }, { place[1], place[2], 0 })) end,
  }
end
