-- exit: 2
device { type = "lua/servo", in_step = true, inputs = { x = "1" }, outputs = { y = "1" }, memory = { u = 0 },
         tick = function(a) return { u = a.x } end,
         evaluate = function(a) return {} end }
vehicle "vehicle.yaml"
mission { duration = "1 s" }
