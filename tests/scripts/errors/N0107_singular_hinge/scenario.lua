-- exit: 3
local sat = vehicle "../point.yaml"
mission { duration = "1 s" }
