-- exit: 2
device { type = "lua/push", in_step = true, mounts = { at = "node" },
         evaluate = function(a) return { at = { force = { 1, 0, 0 }, torque = { 0, 0, 1 } } } end }
vehicle "vehicle.yaml"
mission { duration = "1 s" }
