-- exit: 3
local sat = vehicle "../pendulum.yaml"
mission { duration = "1 s" }
phase { name = "day", until_ = function(t) return t >= 0.5 end, next = "night" }
phase { name = "night", until_ = function(t) return t >= 0.5 end, next = "day" }
