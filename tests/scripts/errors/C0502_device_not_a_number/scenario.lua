-- exit: 2
device { type = "lua/over_zero", inputs = { x = "1" }, outputs = { y = "1" }, tick = function(a) return { y = 0 * a.x / 0 } end }
vehicle "vehicle.yaml"
mission { duration = "1 s" }
