-- A node of a flexible boom with axes of its own (those of the body permuted: x of the node is y, its y is z, its z is x) carries a hinge,
-- a thruster and an inertial unit; beside it the same at a node along the body's axes, each thing turned by hand.
local sat = vehicle "vehicle.yaml"
mission { duration = 3, integrator = { relative = 1e-11 } }
controller { name = "jets", rate = "1 Hz", step = function(t) sat:device("jet_1"):set("command", 1) sat:device("jet_2"):set("command", 1) end }
local function apart(a, b) return vec.norm(vec.sub(a, b)) end
check { name = "angle", value = function() return sat:hinge("arm_1"):q() - sat:hinge("arm_2"):q() end, equal = { 0, tolerance = 1e-8 } }
check { name = "position", value = function() return apart({ sat:body("arm_1"):position() }, { sat:body("arm_2"):position() }) end, equal = { 0, tolerance = 1e-8 } }
check { name = "rate", value = function() return apart({ sat:body("arm_1"):rate() }, { sat:body("arm_2"):rate() }) end, equal = { 0, tolerance = 1e-8 } }
check { name = "moved", value = function() return vec.norm { sat:body("one"):velocity() } end, above = 0.05 }
check { name = "axes", value = function()
  local a, b = sat:node("boom_1.pad"), sat:node("boom_2.tip")
  local wa, wb = { a:rate() }, { b:rate() }
  return apart(wa, { wb[2], wb[3], wb[1] }) end, equal = { 0, tolerance = 1e-8 } }
check { name = "imu", value = function()
  local a, b = sat:device "imu_1", sat:device "imu_2"
  return apart({ a:get "rate_x", a:get "rate_y", a:get "rate_z" }, { b:get "rate_y", b:get "rate_z", b:get "rate_x" }) +
         apart({ a:get "force_x", a:get "force_y", a:get "force_z" }, { b:get "force_y", b:get "force_z", b:get "force_x" }) end, equal = { 0, tolerance = 1e-8 } }
