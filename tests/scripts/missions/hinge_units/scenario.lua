-- Devices at hinges that turn and that slide have the units of these, in faults of their ports and in linear models.
local sat = vehicle "vehicle.yaml"
local turn, way = sat:device "turn", sat:device "way"
mission { duration = 1 }
turn:fault { port = "position", bias = "2 deg", drift = "1 deg/s" }
way:fault { port = "position", bias = "3 mm", drift = "-1 mm/s" }
local told
controller { name = "asks once", rate = "1 Hz", step = function(t)
  if t > 0 then return end
  local model = sat:linearize { outputs = { "bearing:force", "rail:force", "bearing.bending", "rail.bending" } }
  told = table.concat(model.output_units, ", ")
  assert(told == "N m, N, rad, m", told)
end }
check { name = "reading of the turn", unit = "deg", value = function() return math.deg(turn:get "position") end, equal = { 3, tolerance = 1e-12 } }
check { name = "reading of the way", unit = "mm", value = function() return 1e3 * way:get "position" end, equal = { 2, tolerance = 1e-12 } }
