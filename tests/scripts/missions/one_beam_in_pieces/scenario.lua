-- All modes of a beam are its finite elements, whatever they are: of a held or of a free beam, with shapes of an interface, or of two halves
-- that are locked to each other. Undeformed, spinning and pushed at, all four move alike.
local sat = vehicle "vehicle.yaml"
mission { duration = "1 ms", integrator = { method = "dop853", relative = 1e-10 }, output = { rate = "1 kHz" } }
local ways = {
  { middle = "held.middle", ["end"] = "held.end", tool = "held_tool" },
  { middle = "free.middle", ["end"] = "free.end", tool = "free_tool" },
  { middle = "reduced.middle", ["end"] = "reduced.end", tool = "reduced_tool" },
  { middle = "inner.end", ["end"] = "outer.end", tool = "cut_tool" },
}
local loads = {}
for i, way in ipairs(ways) do
  loads[i] = { [sat:node(way.middle):load {}] = { 3, -2, 1, 4, 5, -6 }, [sat:node(way["end"]):load {}] = { -1, 2, 2, -7, 3, 2 }, [sat:node(way.tool):load {}] = { 2, 1, -3, 1, 2, 3 } }
end

local seen = persist { apart = 0, acceleration = 0 }
controller { name = "compares", rate = "1 kHz", step = function(t)
  if t > 0 then return end
  for i in ipairs(ways) do
    for load, wrench in pairs(loads[i]) do load:set(table.unpack(wrench)) end
  end
  for place, name in pairs(ways[1]) do
    local held = sat:node(name)
    local want, want_turning = { held:acceleration() }, { held:angular_acceleration() }
    seen.acceleration = math.max(seen.acceleration, vec.norm(want))
    for i = 2, #ways do
      local other = sat:node(ways[i][place])
      seen.apart = math.max(seen.apart, vec.norm(vec.sub({ other:acceleration() }, want)) / vec.norm(want),
                            vec.norm(vec.sub({ other:angular_acceleration() }, want_turning)) / vec.norm(want_turning))
    end
  end
end }

-- A beam of four elements is known to some 1e-12 of its stiffness.
check { name = "all four", value = function() return seen.apart end, below = 1e-9 }
check { name = "they move", unit = "m/s^2", value = function() return seen.acceleration end, above = 5 }
