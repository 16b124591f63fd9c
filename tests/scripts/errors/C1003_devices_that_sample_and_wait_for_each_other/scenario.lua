-- exit: 2
device { type = "lua/gain", inputs = { x = "1" }, outputs = { y = "1" }, tick = function(a) return { y = 2 * a.x } end }
device { type = "lua/through", in_step = true, inputs = { x = "1" }, outputs = { y = "1" }, evaluate = function(a) return { y = a.x } end }
vehicle "vehicle.yaml"
mission { duration = "1 s" }
